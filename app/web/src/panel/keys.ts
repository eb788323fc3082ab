// The keyboard: keys for everything that a pointer does.
import type { Method } from "geodesic-client";
import { byId } from "../dom";
import { INITIAL, type Store } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import type { Pointer } from "./pointer";

const STEP = 0.12;
const NEXT: Record<Method, Method> = { exact: "approximate", approximate: "fast", fast: "exact" };

export function listenToKeys(
  store: Store,
  status: Status,
  sceneView: SceneView,
  pointer: Pointer,
): void {
  const { stage } = sceneView;
  const onMesh: Record<string, (event: KeyboardEvent) => void> = {
    ArrowLeft: () => stage.turn(-STEP, 0),
    ArrowRight: () => stage.turn(STEP, 0),
    ArrowUp: () => stage.turn(0, -STEP),
    ArrowDown: () => stage.turn(0, STEP),
    "+": () => stage.turn(0, 0, 1.15),
    "=": () => stage.turn(0, 0, 1.15),
    "-": () => stage.turn(0, 0, 1 / 1.15),
    Enter: (event) => pointer.press(event),
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
      (event.target instanceof HTMLInputElement &&
        !["checkbox", "radio", "range"].includes(event.target.type)) ||
      event.target instanceof HTMLSelectElement;
    if (isTyping && event.key !== "Escape") return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (event.ctrlKey || event.metaKey) {
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      if (key === "y" || event.shiftKey) store.redo();
      else store.undo();
      return;
    }
    if (event.altKey && key !== "Enter") return;
    const act = (event.target === stage.canvas ? onMesh[key] : undefined) ?? anywhere[key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
}
