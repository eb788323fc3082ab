// The scale bar: the length on the screen of a round number of mesh units.
import { byId, written } from "../dom";
import type { Stage } from "./scene";

/** The longest bar, in pixels and as a share of the canvas. */
const LONGEST = { pixels: 150, share: 0.22 };

export function showScaleBar(stage: Stage, radius: number | null): void {
  const bar = byId("scalebar");
  bar.hidden = radius === null;
  if (radius === null) return;
  const pixels = stage.pixelsPerUnit / radius;
  const longest = Math.min(LONGEST.pixels, LONGEST.share * stage.canvas.clientWidth) / pixels;
  const power = 10 ** Math.floor(Math.log10(longest));
  const length = power * [5, 2, 1].find((step) => step * power <= longest)!;
  byId("scalebar-line").style.width = `${length * pixels}px`;
  byId("scalebar-length").textContent = written(length, 3);
}
