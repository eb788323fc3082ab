// Isolines and borders as thin lines with a dark casing, so that they show on each colour.

import type { Isoline } from "geodesic-client";
import { BufferGeometry } from "three";
import type { LoadedMesh } from "../mesh/loader";
import { ribbonMesh, ribbons } from "./ribbon";
import { LINES, type Stage } from "./scene";

export class IsolineLayer {
  private readonly object = ribbonMesh({
    colour: 0xffffff,
    casing: 0x1e293b,
    inner: 1.2,
    width: 2.6,
    opacity: 1,
    before: 0.001,
    order: 1,
  });

  constructor(private readonly stage: Stage) {
    this.object.visible = false;
    this.object.layers.set(LINES);
    stage.add(this.object);
  }

  /** Show lines on a mesh, in place of the ones before. A closed line does not repeat its start. */
  show(mesh: Pick<LoadedMesh, "drawn"> | null, lines: Pick<Isoline, "points" | "closed">[]): void {
    const isShown = mesh !== null && lines.length > 0;
    if (!isShown && !this.object.visible) return;
    this.object.visible = isShown;
    this.object.geometry.dispose();
    this.object.geometry = isShown
      ? ribbons(
          lines.map((line) => {
            const points = line.points ?? [];
            return (line.closed ? [...points, points[0]!] : points).map((point) =>
              mesh.drawn(point),
            );
          }),
        )
      : new BufferGeometry();
    this.stage.invalidate();
  }
}
