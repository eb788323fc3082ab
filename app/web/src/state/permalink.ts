// The state as the page's address, and back: /?mesh=ID&source=v0&target=v99
import type { Effort, Method } from "../api/types";
import { InputError } from "../inputError";
import type { Triple, Up } from "../mesh/frame";
import { parsePoint, type WrittenPoint, writePoint } from "./point";
import { INITIAL, type Lines, PALETTES, type Palette, type Shade, type State } from "./state";

/** Characters of the name of a unit. */
export const LONGEST_UNIT = 12;
const EFFORTS: Effort[] = [1, 2, 4, 8];
/** No mesh has more faces. */
const MOST_FACES = 1e8;

/** A state whose points may still be positions, which the service has to locate. */
export type WrittenState = Omit<State, "sources" | "target" | "waypoints"> & {
  sources: WrittenPoint[];
  target: WrittenPoint | null;
  waypoints: WrittenPoint[];
};

export function writeState(state: State): string {
  const query = new URLSearchParams();
  if (state.mesh) query.set("mesh", state.mesh);
  for (const source of state.sources) query.append("source", writePoint(source));
  if (state.target) query.set("target", writePoint(state.target));
  for (const waypoint of state.waypoints) query.append("via", writePoint(waypoint));
  if (state.walk) query.set("walk", state.walk.join(","));
  if (state.barriers.length > 0) query.set("barriers", writeRanges(state.barriers));
  if (state.method !== INITIAL.method) query.set("method", state.method);
  if (state.error !== INITIAL.error) query.set("error", String(state.error));
  if (state.effort !== INITIAL.effort) query.set("effort", String(state.effort));
  if (state.maxDistance !== null) query.set("max_distance", String(state.maxDistance));
  if (state.unit) query.set("unit", state.unit);
  if (state.shade !== INITIAL.shade) query.set("shade", state.shade);
  if (writeLines(state.lines) !== writeLines(INITIAL.lines))
    query.set("lines", writeLines(state.lines));
  if (state.polar) query.set("polar", "1");
  if (state.palette !== INITIAL.palette) query.set("palette", state.palette);
  if (state.range !== null) query.set("range", String(state.range));
  if (state.wireframe) query.set("wireframe", "1");
  if (state.up) query.set("up", state.up);
  if (state.view) query.set("view", state.view.map((x) => Number(x.toFixed(4))).join(","));
  // Points are easier to read without escapes, which none of these needs in a query.
  const text = query.toString().replaceAll("%2C", ",").replaceAll("%3A", ":");
  return text ? `?${text}` : ".";
}

const UPS: readonly Up[] = ["y", "z"];

export function readState(search: string): WrittenState {
  const query = new URLSearchParams(search);
  const target = query.get("target");
  const numbers = query.get("view")?.split(",").map(Number);
  const view = numbers?.length === 6 && numbers.every(Number.isFinite) ? numbers : null;
  return {
    mesh: query.get("mesh"),
    sources: query.getAll("source").map(parsePoint),
    target: target === null ? null : parsePoint(target),
    waypoints: query.getAll("via").map(parsePoint),
    walk: readWalk(query.get("walk") ?? ""),
    barriers: readRanges(query.get("barriers") ?? ""),
    method: oneOf<Method>(query.get("method"), ["exact", "approximate", "fast"]),
    error: positive(query.get("error")) ?? INITIAL.error,
    effort: EFFORTS.find((effort) => String(effort) === query.get("effort")) ?? INITIAL.effort,
    maxDistance: positive(query.get("max_distance")),
    isReadable: true,
    unit: query.get("unit")?.slice(0, LONGEST_UNIT) ?? "",
    shade: oneOf<Shade>(query.get("shade"), ["distance", "territories", "difference", "proof"]),
    lines: readLines(query.get("lines")),
    polar: query.get("polar") === "1",
    palette: oneOf<Palette>(query.get("palette"), PALETTES),
    range: positive(query.get("range")),
    wireframe: query.get("wireframe") === "1",
    // A view without an axis was written when y was always up.
    up: UPS.find((up) => up === query.get("up")) ?? (view && "y"),
    view,
  };
}

function writeLines(lines: Lines): string {
  if (lines === null) return "none";
  return "count" in lines ? `count:${lines.count}` : `spacing:${lines.spacing}`;
}

function readLines(text: string | null): Lines {
  if (text === "none") return null;
  const [kind, value] = text?.split(":") ?? [];
  const number = positive(value ?? null);
  if (number !== null && kind === "count") return { count: Math.round(number) };
  if (number !== null && kind === "spacing") return { spacing: number };
  return INITIAL.lines;
}

/** Read a vector: x, y, z; nothing is none. */
function readWalk(text: string): Triple | null {
  if (!text.trim()) return null;
  const numbers = text
    .trim()
    .split(/[\s,]+/)
    .map(Number);
  if (numbers.length !== 3 || !numbers.every(Number.isFinite)) {
    throw new InputError(
      "Not a vector",
      `“${text}” is not a direction in space.`,
      "Write its x, y and z: 0.5, 0, 0.2. Its length is that of the line.",
    );
  }
  return numbers as Triple;
}

/** Write numbers as ranges, in order: 3,7,40-59. */
export function writeRanges(numbers: number[]): string {
  const ranges: [number, number][] = [];
  for (const number of numbers.toSorted((a, b) => a - b)) {
    const last = ranges.at(-1);
    if (last && number <= last[1] + 1) last[1] = number;
    else ranges.push([number, number]);
  }
  return ranges
    .map(([first, last]) => (first === last ? `${first}` : `${first}-${last}`))
    .join(",");
}

function readRanges(text: string): number[] {
  return text.split(/[\s,]+/).flatMap((part) => {
    if (!part) return [];
    const [, first, last = first] = /^(\d+)(?:-(\d+))?$/.exec(part) ?? [];
    const length = Number(last) - Number(first) + 1;
    if (!(length > 0 && Number(last) < MOST_FACES)) {
      throw new InputError(
        "Not a range of faces",
        `“${part}” is neither the number of a face nor a range of them.`,
        "Write 3,7,40-59 for the faces 3, 7 and 40 to 59.",
      );
    }
    return Array.from({ length }, (_, i) => Number(first) + i);
  });
}

function oneOf<T extends string>(text: string | null, choices: readonly [T, ...T[]]): T {
  return choices.find((choice) => choice === text) ?? choices[0];
}

function positive(text: string | null): number | null {
  const number = Number(text);
  return Number.isFinite(number) && number > 0 ? number : null;
}
