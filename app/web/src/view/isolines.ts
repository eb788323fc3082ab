// Isolines and borders as thin lines with a dark casing, so that they show on each colour.

import type { Isoline } from "geodesic-client";
import { BufferGeometry } from "three";
import type { LoadedMesh } from "../mesh/loader";
import { ribbonMesh, ribbons } from "./ribbon";
import { LINES, type Stage } from "./scene";

export class IsolineLayer {
  private readonly object: ReturnType<typeof ribbonMesh>;

  constructor(
    private readonly stage: Stage,
    colour = 0xffffff,
    inner = 1.2,
  ) {
    this.object = ribbonMesh({
      colour,
      casing: 0x1e293b,
      inner,
      width: inner + 1.4,
      opacity: 1,
      before: 0.001,
      order: 1,
    });
    this.object.visible = false;
    this.object.layers.set(LINES);
    stage.add(this.object);
  }

  /** Show lines on a mesh, in place of the ones before. A closed line does not repeat its start. */
  show(
    mesh: Pick<LoadedMesh, "drawnLines"> | null,
    lines: Pick<Isoline, "points" | "closed" | "faces">[],
  ): void {
    const isShown = mesh !== null && lines.length > 0;
    if (!isShown && !this.object.visible) return;
    this.object.visible = isShown;
    this.object.geometry.dispose();
    this.object.geometry = isShown
      ? ribbons(
          lines.flatMap(({ points, faces, closed }) =>
            mesh.drawnLines(points ?? [], faces, closed),
          ),
        )
      : new BufferGeometry();
    this.stage.invalidate();
  }
}
