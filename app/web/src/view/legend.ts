// The legend: the meaning of the colours.
import { byId, written } from "../dom";
import type { Palette } from "../state/state";
import { css, type Rgb, ramp } from "./colours";

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

/** Show by how much two fields differ; null: nothing. */
export function showDifference(words: string | null): void {
  const line = byId("difference");
  line.hidden = words === null;
  line.textContent = words ?? "";
}

/** Show the scale from ``least`` to ``largest``. */
export function showScale(title: string, largest: number, least = 0): void {
  byId("legend").hidden = false;
  byId("legend-title").textContent = title;
  byId("territories").replaceChildren();
  byId("scale").hidden = false;
  for (const [i, share] of [0, 0.5, 1].entries()) {
    byId(`tick-${i}`).textContent = written(least + share * (largest - least), 3);
  }
}

/** Show the colour of each territory, and its area where it is known. */
export function showTerritories(
  territories: { name: string; area: string; colour: Rgb }[],
  unit: string,
): void {
  byId("legend").hidden = false;
  const isMeasured = territories.some(({ area }) => area);
  byId("legend-title").textContent = isMeasured ? `Nearest start, area${unit}` : "Nearest start";
  byId("scale").hidden = true;
  byId("territories").replaceChildren(
    ...territories.map(({ name, area, colour }) => {
      const row = document.createElement("li");
      const dot = document.createElement("span");
      dot.className = "dot";
      dot.style.background = css(colour);
      row.append(dot, area ? `${name}: ${area}` : name);
      return row;
    }),
  );
}
