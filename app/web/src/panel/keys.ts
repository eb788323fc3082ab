// The keyboard: keys for everything that a pointer does.
import type { Method } from "../api/types";
import { byId } from "../dom";
import { INITIAL, type Store } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import type { Pointer, Tool } from "./pointer";

const STEP = 0.12;
const NEXT: Record<Method, Method> = { exact: "approximate", approximate: "fast", fast: "exact" };

export function listenToKeys(
  store: Store,
  status: Status,
  sceneView: SceneView,
  pointer: Pointer,
): void {
  const { stage } = sceneView;
  const inTheMiddle = (tool: Tool, adds = false): void =>
    pointer.set(sceneView.pick(0, 0), tool, adds);
  const onMesh: Record<string, (event: KeyboardEvent) => void> = {
    ArrowLeft: () => stage.turn(-STEP, 0),
    ArrowRight: () => stage.turn(STEP, 0),
    ArrowUp: () => stage.turn(0, -STEP),
    ArrowDown: () => stage.turn(0, STEP),
    "+": () => stage.turn(0, 0, 1.15),
    "=": () => stage.turn(0, 0, 1.15),
    "-": () => stage.turn(0, 0, 1 / 1.15),
    Enter: (event) => inTheMiddle("source", event.shiftKey),
    t: () => inTheMiddle("target"),
    v: () => inTheMiddle("waypoint"),
    g: () => inTheMiddle("walk"),
  };
  const anywhere: Record<string, () => void> = {
    Escape: () => status.cancel(),
    e: () => store.update({ method: NEXT[store.state.method] }),
    i: () => store.update({ lines: store.state.lines === null ? INITIAL.lines : null }),
    p: () => byId("polar").click(),
    w: () => store.update({ wireframe: !store.state.wireframe }),
    f: () => byId("fit").click(),
  };
  document.addEventListener("keydown", (event) => {
    const isTyping =
      event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement;
    if (event.ctrlKey || event.metaKey || event.altKey || (isTyping && event.key !== "Escape"))
      return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const act = (event.target === stage.canvas ? onMesh[key] : undefined) ?? anywhere[key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
}
