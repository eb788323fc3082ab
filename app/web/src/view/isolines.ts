// Isolines as thin lines with a dark casing, so that they show on each colour.
import { BufferGeometry } from "three";
import { ribbonMesh, ribbons } from "./ribbon";
import type { Stage } from "./scene";
import type { Triple } from "./simplified";

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
    stage.add(this.object);
  }

  /** Show lines through drawn positions, in place of the ones before. */
  show(lines: Triple[][]): void {
    if (lines.length === 0 && !this.object.visible) return;
    this.object.visible = lines.length > 0;
    this.object.geometry.dispose();
    this.object.geometry = lines.length > 0 ? ribbons(lines) : new BufferGeometry();
    this.stage.invalidate();
  }
}
