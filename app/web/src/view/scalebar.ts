// The scale bar: the length on the screen of a round number of mesh units.
import { byId, written } from "../dom";
import type { Stage } from "./scene";

const LONGEST_PX = 150;

export function showScaleBar(stage: Stage, radius: number | null): void {
  const bar = byId("scalebar");
  bar.hidden = radius === null;
  if (radius === null) return;
  const pixels = stage.pixelsPerUnit / radius;
  const longest = LONGEST_PX / pixels;
  const power = 10 ** Math.floor(Math.log10(longest));
  const length = power * [5, 2, 1].find((step) => step * power <= longest)!;
  byId("scalebar-line").style.width = `${length * pixels}px`;
  byId("scalebar-length").textContent = written(length, 3);
}
