// The state of the page: all that the user has chosen. Everything that is drawn follows from it.
import type { Effort, Method } from "geodesic-client";
import type { Triple, Up } from "../mesh/frame";
import type { Barriers } from "./barriers";
import type { Place } from "./places";

export type Shade = "distance" | "territories" | "difference" | "proof";
export const PALETTES = ["teal", "viridis", "magma", "cividis", "turbo"] as const;
export type Palette = (typeof PALETTES)[number];
export type Lines = { count: number } | { spacing: number } | null;
export const RULES = ["tobler", "naismith"] as const;
/** What ways cost by their slope: a rule, and the axis of heights. */
export interface Slope {
  rule: (typeof RULES)[number];
  up: Up;
}
/** Numbers of a file: one for each vertex, or for each face. NaN where there is none. */
export interface Values {
  name: string;
  numbers: Float64Array;
  /** A number of its own, which stands for the file in comparisons. */
  key: number;
}

/** A plane that hides what is beyond: the axis that it is normal to, and the share of the extent. */
export interface Section {
  axis: "x" | "y" | "z";
  share: number;
}

/** The curves that a mesh is cut along. */
export const CURVES = ["path", "walk", "isolines", "borders"] as const;
export type Curves = (typeof CURVES)[number];
/** A cut that made the mesh: along which curves, and the change that takes it back. */
export interface Cut {
  along: readonly Curves[];
  back: Partial<State>;
}

export interface State {
  mesh: string | null;
  /** The cut that made the mesh; the change back has the cut before it. */
  cut: Cut | null;
  /** The starts, then the stops of the path, then its end. */
  places: readonly Place[];
  /** How many of the places are starts; with one place more there is a path. */
  starts: number;
  /** Direction and length of a straight line from the first start, in mesh units. */
  walk: Triple | null;
  barriers: Barriers;
  method: Method;
  error: number;
  effort: Effort;
  maxDistance: number | null;
  /** What ways cost, by slope and by face; if anything, costs take the place of distances. */
  slope: Slope | null;
  faceCosts: Values | null;
  /** Values of vertices, which take the place of distances. */
  values: Values | null;
  /** Whether all fields of the question can be read; as long as one cannot, there is no question. */
  isReadable: boolean;
  /** The name of the unit of the mesh; empty: unknown. */
  unit: string;
  /** Whether distances from the starts are computed and drawn. */
  distances: boolean;
  shade: Shade;
  /** The method that the one of the question is compared with; null: the usual one. */
  versus: Method | null;
  lines: Lines;
  /** Whether rays of the log map cross the isolines. */
  polar: boolean;
  /** Whether the boundary of the surface is drawn. */
  boundary: boolean;
  palette: Palette;
  /** The values of the first and the last colour; null: the least and the largest. */
  least: number | null;
  range: number | null;
  /** Whether isolines are labelled by their levels. */
  labels: boolean;
  wireframe: boolean;
  /** Whether colours are shown as they are, without light. */
  flat: boolean;
  section: Section | null;
  /** Whether the surface is unrolled around the first start. */
  unroll: boolean;
  /** The axis that points upwards; null: as guessed. */
  up: Up | null;
  /** Azimuth, polar angle, distance and target of the camera, as drawn; null: the whole mesh. */
  view: number[] | null;
}

export const INITIAL: State = {
  mesh: null,
  cut: null,
  places: [],
  starts: 1,
  walk: null,
  barriers: [],
  method: "exact",
  error: 0.01,
  effort: 2,
  maxDistance: null,
  slope: null,
  faceCosts: null,
  values: null,
  isReadable: true,
  unit: "",
  distances: true,
  shade: "distance",
  versus: null,
  lines: { count: 20 },
  polar: false,
  boundary: false,
  palette: "teal",
  least: null,
  range: null,
  labels: false,
  wireframe: false,
  flat: false,
  section: null,
  unroll: false,
  up: null,
  view: null,
};

