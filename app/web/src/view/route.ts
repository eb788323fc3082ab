// A path as a line with a casing; faint where the surface hides it.
import { BufferGeometry, Group, type Mesh } from "three";
import { ribbonMesh, ribbons } from "./ribbon";
import type { Stage } from "./scene";
import type { Triple } from "./simplified";

export class RouteLine {
  private readonly object = new Group();
  private geometry = new BufferGeometry();

  constructor(
    private readonly stage: Stage,
    colour: number,
  ) {
    const colours = { colour, casing: 0xffffff };
    this.object.add(
      ribbonMesh({ ...colours, inner: 3, width: 3, opacity: 0.28, before: null, order: 3 }),
      ribbonMesh({ ...colours, inner: 4, width: 7, opacity: 1, before: 0.007, order: 4 }),
    );
    this.object.visible = false;
    stage.addOverlay(this.object);
  }

  /** Show lines through drawn positions; none hides it. */
  show(lines: Triple[][]): void {
    this.object.visible = lines.some((points) => points.length > 1);
    this.geometry.dispose();
    this.geometry = ribbons(lines);
    for (const line of this.object.children) (line as Mesh).geometry = this.geometry;
    this.stage.invalidateOverlay();
  }
}
