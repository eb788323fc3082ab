// What mouse and fingers do on the mesh: a click sets a point, a drag from a point pulls the path.
import { Vector3 } from "three";
import type { Point } from "../api/types";
import { positionOf, type FacePoint } from "../mesh/picking";
import { rounded } from "../state/point";
import type { Store } from "../state/state";
import type { Shown } from "../view/shown";

export type Tool = "source" | "target" | "waypoint" | "barrier";

const STILL_PX = 5;
const NEAR_PX = 16;
/** Where a brush touches the mesh, in pixels from the pointer. */
const BRUSH = [-9, -6, -3, 0, 3, 6, 9].flatMap((x) =>
  [-9, -6, -3, 0, 3, 6, 9].filter((y) => Math.hypot(x, y) < 10).map((y) => [x, y] as const),
);

type Place = { clientX: number; clientY: number };

export class Pointer {
  private start: PointerEvent | null = null;
  private drag: ((event: Place) => void) | null = null;
  private painted: Set<number> | null = null;
  private fingers = 0;
  /** Where the brush was last. */
  private last: Place | null = null;

  constructor(
    private readonly shown: Shown,
    private readonly store: Store,
    private readonly tool: () => Tool,
  ) {
    const { canvas } = shown.stage;
    // Before the controls of the camera, which then leave the drag alone.
    canvas.addEventListener("pointerdown", (event) => this.down(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    canvas.addEventListener("pointerup", (event) => this.up(event), { capture: true });
    canvas.addEventListener("pointercancel", () => this.end(), { capture: true });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  private down(event: PointerEvent): void {
    this.fingers += 1;
    if (event.button !== 0 || this.fingers > 1) {
      this.start = null;
      return;
    }
    this.start = event;
    this.drag = this.dragFrom(event);
    if (this.drag) {
      this.shown.stage.controls.enabled = false;
      this.shown.stage.canvas.setPointerCapture(event.pointerId);
      if (this.painted) this.drag(event);
    }
  }

  /** Return what a drag does that begins here; null: it turns the mesh. */
  private dragFrom(event: PointerEvent): ((event: Place) => void) | null {
    const { sources, target, waypoints } = this.store.state;
    if (!this.shown.mesh) return null;
    if (this.tool() === "barrier") {
      this.painted = new Set(this.store.state.barriers);
      return (place) => this.paint(place, event.shiftKey);
    }
    const near = (point: Point | null): boolean => point !== null && this.isNear(point, event);
    if (sources.length > 0 && event.altKey) return this.moving((point) => this.store.update({ target: point }));
    if (near(target)) return this.moving((point) => this.store.update({ target: point }));
    const waypoint = waypoints.findIndex(near);
    if (waypoint >= 0) {
      return this.moving((point) =>
        this.store.update({ waypoints: this.store.state.waypoints.with(waypoint, point) }),
      );
    }
    // From a source, the path is pulled out.
    if (sources.some(near)) return this.moving((point) => this.store.update({ target: point }));
    return null;
  }

  private moving(set: (point: FacePoint) => void): (event: Place) => void {
    return (place) => {
      const point = this.at(place);
      if (point) set(point);
    };
  }

  private move(event: PointerEvent): void {
    // Browsers report moves once a frame.
    if (this.start && this.drag && this.hasMoved(event)) this.drag(event);
  }

  private up(event: PointerEvent): void {
    const { start, drag } = this;
    const isClick = start !== null && !this.hasMoved(event);
    if (drag && !isClick) drag(event);
    if (this.painted) this.store.update({ barriers: [...this.painted] });
    else if (isClick) this.click(event);
    this.end();
  }

  private click(event: PointerEvent): void {
    const point = this.at(event);
    if (point) this.set(point, event.altKey ? "target" : this.tool(), event.shiftKey);
  }

  /** Set what ``tool`` sets; ``adds``: another source. */
  set(point: Point, tool: Tool, adds: boolean): void {
    const { sources, waypoints } = this.store.state;
    if (tool === "source") this.store.update({ sources: adds ? [...sources, point] : [point] });
    if (tool === "target") this.store.update({ target: point });
    if (tool === "waypoint") this.store.update({ waypoints: [...waypoints, point] });
  }

  private end(): void {
    this.fingers = Math.max(0, this.fingers - 1);
    this.start = this.drag = this.painted = this.last = null;
    this.shown.stage.controls.enabled = true;
  }

  private paint(place: Place, erases: boolean): void {
    const from = this.last ?? place;
    const steps = Math.ceil(Math.hypot(place.clientX - from.clientX, place.clientY - from.clientY) / 6);
    for (let i = 0; i <= steps; i++) {
      const share = steps === 0 ? 1 : i / steps;
      for (const [x, y] of BRUSH) {
        const point = this.at({
          clientX: from.clientX + share * (place.clientX - from.clientX) + x,
          clientY: from.clientY + share * (place.clientY - from.clientY) + y,
        });
        if (point) this.painted![erases ? "delete" : "add"](point.face);
      }
    }
    this.last = place;
    this.shown.barriers.show(this.shown.mesh, this.painted!);
  }

  private at(place: Place): FacePoint | null {
    const point = this.shown.pick(...this.shown.stage.toDevice(place));
    return point && (rounded(point) as FacePoint);
  }

  private isNear(point: Point, event: PointerEvent): boolean {
    const { mesh, stage } = this.shown;
    const [x, y] = stage.toPage(new Vector3(...mesh!.drawn(positionOf(mesh!, point))));
    return Math.hypot(x - event.clientX, y - event.clientY) < NEAR_PX;
  }

  private hasMoved(event: PointerEvent): boolean {
    const { clientX, clientY } = this.start ?? event;
    return Math.hypot(event.clientX - clientX, event.clientY - clientY) > STILL_PX;
  }
}
