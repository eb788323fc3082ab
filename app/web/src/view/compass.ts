// The axes in a corner of the canvas: a click on one looks along it.
import type { PerspectiveCamera, WebGLRenderer } from "three";
import { ViewHelper } from "three/examples/jsm/helpers/ViewHelper.js";
import type { Up } from "../mesh/frame";

/** On a canvas that is narrower than this, in pixels, the axes would lie on the mesh. */
const NARROW = 500;
/** Seconds in which any turn has ended: the camera jumps. */
const LONG = 100;

export class Compass {
  private readonly helper: ViewHelper;
  /** Whether there is a mesh to see the axes of. */
  isShown = false;

  constructor(
    private readonly camera: PerspectiveCamera,
    private readonly canvas: HTMLCanvasElement,
  ) {
    this.helper = new ViewHelper(camera, canvas);
    // In the upper right corner, from the edges: null is what the opposite edge determines.
    Object.assign(this.helper.location, { top: 0, right: 0, bottom: null, left: null });
  }

  /** Name the axes as they are in the mesh: what is drawn upwards is y or z. */
  name(up: Up): void {
    if (up === "y") this.helper.setLabels("X", "Y", "Z");
    else this.helper.setLabels("X", "Z", "−Y");
  }

  draw(renderer: WebGLRenderer): void {
    if (this.isVisible) this.helper.render(renderer);
  }

  /** Turn the camera around a centre to where a click leads; return whether it hit an axis. */
  click(event: PointerEvent, centre: { x: number; y: number; z: number }): boolean {
    if (!this.isVisible) return false;
    this.helper.center.set(centre.x, centre.y, centre.z);
    if (!this.helper.handleClick(event)) return false;
    while (this.helper.animating) this.helper.update(LONG);
    this.camera.updateMatrixWorld();
    return true;
  }

  private get isVisible(): boolean {
    return this.isShown && this.canvas.clientWidth >= NARROW;
  }
}
