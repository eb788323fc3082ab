// Mouse, fingers and keys on the mesh: a click sets a point, a drag moves it.
import { Vector3 } from "three";
import { drawnAt, type FacePoint, positionOf } from "../mesh/picking";
import { blockedFaces, repainted } from "../state/barriers";
import { type Act, actOf, nameOf, type Place, placedAt, type Tool } from "../state/places";
import type { Point } from "../state/point";
import { rounded } from "../state/point";
import { NO_QUESTION, type State, type Store } from "../state/state";
import type { SceneView } from "../view/sceneView";
import { Cue, type Device, sentence } from "./cue";

/** Tolerances in pixels: how far a click may move, and how close to a point a drag must start. */
const REACH = { still: 5, near: 16 };
const REACH_OF_FINGERS = { still: 10, near: 28 };
/** A finger that stays this long adds a stop. */
const HOLD_MS = 500;
/** The points where the brush touches the mesh, in pixels from the pointer. */
const BRUSH = [-9, -6, -3, 0, 3, 6, 9].flatMap((x) =>
  [-9, -6, -3, 0, 3, 6, 9].filter((y) => Math.hypot(x, y) < 10).map((y) => [x, y] as const),
);

type Spot = { clientX: number; clientY: number };
type Modifiers = { shiftKey: boolean; altKey: boolean };

