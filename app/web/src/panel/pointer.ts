// Mouse and fingers on the mesh: a click sets a point, a drag from a point pulls the path along.
import { Vector3 } from "three";
import type { Point } from "../api/types";
import { differences, type Triple } from "../mesh/frame";
import { type FacePoint, positionOf } from "../mesh/picking";
import { rounded } from "../state/point";
import type { State, Store } from "../state/state";
import type { SceneView } from "../view/sceneView";
import { tell } from "./appearance";

export type Tool = "source" | "target" | "waypoint" | "walk" | "barrier";

/** Tolerances in pixels: how far a click may move, and how close to a point a drag must start. */
const REACH = { still: 5, near: 16 };
const REACH_OF_FINGERS = { still: 10, near: 28 };
/** A finger that stays this long adds another source. */
const HOLD_MS = 500;
/** The points where the brush touches the mesh, in pixels from the pointer. */
const BRUSH = [-9, -6, -3, 0, 3, 6, 9].flatMap((x) =>
  [-9, -6, -3, 0, 3, 6, 9].filter((y) => Math.hypot(x, y) < 10).map((y) => [x, y] as const),
);

type Place = { clientX: number; clientY: number };

export class Pointer {
  private start: PointerEvent | null = null;
  /** The points that a drag may change, as they were before it. */
  private before: Pick<State, "target" | "waypoints" | "walk"> | null = null;
  private drag: ((event: Place) => void) | null = null;
  private painted: Set<number> | null = null;
  private fingers = 0;
  /** Whether the target follows the pointer, until the first press. */
  follows = false;
  /** Called with the point under the mouse; null where there is none. */
  onHover: (point: FacePoint | null) => void = () => undefined;
  /** The last place of the brush. */
  private last: Place | null = null;

