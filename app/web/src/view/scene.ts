// The canvas: a camera around the mesh, and a new frame after each change.
import {
  ColorManagement,
  LinearSRGBColorSpace,
  type Mesh,
  MOUSE,
  type Object3D,
  PerspectiveCamera,
  type Plane,
  type Points,
  Scene,
  Spherical,
  TOUCH,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Backdrop } from "./backdrop";
import { Compass } from "./compass";
import { SECTION } from "./section";

ColorManagement.enabled = false; // colours are given in sRGB, as displayed

/** The angle of what the camera sees, in degrees. */
const FIELD = 38;
/** How far the camera stays away beyond what the mesh needs. */
const MARGIN = 1.12;
/** The direction to look from at what is flat: from higher up. */
const ABOVE = new Vector3(0.4, 0.9, 0.8);
/** Below this half height, in radii of the unit ball, a mesh is flat. */
const FLAT = 0.3;

/** The layer of lines on the surface, which may be hidden all at once. */
export const LINES = 1;

/** Lines or points, whose data say how they are drawn and whose geometry's data say where. */
export type Shape = Mesh | Points;

export class Stage {
  private readonly scene = new Scene();
  /** Objects that move while the mesh stands still; drawn over it. */
  private readonly overlay = new Scene();
  private readonly backdrop: Backdrop;
  readonly camera = new PerspectiveCamera(FIELD, 1, 0.01, 50);
  private readonly controls: OrbitControls;
  readonly renderer: WebGLRenderer;
  readonly compass: Compass;
  /** Drawn positions of the mesh, three numbers each, which a view of the whole mesh shows. */
  shape: ArrayLike<number> = [];
  /** The direction from which it is seen first. */
  front = new Vector3(0, 0, 1);
  /** The direction from which the whole mesh is seen, as long as nobody moves it. */
  private whole: Vector3 | null = null;
  onMove: (view: number[]) => void = () => undefined;
  onFrame: () => void = () => undefined;
  private isDue = false;
  private patient = 0;
  private readonly waiting: (() => void)[] = [];

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.outputColorSpace = LinearSRGBColorSpace;
    this.renderer.autoClear = false;
    this.renderer.localClippingEnabled = true;
    this.backdrop = new Backdrop(this.renderer);
    this.renderer.debug.checkShaderErrors = false; // asking would wait for the compiler
    this.compass = new Compass(this.camera, canvas);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.rotateSpeed = 0.9;
    this.controls.addEventListener("change", () => this.invalidate());
    let before: number[] | null = null;
    this.controls.addEventListener("start", () => (before ??= this.view)); // each finger starts
    this.controls.addEventListener("end", () => {
      if (before && this.view.some((x, i) => Math.abs(x - before![i]!) > 1e-4)) this.moved();
      before = null;
    });
    this.camera.layers.enable(LINES);
    this.lookAtAll();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  /** Set whether dragging one pointer turns the mesh; two fingers always move it. */
  set turnsByDrag(turns: boolean) {
    this.controls.mouseButtons.LEFT = turns ? MOUSE.ROTATE : null;
    this.controls.touches.ONE = turns ? TOUCH.ROTATE : null;
  }

  /** Set whether isolines, borders and rays are drawn. */
  set showsLines(shows: boolean) {
    if (shows) this.camera.layers.enable(LINES);
    else this.camera.layers.disable(LINES);
    this.invalidate();
  }

  /** Draw a frame soon. */
  invalidate(): void {
    this.backdrop.forget();
    this.schedule();
  }

  /** Draw a frame in which only the overlay has changed, within ``patience`` milliseconds. */
  invalidateOverlay(patience = 0): void {
    if (patience === 0) this.schedule();
    else this.patient ||= setTimeout(() => this.schedule(), patience);
  }

