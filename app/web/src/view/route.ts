// The path, as a line of so many pixels: cased, and faint where the surface hides it.
import { Group } from "three";
import { Line2 } from "three/examples/jsm/lines/Line2.js";
import { LineGeometry } from "three/examples/jsm/lines/LineGeometry.js";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import type { Stage } from "./scene";

const COLOUR = 0xe6005c;
const CASING = 0xffffff;

export class RouteLine {
  private readonly object = new Group();
  private geometry = new LineGeometry();

  constructor(private readonly stage: Stage) {
    this.object.add(
      this.line({ color: COLOUR, linewidth: 3, opacity: 0.28, depthTest: false }, 3),
      this.line({ color: CASING, linewidth: 7, opacity: 0.95, polygonOffsetUnits: -50000 }, 4),
      this.line({ color: COLOUR, linewidth: 4, opacity: 1, polygonOffsetUnits: -60000 }, 5),
    );
    this.object.visible = false;
    stage.addOverlay(this.object);
  }

  /** Show a line through positions as they are drawn; none where there are fewer than two. */
  show(points: [number, number, number][]): void {
    this.object.visible = points.length > 1;
    this.geometry.dispose();
    if (points.length > 1) {
      this.geometry = new LineGeometry();
      this.geometry.setPositions(points.flat());
      for (const line of this.object.children) (line as Line2).geometry = this.geometry;
    }
    this.stage.invalidateOverlay();
  }

  private line(
    look: { color: number; linewidth: number; opacity: number; depthTest?: boolean; polygonOffsetUnits?: number },
    order: number,
  ): Line2 {
    const material = new LineMaterial({
      ...look,
      transparent: true,
      depthWrite: false,
      polygonOffset: true,
      polygonOffsetFactor: 0,
    });
    const line = new Line2(this.geometry, material);
    line.renderOrder = order;
    return line;
  }
}