  constructor(
    private readonly sceneView: SceneView,
    private readonly store: Store,
    private readonly tool: () => Tool,
  ) {
    const { canvas } = sceneView.stage;
    // Listen before the camera's controls, which then leave the drag alone.
    canvas.addEventListener("pointerdown", (event) => this.down(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    canvas.addEventListener("pointerup", (event) => this.up(event), { capture: true });
    canvas.addEventListener("pointerleave", () => this.onHover(null));
    canvas.addEventListener("pointercancel", () => this.cancel(), { capture: true });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  private down(event: PointerEvent): void {
    this.fingers += 1;
    this.follows = false;
    if (event.button !== 0 || this.fingers > 1) {
      this.abandon(); // two fingers move the mesh, even after one has begun a drag
      return;
    }
    const { target, waypoints, walk } = this.store.state;
    this.start = event;
    this.before = { target, waypoints, walk };
    this.drag = this.dragFrom(event);
    if (this.drag) {
      this.sceneView.stage.turnsByDrag = false;
      if (this.painted) this.drag(event);
    }
  }

  /** Return the effect of a drag that begins here; null: it turns the mesh. */
  private dragFrom(event: PointerEvent): ((event: Place) => void) | null {
    const { sources, target, waypoints } = this.store.state;
    if (!this.sceneView.mesh) return null;
    if (this.tool() === "barrier") {
      const painted = new Set(this.store.state.barriers);
      this.painted = painted;
      return (place) => this.paint(painted, place, event.shiftKey);
    }
    if (this.tool() === "walk" && sources[0] && this.isNear(sources[0], event))
      return this.moving((point) => this.walkTowards(point));
    const near = (point: Point | null): boolean => point !== null && this.isNear(point, event);
    if (sources.length > 0 && event.altKey)
      return this.moving((point) => this.store.update({ target: point }));
    if (near(target)) return this.moving((point) => this.store.update({ target: point }));
    const waypoint = waypoints.findIndex(near);
    if (waypoint >= 0) {
      return this.moving((point) =>
        this.store.update({ waypoints: this.store.state.waypoints.with(waypoint, point) }),
      );
    }
    // From a source, the drag pulls out a path.
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
    else if (event.pointerType === "mouse" && event.buttons === 0) this.hover(this.at(event));
  }

  private hover(point: FacePoint | null): void {
    this.onHover(point);
    if (point && this.follows && this.store.state.sources.length > 0)
      this.store.update({ target: point });
  }

  private up(event: PointerEvent): void {
    const { start, drag } = this;
    const isClick = start !== null && !this.hasMoved(event);
    if (drag && !isClick) drag(event);
    if (this.painted) this.store.update({ barriers: [...this.painted] });
    if (isClick) {
      const adds = event.shiftKey || isHeld(start, event);
      this.set(this.at(event), event.altKey ? "target" : this.tool(), adds);
    }
    this.end();
  }

  /**
   * Set the point that ``tool`` stands for; ``adds`` joins a source to those there are.
   *
   * A place beside the mesh (null) sets nothing, and is told.
   */
  set(point: Point | null, tool: Tool, adds: boolean): void {
    if (!point) {
      if (this.sceneView.isPickable) tell("That is beside the mesh");
      return;
    }
    const { sources, waypoints } = this.store.state;
    if (tool === "source") this.store.update({ sources: adds ? [...sources, point] : [point] });
    if (tool === "target") this.store.update({ target: point });
    if (tool === "walk") this.walkTowards(point);
    if (tool === "waypoint") this.store.update({ waypoints: [...waypoints, point] });
  }

  /** Walk from the first source in the direction of a point, as far as it is away in space. */
  private walkTowards(point: Point): void {
    const { mesh } = this.sceneView;
    const [source] = this.store.state.sources;
    if (!mesh || !source) return;
    const way = differences(positionOf(mesh, point), positionOf(mesh, source));
    const walk = way.map((x) => Number(x.toPrecision(6))) as Triple;
    if (Math.hypot(...walk) > 0) this.store.update({ walk });
  }

  private cancel(): void {
    this.abandon();
    this.end();
  }

  /** Undo the drag. */
  private abandon(): void {
    const { drag, painted, before } = this;
    this.letGo();
    if (painted) this.sceneView.barriers.show(this.sceneView.mesh, this.store.state.barriers);
    else if (drag && before) this.store.update(before);
  }

  private end(): void {
    this.fingers = Math.max(0, this.fingers - 1);
    this.letGo();
  }

  private letGo(): void {
    this.start = this.before = this.drag = this.painted = this.last = null;
    this.sceneView.stage.turnsByDrag = true;
  }

  private paint(painted: Set<number>, place: Place, erases: boolean): void {
    const from = this.last ?? place;
    const steps = Math.ceil(
      Math.hypot(place.clientX - from.clientX, place.clientY - from.clientY) / 6,
    );
    for (let i = 0; i <= steps; i++) {
      const share = steps === 0 ? 1 : i / steps;
      for (const [x, y] of BRUSH) {
        const point = this.at({
          clientX: from.clientX + share * (place.clientX - from.clientX) + x,
          clientY: from.clientY + share * (place.clientY - from.clientY) + y,
        });
        if (point) painted[erases ? "delete" : "add"](point.face);
      }
    }
    this.last = place;
    this.sceneView.barriers.show(this.sceneView.mesh, painted);
  }

  private at(place: Place): FacePoint | null {
    const point = this.sceneView.pick(...this.sceneView.stage.toDevice(place));
    return point && (rounded(point) as FacePoint);
  }

  private isNear(point: Point, event: PointerEvent): boolean {
    const { mesh, stage } = this.sceneView;
    if (!mesh) return false;
    const [x, y] = stage.toPage(new Vector3(...mesh.drawn(positionOf(mesh, point))));
    return Math.hypot(x - event.clientX, y - event.clientY) < reachOf(event).near;
  }

  private hasMoved(event: PointerEvent): boolean {
    const { clientX, clientY } = this.start ?? event;
    return Math.hypot(event.clientX - clientX, event.clientY - clientY) > reachOf(event).still;
  }
}

function isHeld(start: PointerEvent, end: PointerEvent): boolean {
  return end.pointerType === "touch" && end.timeStamp - start.timeStamp >= HOLD_MS;
}

function reachOf({ pointerType }: PointerEvent): typeof REACH {
  return pointerType === "touch" ? REACH_OF_FINGERS : REACH;
}
