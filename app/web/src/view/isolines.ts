// Isolines as thin lines with a dark casing, so that they show on each colour.
import { BufferGeometry, Group, type Mesh } from "three";
import { ribbonMesh, ribbons, type Triple } from "./ribbon";
import type { Stage } from "./scene";

const COLOUR = 0xffffff;
const CASING = 0x1e293b;

export class IsolineLayer {
  private readonly object = new Group();
  private geometry = new BufferGeometry();

  constructor(private readonly stage: Stage) {
    this.object.add(
      ribbonMesh({ colour: CASING, width: 2.6, opacity: 1, before: 0.0008, order: 1 }),
      ribbonMesh({ colour: COLOUR, width: 1.2, opacity: 1, before: 0.001, order: 2 }),
    );
    this.object.visible = false;
    stage.add(this.object);
  }

  /** Show lines through drawn positions, in place of the ones before. */
  show(lines: Triple[][]): void {
    if (lines.length === 0 && !this.object.visible) return;
    this.object.visible = lines.length > 0;
    this.geometry.dispose();
    this.geometry = ribbons(lines);
    for (const layer of this.object.children) (layer as Mesh).geometry = this.geometry;
    this.stage.invalidate();
  }
}