/** What makes the question; a change to it can be read, unless the change says otherwise. */
export const NO_QUESTION = {
  places: [],
  starts: 1,
  walk: null,
  barriers: [],
  maxDistance: null,
} satisfies Partial<State>;

type Listener = (state: State, before: State) => void;

export class Store {
  private current = INITIAL;
  private readonly listeners: Listener[] = [];
  private readonly past: State[] = [];
  private readonly future: State[] = [];
  /** A gesture changes the state many times, and is undone at once. */
  private gesture: "none" | "begun" | "under way" = "none";

  get state(): State {
    return this.current;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** Change the state by a step that can be undone. */
  update(change: Partial<State>): void {
    const before = this.current;
    const names = Object.keys(change) as (keyof State)[];
    if (this.gesture !== "under way" && names.some((name) => change[name] !== before[name])) {
      this.past.push(before);
      this.future.length = 0;
      if (this.gesture === "begun") this.gesture = "under way";
    }
    this.replace(change);
  }

  /** Change the state by what is no step of the user's, or follows from one. */
  replace(change: Partial<State>): void {
    const before = this.current;
    const asks = ["mesh", "slope", "faceCosts", ...Object.keys(NO_QUESTION)].some(
      (name) => name in change,
    );
    this.current = { ...before, isReadable: before.isReadable || asks, ...change };
    for (const listener of this.listeners) listener(this.current, before);
  }

  beginGesture(): void {
    this.gesture = "begun";
  }

  endGesture(): void {
    this.gesture = "none";
  }

  /** End the gesture, and undo what it changed. */
  abandonGesture(): void {
    if (this.gesture === "under way") {
      this.undo();
      this.future.length = 0;
    }
    this.gesture = "none";
  }

  undo(): void {
    this.restore(this.past, this.future);
  }

  redo(): void {
    this.restore(this.future, this.past);
  }

  private restore(from: State[], to: State[]): void {
    const state = from.pop();
    if (!state) return;
    const { mesh, up, view } = this.current;
    to.push(this.current);
    // The camera stays where it is, if that is a view of what is shown then.
    const isSame = state.mesh === mesh && (state.up ?? up) === up;
    const seen = isSame ? { view, up } : {};
    this.replace({ ...state, isReadable: true, ...seen });
  }

  listen(listener: Listener): void {
    this.listeners.push(listener);
  }
}

/** What is gone with the mesh that it belongs to. */
const OF_MESH = {
  ...NO_QUESTION,
  cut: null,
  unit: "",
  slope: null,
  faceCosts: null,
  values: null,
  least: null,
  range: null,
  section: null,
  unroll: false,
} satisfies Partial<State>;

/** Return the change to another mesh: what belongs to the one before is gone. */
export function withMesh(mesh: string, { lines }: State): Partial<State> {
  return {
    ...OF_MESH,
    mesh,
    lines: lines && "spacing" in lines ? INITIAL.lines : lines,
    up: null,
    view: null,
  };
}

/** Return the change to what was cut from the mesh, with its boundary; the camera stays. */
export function withCut(mesh: string, along: readonly Curves[], state: State): Partial<State> {
  const { unit, up, view, unroll } = state;
  const cut = { along, back: backTo(state) };
  return { ...withMesh(mesh, state), cut, unit, boundary: true, up, view: unroll ? null : view };
}

/** Return the change back to the mesh of a state with all that is set on it; the camera stays. */
export function backTo(state: State): Partial<State> {
  const names = ["mesh", "lines", "boundary", ...Object.keys(OF_MESH)] as (keyof State)[];
  const change = Object.fromEntries(names.map((name) => [name, state[name]]));
  return state.unroll ? { ...change, view: null } : change;
}

/** Return the cuts that made the mesh, in their order. */
export function cutsOf({ cut }: Partial<State>): Cut[] {
  return cut ? [...cutsOf(cut.back), cut] : [];
}

/** Return the unit in words. */
export function unitOf({ unit }: State): string {
  return unit || "mesh units";
}
