// The path as a line with a casing; faint where the surface hides it.
import { BufferGeometry, Group, type Mesh } from "three";
import { ribbonMesh, ribbons, type Triple } from "./ribbon";
import type { Stage } from "./scene";

const COLOUR = 0xe6005c;
const CASING = 0xffffff;

export class RouteLine {
  private readonly object = new Group();
  private geometry = new BufferGeometry();

  constructor(private readonly stage: Stage) {
    this.object.add(
      ribbonMesh({ colour: COLOUR, width: 3, opacity: 0.28, before: null, order: 3 }),
      ribbonMesh({ colour: CASING, width: 7, opacity: 0.95, before: 0.006, order: 4 }),
      ribbonMesh({ colour: COLOUR, width: 4, opacity: 1, before: 0.0072, order: 5 }),
    );
    this.object.visible = false;
    stage.addOverlay(this.object);
  }

  /** Show a line through drawn positions; fewer than two hide it. */
  show(points: Triple[]): void {
    this.object.visible = points.length > 1;
    this.geometry.dispose();
    this.geometry = ribbons([points]);
    for (const line of this.object.children) (line as Mesh).geometry = this.geometry;
    this.stage.invalidateOverlay();
  }
}
