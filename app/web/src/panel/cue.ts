// The sentence under the pointer: what a click, a tap or a key does there.
import { byId } from "../dom";
import { endOf, type Places, type Tool } from "../state/places";

export type Device = "mouse" | "touch" | "keys";

interface Gestures {
  sets: string;
  start: string | null;
  stop: string;
  erases: string | null;
}
const GESTURES: Record<Device, Gestures> = {
  mouse: { sets: "Click", start: "Shift-click", stop: "Alt-click", erases: "Shift-drag" },
  touch: { sets: "Tap", start: null, stop: "hold", erases: null },
  keys: { sets: "Enter", start: "Shift+Enter", stop: "Alt+Enter", erases: "Shift+Enter" },
};
const TOLD_MS = 4000;

const GENERAL: Record<Tool, string> = {
  ends: "moves the nearer end",
  stop: "adds a stop",
  start: "adds a start",
  walk: "walks straight on from A",
  barrier: "blocks faces",
};

/**
 * Return in one sentence what a device does.
 *
 * ``held`` is the tool of the keys that are held, and ``words`` are of the act at hand, if any.
 */
export function sentence(
  state: Places,
  chosen: Tool,
  held: "start" | "stop" | null,
  device: Device,
  words: string | null,
): string {
  const { sets, start, stop, erases } = GESTURES[device];
  if (chosen === "barrier") {
    const paints = device === "keys" ? sets : "Drag";
    return `${paints} blocks faces${erases ? `; ${erases} frees them` : ""}`;
  }
  if (state.places.length === 0) return `${sets} sets A, the next one B`;
  const tool = held ?? chosen;
  const hasEnd = endOf(state) !== null;
  const general = hasEnd || tool === "start" || tool === "walk" ? GENERAL[tool] : "sets B";
  const does = `${(held === "start" ? start : held && stop) ?? sets} ${words ?? general}`;
  if (tool !== "ends") return does;
  if (!hasEnd) return start ? `${does}; ${start} adds another start` : does;
  return `${does}; ${start ? `${start} adds a start, ${stop} a stop` : `${stop} adds a stop`}`;
}

export class Cue {
  private readonly element = byId("cue");
  private telling = 0;

  /** Say what can be done, at a place of the page in pixels; null: at the foot of the mesh. */
  show(words: string, at: { clientX: number; clientY: number } | null): void {
    if (this.telling) return;
    this.place(at);
    if (this.element.textContent !== words) this.element.textContent = words;
  }

  /** Tell what became of a click or a key: for a while, or until something changes. */
  tell(words: string, at: { clientX: number; clientY: number } | null): void {
    this.forget();
    this.show(words, at);
    this.element.classList.add("told");
    this.telling = setTimeout(() => {
      this.forget();
      this.show("", at);
    }, TOLD_MS);
  }

  /** Tell nothing any more. */
  forget(): void {
    clearTimeout(this.telling);
    this.telling = 0;
    this.element.classList.remove("told");
  }

  private place(at: { clientX: number; clientY: number } | null): void {
    const { style, classList, parentElement } = this.element;
    const { left, top } = parentElement?.getBoundingClientRect() ?? new DOMRect();
    classList.toggle("at-pointer", at !== null);
    if (!at) return;
    style.setProperty("--x", `${at.clientX - left}px`);
    style.setProperty("--y", `${at.clientY - top}px`);
  }
}
