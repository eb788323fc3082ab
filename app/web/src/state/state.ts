// The state of the page: all that the user has chosen. Everything that is drawn follows from it.
import type { Effort, Method, Point } from "../api/types";
import type { Triple, Up } from "../mesh/frame";

export type Shade = "distance" | "territories" | "difference" | "proof";
export const PALETTES = ["teal", "viridis", "magma", "cividis", "turbo"] as const;
export type Palette = (typeof PALETTES)[number];
export type Lines = { count: number } | { spacing: number } | null;

export interface State {
  mesh: string | null;
  sources: Point[];
  target: Point | null;
  waypoints: Point[];
  /** Direction and length of a straight line from the first source, in mesh units. */
  walk: Triple | null;
  barriers: number[];
  method: Method;
  error: number;
  effort: Effort;
  maxDistance: number | null;
  /** Whether all fields of the question can be read; as long as one cannot, there is no question. */
  isReadable: boolean;
  /** The name of the unit of the mesh; empty: unknown. */
  unit: string;
  shade: Shade;
  lines: Lines;
  /** Whether rays of the log map cross the isolines. */
  polar: boolean;
  palette: Palette;
  /** The distance of the last colour; null: the largest. */
  range: number | null;
  wireframe: boolean;
  /** The axis that points upwards; null: as guessed. */
  up: Up | null;
  /** Azimuth, polar angle, distance and target of the camera, as drawn; null: the whole mesh. */
  view: number[] | null;
}

export const INITIAL: State = {
  mesh: null,
  sources: [],
  target: null,
  waypoints: [],
  walk: null,
  barriers: [],
  method: "exact",
  error: 0.01,
  effort: 2,
  maxDistance: null,
  isReadable: true,
  unit: "",
  shade: "distance",
  lines: { count: 20 },
  polar: false,
  palette: "teal",
  range: null,
  wireframe: false,
  up: null,
  view: null,
};

/** A change to any of these is another question: it can be read, unless the change says otherwise. */
const QUESTION = [
  "mesh",
  "sources",
  "target",
  "waypoints",
  "walk",
  "barriers",
  "maxDistance",
] as const;

type Listener = (state: State, before: State) => void;

export class Store {
  private current = INITIAL;
  private readonly listeners: Listener[] = [];

  get state(): State {
    return this.current;
  }

  update(change: Partial<State>): void {
    const before = this.current;
    const asks = QUESTION.some((name) => name in change);
    this.current = { ...before, isReadable: before.isReadable || asks, ...change };
    for (const listener of this.listeners) listener(this.current, before);
  }

  listen(listener: Listener): void {
    this.listeners.push(listener);
  }
}

/** Return the change to another mesh: what belongs to the one before is gone. */
export function withMesh(mesh: string, { lines }: State): Partial<State> {
  return {
    mesh,
    sources: [],
    target: null,
    waypoints: [],
    walk: null,
    barriers: [],
    maxDistance: null,
    unit: "",
    range: null,
    lines: lines && "spacing" in lines ? INITIAL.lines : lines,
    up: null,
    view: null,
  };
}

/** Return the unit in words. */
export function unitOf({ unit }: State): string {
  return unit || "mesh units";
}