  private schedule(): void {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => this.render());
  }

  /** Wait until the present state has been drawn. */
  drawn(): Promise<void> {
    this.schedule();
    return new Promise((resolve) => this.waiting.push(resolve));
  }

  /** Draw a mesh of so many faces from now on. */
  fit(faces: number): void {
    this.backdrop.fit(faces);
  }

  /** Compile the shaders of an object before it is first shown. */
  warmUp(object: Object3D): void {
    this.scene.add(object);
    this.backdrop.forget();
    this.renderNow();
    this.scene.remove(object);
    this.invalidate();
  }

  add(object: Object3D): void {
    this.scene.add(object);
    this.invalidate();
  }

  addOverlay(object: Object3D): void {
    this.overlay.add(object);
    this.invalidateOverlay();
  }

  remove(object: Object3D): void {
    this.scene.remove(object);
    this.invalidate();
  }

  /** Azimuth, polar angle, distance and target of the camera. */
  get view(): number[] {
    const { target } = this.controls;
    const away = new Spherical().setFromVector3(this.camera.position.clone().sub(target));
    return [away.theta, away.phi, away.radius, target.x, target.y, target.z];
  }

  private moved(): void {
    this.whole = null;
    this.onMove(this.view);
  }

  /** Show the whole mesh from a direction, whatever size the canvas gets. */
  lookAtAll(direction = this.isFlat() ? ABOVE : this.front): void {
    this.look(this.viewFrom(direction));
    this.whole = direction;
  }

  /** Show the whole mesh from an azimuth and a polar angle, and remember this. */
  lookFrom(theta: number, phi: number): void {
    const distance = MARGIN * this.distanceFrom(theta, phi);
    this.look([theta, phi, distance, 0, 0, 0]);
    this.moved();
  }

  /** Look along the axis that a click in the corner hits; return whether it hits one. */
  clickAxes(event: PointerEvent): boolean {
    if (!this.compass.click(event, this.controls.target)) return false;
    this.look(this.view);
    this.moved();
    return true;
  }

  /** Move the camera to a view. */
  look(view: number[]): void {
    this.whole = null;
    const [theta, phi, radius, x, y, z] = view;
    this.controls.target.set(x!, y!, z!);
    this.camera.position
      .setFromSpherical(new Spherical(radius, phi, theta))
      .add(this.controls.target);
    this.controls.update();
    this.camera.updateMatrixWorld(); // points may be picked before the next frame
    this.invalidate();
  }

  /** Return the view of the whole mesh from a direction, kept off the poles, where up is undefined. */
  private viewFrom(direction: Vector3): number[] {
    const { theta, phi } = new Spherical().setFromVector3(direction);
    const tilt = Math.min(Math.max(phi, 0.4), Math.PI - 0.4);
    return [theta, tilt, MARGIN * this.distanceFrom(theta, tilt), 0, 0, 0];
  }

  /** Return how far the camera must be away for the mesh to fit into the canvas. */
  private distanceFrom(theta: number, phi: number): number {
    const towards = new Vector3().setFromSphericalCoords(1, phi, theta);
    const right = new Vector3(0, 1, 0).cross(towards).normalize();
    const up = towards.clone().cross(right);
    const slope = Math.tan((this.camera.fov * Math.PI) / 360);
    const aspect = this.canvas.clientWidth / this.canvas.clientHeight || 1;
    const point = new Vector3();
    let away = 0;
    for (let i = 0; i < this.shape.length; i += 3) {
      point.set(this.shape[i]!, this.shape[i + 1]!, this.shape[i + 2]!);
      const aside = Math.max(Math.abs(point.dot(right)) / aspect, Math.abs(point.dot(up)));
      away = Math.max(away, point.dot(towards) + aside / slope);
    }
    return away || 1;
  }

  private isFlat(): boolean {
    for (let i = 1; i < this.shape.length; i += 3) {
      if (Math.abs(this.shape[i]!) > FLAT) return false;
    }
    return true;
  }

  /** Turn by angles, and move nearer by a factor. */
  turn(azimuth: number, polar: number, nearer = 1): void {
    const [theta, phi, radius, ...target] = this.view as [number, number, number, ...number[]];
    const tilt = Math.min(Math.max(phi + polar, 0.02), Math.PI - 0.02);
    this.look([theta + azimuth, tilt, radius / nearer, ...target]);
    this.moved();
  }

  /** Return the place of a pointer on the canvas (-1 to 1, y upwards). */
  toDevice(event: { clientX: number; clientY: number }): [number, number] {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    return [(2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height];
  }

  /** Return the place of a drawn position on the page, in pixels. */
  toPage(position: Vector3): [number, number] {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const { x, y } = position.clone().project(this.camera);
    return [left + ((x + 1) / 2) * width, top + ((1 - y) / 2) * height];
  }

  /** Pixels per drawn unit of length, at the target of the camera. */
  get pixelsPerUnit(): number {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const height = 2 * distance * Math.tan((this.camera.fov * Math.PI) / 360);
    return this.canvas.clientHeight / height;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    // A narrow canvas shows as much from side to side as a wide one from top to bottom.
    const slope = Math.tan((FIELD * Math.PI) / 360) / Math.min(this.camera.aspect, 1);
    this.camera.fov = (Math.atan(slope) * 360) / Math.PI;
    this.camera.updateProjectionMatrix();
    if (this.whole) this.lookAtAll(this.whole);
    this.backdrop.forget();
    this.render(); // at once: the canvas is empty
  }

  /** Draw only what is on the positive side of a plane, where there is one. */
  setSection(plane: Plane | null): void {
    SECTION.splice(0, 1, ...(plane ? [plane] : []));
    this.invalidate();
  }

  /** Return the lines and points that are drawn, each after what lies below it. */
  shapes(): Shape[] {
    const found: Shape[] = [];
    for (const scene of [this.scene, this.overlay]) {
      const here: Shape[] = [];
      scene.traverseVisible((object) => {
        const { look, marks } = object.userData;
        if ((look || marks) && this.camera.layers.test(object.layers)) here.push(object as Shape);
      });
      found.push(...here.sort((a, b) => a.renderOrder - b.renderOrder));
    }
    return found;
  }

  /** Return the picture that is drawn now, on the ground of the page. */
  picture(): HTMLCanvasElement {
    const { width, height } = this.canvas;
    this.renderNow();
    const picture = Object.assign(document.createElement("canvas"), { width, height });
    const context = picture.getContext("2d");
    if (!context) throw new Error("This browser cannot draw the picture.");
    context.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--ground");
    context.fillRect(0, 0, width, height);
    context.drawImage(this.canvas, 0, 0);
    return picture;
  }

  /** Draw now, so that the canvas can be read before the browser shows it. */
  renderNow(): void {
    this.renderer.clear();
    this.backdrop.draw(this.scene, this.camera);
    this.renderer.render(this.overlay, this.camera);
    this.compass.draw(this.renderer);
  }

  private render(): void {
    this.isDue = false;
    clearTimeout(this.patient);
    this.patient = 0;
    // The unit ball gets the full range of depths.
    const away = this.camera.position.length();
    this.camera.near = Math.max(0.01, away - 1.2);
    this.camera.far = away + 1.2;
    this.camera.updateProjectionMatrix();
    this.onFrame();
    this.renderNow();
    for (const resolve of this.waiting.splice(0)) resolve();
  }
}
