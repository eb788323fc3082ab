// The legend: the meaning of the colours.
import { byId, written } from "../dom";
import type { Palette } from "../state/state";
import { css, ramp, territory } from "./colours";

export function drawRamp(palette: Palette): void {
  const strip = byId("ramp", HTMLCanvasElement);
  const colours = ramp(palette);
  strip.width = colours.length;
  strip.height = 1;
  const context = strip.getContext("2d")!;
  colours.forEach((colour, i) => {
    context.fillStyle = css(colour);
    context.fillRect(i, 0, 1, 1);
  });
}

export function hideLegend(): void {
  byId("legend").hidden = true;
}

/** Show what the pointer is at; null: nothing. */
export function showHere(words: string | null): void {
  const here = byId("here");
  here.hidden = words === null;
  here.textContent = words ?? "";
}

/** Show what is proved of the distances; null: nothing. */
export function showProof(words: string | null): void {
  const badge = byId("proof");
  badge.hidden = words === null;
  badge.textContent = words ?? "";
}

/** Show the scale from 0 to ``largest``. */
export function showScale(title: string, largest: number): void {
  byId("legend").hidden = false;
  byId("legend-title").textContent = title;
  byId("territories").replaceChildren();
  byId("scale").hidden = false;
  for (const [i, share] of [0, 0.5, 1].entries()) {
    byId(`tick-${i}`).textContent = written(share * largest, 3);
  }
}

/** Show the colour of each source's territory. */
export function showTerritories(sources: string[]): void {
  byId("legend").hidden = false;
  byId("legend-title").textContent = "Nearest start";
  byId("scale").hidden = true;
  byId("territories").replaceChildren(
    ...sources.map((name, i) => {
      const row = document.createElement("li");
      const dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = css(territory(i));
      row.append(dot, name);
      return row;
    }),
  );
}