export class Pointer {
  private start: PointerEvent | null = null;
  private drag: ((spot: Spot) => void) | null = null;
  private painted: Set<number> | null = null;
  private fingers = 0;
  /** The last spot of the brush. */
  private last: Spot | null = null;
  private readonly cue = new Cue();
  private device: Device = matchMedia("(pointer: coarse)").matches ? "touch" : "mouse";
  /** Where the mouse is on the mesh, and the keys that are held with it. */
  private hovered: (Spot & Modifiers) | null = null;
  /** The places of an example whose end follows the pointer, as long as they are those shown. */
  private example: readonly Place[] | null = null;
  /** Called with the point under the mouse; null where there is none. */
  onHover: (point: FacePoint | null) => void = () => undefined;

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
    canvas.addEventListener("pointerleave", () => this.leave());
    canvas.addEventListener("pointercancel", () => this.cancel(), { capture: true });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("focus", () => {
      if (canvas.matches(":focus-visible")) this.use("keys");
    });
  }

  /** Show an example whose end follows the pointer; the first click begins a question of one's own. */
  showExample(places: readonly Place[], change: Partial<State> = {}): void {
    this.example = places;
    this.store.replace({ ...change, places, starts: 1 });
  }

  get isExample(): boolean {
    return this.example !== null && this.store.state.places === this.example;
  }

  /** Whether an example has ended. */
  wasExample({ places }: State): boolean {
    return places === this.example && !this.isExample;
  }

  /** The state that a click finds: that of an example is empty. */
  private get state(): State {
    return this.isExample ? { ...this.store.state, ...NO_QUESTION } : this.store.state;
  }

  private down(event: PointerEvent): void {
    this.use(event.pointerType === "touch" ? "touch" : "mouse");
    this.fingers += 1;
    if (event.button !== 0 || this.fingers > 1) {
      this.abandon(); // two fingers move the mesh, even after one has begun a drag
      return;
    }
    this.start = event;
    this.store.beginGesture();
    this.drag = this.dragFrom(event);
    if (this.drag) {
      this.sceneView.stage.turnsByDrag = false;
      if (this.painted) this.drag(event);
    }
  }

  /** Return the effect of a drag that begins here; null: it turns the mesh. */
  private dragFrom(event: PointerEvent): ((spot: Spot) => void) | null {
    if (!this.sceneView.mesh) return null;
    if (this.tool() === "barrier") {
      const painted = new Set(blockedFaces(this.store.state));
      this.painted = painted;
      return (spot) => this.paint(painted, spot, event.shiftKey);
    }
    const index = this.placeNear(event);
    if (index === null || this.isExample) return null;
    if (this.tool() === "walk" && index === 0)
      return this.moving((point) => this.store.update(this.act(point, "walk").change));
    return this.moving((point) =>
      this.store.update({ places: placedAt(this.store.state.places, index, point) }),
    );
  }

  private moving(set: (point: FacePoint) => void): (spot: Spot) => void {
    return (spot) => {
      const point = this.at(spot);
      if (point) set(point);
    };
  }

  private move(event: PointerEvent): void {
    // Browsers report moves once a frame.
    if (this.start && this.drag && this.hasMoved(event)) this.drag(event);
    else if (event.pointerType === "mouse" && event.buttons === 0) this.hover(event);
  }

  private hover(event: PointerEvent): void {
    const point = this.at(event);
    this.onHover(point);
    const { clientX, clientY, shiftKey, altKey } = event;
    this.hovered = point && { clientX, clientY, shiftKey, altKey };
    const [first] = this.store.state.places;
    if (point && first && this.isExample) this.showExample([first, { point, name: "" }]);
    this.use("mouse");
  }

  private leave(): void {
    this.onHover(null);
    this.hovered = null;
    this.explain();
  }

  private up(event: PointerEvent): void {
    const { start, drag, painted } = this;
    const isClick = start !== null && !this.hasMoved(event);
    if (drag && !isClick) drag(event);
    if (painted) this.store.update({ barriers: repainted(this.store.state.barriers, painted) });
    this.end();
    if (isClick && !(painted && this.at(event))) {
      const altKey = event.altKey || isHeld(start, event);
      this.click(event, { shiftKey: event.shiftKey, altKey });
    }
  }

  /** Do what a click does at a spot; beside the mesh it does nothing, and says so. */
  private click(spot: Spot, modifiers: Modifiers): void {
    const point = this.at(spot);
    if (!point) {
      if (spot instanceof PointerEvent && this.sceneView.stage.clickAxes(spot)) return;
      if (this.sceneView.isPickable) this.cue.tell("That is beside the mesh", spot);
      return;
    }
    this.store.update(this.act(point, heldWith(modifiers) ?? this.tool()).change);
  }

  /** Do what a click in the middle of the canvas does. */
  press(modifiers: Modifiers): void {
    this.use("keys");
    if (this.tool() === "barrier" && this.at(this.middle)) {
      const painted = new Set(blockedFaces(this.store.state));
      this.paint(painted, this.middle, modifiers.shiftKey);
      this.last = null;
      this.store.update({ barriers: repainted(this.store.state.barriers, painted) });
    } else this.click(this.middle, modifiers);
  }

  private act(point: Point, tool: Tool): Act {
    const { mesh } = this.sceneView;
    const { state } = this;
    if (!mesh || tool === "barrier") return { words: "", change: {} };
    const act = actOf(state, tool, point, (each) => positionOf(mesh, each));
    return this.isExample ? { ...act, change: { ...NO_QUESTION, ...act.change } } : act;
  }

  private use(device: Device): void {
    this.device = device;
    this.explain();
  }

  /** Tell anew what is under the mouse: what is known there has changed. */
  rehover(): void {
    if (this.hovered) this.onHover(this.at(this.hovered));
  }

  /** Follow a change of the state: nothing of before is told any more. */
  follow(): void {
    this.cue.forget();
    this.explain();
  }

  /** Say under the pointer what it does there. */
  explain(): void {
    const { device, state, hovered } = this;
    if (!this.sceneView.isPickable) {
      this.cue.show("", null);
      return;
    }
    const spot = { mouse: hovered, keys: this.middle, touch: null }[device];
    const point = spot && this.at(spot);
    const held = device === "mouse" && hovered ? heldWith(hovered) : null;
    const tool = this.tool();
    const near = device === "mouse" && spot && !held && !this.isExample && this.placeNear(spot);
    if (typeof near === "number" && tool !== "barrier") {
      const drags = tool === "walk" && near === 0 ? "walks straight on from" : "moves";
      this.cue.show(`Drag ${drags} ${nameOf(state, near)}`, spot);
      return;
    }
    const words = point && this.act(point, held ?? tool).words;
    this.cue.show(sentence(state, tool, held, device, words || null), spot);
  }

  private get middle(): Spot {
    const { left, top, width, height } = this.sceneView.stage.canvas.getBoundingClientRect();
    return { clientX: left + width / 2, clientY: top + height / 2 };
  }

  private cancel(): void {
    this.abandon();
    this.end();
  }

  /** Undo the drag. */
  private abandon(): void {
    const { painted } = this;
    this.letGo();
    if (painted) this.sceneView.showBarriers(this.store.state);
    this.store.abandonGesture();
  }

  private end(): void {
    this.fingers = Math.max(0, this.fingers - 1);
    this.letGo();
    this.store.endGesture();
  }

  private letGo(): void {
    this.start = this.drag = this.painted = this.last = null;
    this.sceneView.stage.turnsByDrag = true;
  }

  private paint(painted: Set<number>, spot: Spot, erases: boolean): void {
    const from = this.last ?? spot;
    const steps = Math.ceil(
      Math.hypot(spot.clientX - from.clientX, spot.clientY - from.clientY) / 6,
    );
    for (let i = 0; i <= steps; i++) {
      const share = steps === 0 ? 1 : i / steps;
      for (const [x, y] of BRUSH) {
        const point = this.at({
          clientX: from.clientX + share * (spot.clientX - from.clientX) + x,
          clientY: from.clientY + share * (spot.clientY - from.clientY) + y,
        });
        if (point) painted[erases ? "delete" : "add"](point.face);
      }
    }
    this.last = spot;
    this.sceneView.barriers.show(this.sceneView.mesh, painted);
  }

  private at(spot: Spot): FacePoint | null {
    const point = this.sceneView.pick(...this.sceneView.stage.toDevice(spot));
    return point && (rounded(point) as FacePoint);
  }

  /** Return the index of the place that is close to a spot, or null; hidden ones cannot be meant. */
  private placeNear(spot: Spot): number | null {
    const { mesh, stage } = this.sceneView;
    if (!mesh) return null;
    let nearest: number | null = null;
    let least = (this.device === "touch" ? REACH_OF_FINGERS : REACH).near;
    this.store.state.places.forEach(({ point }, i) => {
      if (!mesh.has(point)) return;
      const drawn = drawnAt(mesh, point);
      const [x, y] = stage.toPage(new Vector3(...drawn));
      const away = Math.hypot(x - spot.clientX, y - spot.clientY);
      if (away < least && this.sceneView.isSeen(drawn)) [nearest, least] = [i, away];
    });
    return nearest;
  }

  private hasMoved(event: PointerEvent): boolean {
    const { clientX, clientY } = this.start ?? event;
    const { still } = event.pointerType === "touch" ? REACH_OF_FINGERS : REACH;
    return Math.hypot(event.clientX - clientX, event.clientY - clientY) > still;
  }
}

function heldWith({ shiftKey, altKey }: Modifiers): "start" | "stop" | null {
  return altKey ? "stop" : shiftKey ? "start" : null;
}

function isHeld(start: PointerEvent, end: PointerEvent): boolean {
  return end.pointerType === "touch" && end.timeStamp - start.timeStamp >= HOLD_MS;
}
