// The state as the page's address, and back: /?mesh=ID&source=v0*Home&target=v99
import type { Effort, Method } from "geodesic-client";
import { InputError } from "../inputError";
import type { Triple, Up } from "../mesh/frame";
import type { Barriers } from "./barriers";
import type { Place } from "./places";
import { parsePoint, type WrittenPoint, writePoint } from "./point";
import {
  backTo,
  CURVES,
  type Cut,
  INITIAL,
  type Lines,
  PALETTES,
  type Palette,
  RULES,
  type Section,
  type Shade,
  type Slope,
  type State,
} from "./state";

/** Characters of the name of a unit, and of a point. */
export const LONGEST_UNIT = 12;
export const LONGEST_NAME = 24;
const EFFORTS: Effort[] = [1, 2, 4, 8];
/** No mesh has more faces. */
const MOST_FACES = 1e8;

/** A state whose points may still be positions, which the service has to locate. */
export type WrittenState = Omit<State, "places"> & { places: readonly Place<WrittenPoint>[] };

/** Return the address of a state, without the numbers of files. */
export function writeState(state: State): string {
  const query = new URLSearchParams();
  if (state.mesh) query.set("mesh", state.mesh);
  if (state.cut) {
    query.set("cut", state.cut.along.join(","));
    query.set("cut_from", writeState({ ...INITIAL, ...state.cut.back }).slice(1));
  }
  const { places, starts } = state;
  const hasEnd = places.length > starts;
  const parts = {
    source: places.slice(0, starts),
    via: places.slice(starts, -1),
    target: hasEnd ? places.slice(-1) : [],
  };
  for (const [name, part] of Object.entries(parts)) {
    if (part.length > 0) query.set(name, part.map(writePlace).join(";"));
  }
  if (state.walk) query.set("walk", state.walk.join(","));
  if (state.barriers.length > 0) query.set("barriers", writeBarriers(state.barriers));
  if (state.method !== INITIAL.method) query.set("method", state.method);
  if (state.error !== INITIAL.error) query.set("error", String(state.error));
  if (state.effort !== INITIAL.effort) query.set("effort", String(state.effort));
  if (state.maxDistance !== null) query.set("max_distance", String(state.maxDistance));
  if (state.slope) query.set("slope", `${state.slope.rule}:${state.slope.up}`);
  if (state.unit) query.set("unit", state.unit);
  if (!state.distances) query.set("distances", "0");
  if (state.shade !== INITIAL.shade) query.set("shade", state.shade);
  if (state.versus) query.set("versus", state.versus);
  if (writeLines(state.lines) !== writeLines(INITIAL.lines))
    query.set("lines", writeLines(state.lines));
  if (state.polar) query.set("polar", "1");
  if (state.boundary) query.set("boundary", "1");
  if (state.palette !== INITIAL.palette) query.set("palette", state.palette);
  if (state.least !== null) query.set("least", String(state.least));
  if (state.range !== null) query.set("range", String(state.range));
  if (state.labels) query.set("labels", "1");
  if (state.wireframe) query.set("wireframe", "1");
  if (state.flat) query.set("flat", "1");
  if (state.unroll) query.set("unroll", "1");
  if (state.section) query.set("section", `${state.section.axis}:${state.section.share}`);
  if (state.up) query.set("up", state.up);
  if (state.view) query.set("view", state.view.map((x) => Number(x.toFixed(4))).join(","));
  // Points are easier to read without escapes, which none of these needs in a query.
  const text = query
    .toString()
    .replaceAll("%2C", ",")
    .replaceAll("%3A", ":")
    .replaceAll("%3B", ";");
  return text ? `?${text}` : ".";
}

/** Read which sample an address asks for in place of a mesh, and with how many faces. */
export function readSample(search: string): [string, number] | null {
  const [name, faces] = new URLSearchParams(search).get("sample")?.split(":") ?? [];
  return name && faces ? [name, Number(faces)] : null;
}

const UPS: readonly Up[] = ["y", "z"];
const METHODS = ["exact", "approximate", "fast"] as const;

export function readState(search: string): WrittenState {
  const query = new URLSearchParams(search);
  const [sources, via, targets] = ["source", "via", "target"].map((name) =>
    query.getAll(name).flatMap((text) => text.split(";")),
  ) as [string[], string[], string[]];
  const others = [...via, ...targets.slice(0, 1)];
  const numbers = query.get("view")?.split(",").map(Number);
  const view = numbers?.length === 6 && numbers.every(Number.isFinite) ? numbers : null;
  return {
    mesh: query.get("mesh"),
    cut: readCut(query.get("cut"), query.get("cut_from")),
    places: [...sources, ...others].map(readPlace),
    starts: Math.max(1, sources.length),
    walk: readWalk(query.get("walk") ?? ""),
    barriers: readBarriers(query.get("barriers") ?? ""),
    method: oneOf<Method>(query.get("method"), METHODS),
    error: positive(query.get("error")) ?? INITIAL.error,
    effort: EFFORTS.find((effort) => String(effort) === query.get("effort")) ?? INITIAL.effort,
    maxDistance: positive(query.get("max_distance")),
    slope: readSlope(query.get("slope")),
    faceCosts: null,
    values: null,
    isReadable: true,
    unit: query.get("unit")?.slice(0, LONGEST_UNIT) ?? "",
    distances: query.get("distances") !== "0",
    shade: oneOf<Shade>(query.get("shade"), ["distance", "territories", "difference", "proof"]),
    versus: METHODS.find((method) => method === query.get("versus")) ?? null,
    lines: readLines(query.get("lines")),
    polar: query.get("polar") === "1",
    boundary: query.get("boundary") === "1",
    palette: oneOf<Palette>(query.get("palette"), PALETTES),
    least: finite(query.get("least")),
    range: finite(query.get("range")),
    labels: query.get("labels") === "1",
    wireframe: query.get("wireframe") === "1",
    flat: query.get("flat") === "1",
    unroll: query.get("unroll") === "1",
    section: readSection(query.get("section")),
    // A view without an axis was written when y was always up.
    up: UPS.find((up) => up === query.get("up")) ?? (view && "y"),
    view,
  };
}

/** Read a cut: along what, and the address of what was cut, which the page wrote. */
function readCut(along: string | null, from: string | null): Cut | null {
  if (along === null || from === null) return null;
  const { places, ...before } = readState(from);
  const kinds = CURVES.filter((kind) => along.split(",").includes(kind));
  if (before.mesh === null || kinds.length === 0 || !places.every(isLocated)) return null;
  return { along: kinds, back: backTo({ ...before, places }) };
}

function isLocated(place: Place<WrittenPoint>): place is Place {
  return !("position" in place.point);
}

/** Write a point, and behind it its name, which may hold any character but a semicolon. */
function writePlace({ point, name }: Place): string {
  return name ? `${writePoint(point)}*${name}` : writePoint(point);
}

function readPlace(text: string): Place<WrittenPoint> {
  const [point = "", ...name] = text.split("*");
  return { point: parsePoint(point), name: name.join("*").slice(0, LONGEST_NAME) };
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

function readSlope(text: string | null): Slope | null {
  const [name, axis] = text?.split(":") ?? [];
  const rule = RULES.find((each) => each === name);
  const up = UPS.find((each) => each === axis);
  return rule && up ? { rule, up } : null;
}

function readSection(text: string | null): Section | null {
  const [, axis, share] = /^([xyz]):([\d.]+)$/.exec(text ?? "") ?? [];
  const isWithin = axis && Number(share) <= 1;
  return isWithin ? { axis: axis as Section["axis"], share: Number(share) } : null;
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

/** Write each barrier as ranges of faces: 3,7,40-59;80-95. */
export function writeBarriers(barriers: Barriers): string {
  return barriers.map(writeRanges).join(";");
}

function readBarriers(text: string): Barriers {
  return text
    .split(";")
    .map(readRanges)
    .filter(({ length }) => length > 0);
}

/** Write numbers as ranges, in order. */
function writeRanges(numbers: readonly number[]): string {
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
        "Write 3,7,40-59 for the faces 3, 7 and 40 to 59; a semicolon begins another barrier.",
      );
    }
    return Array.from({ length }, (_, i) => Number(first) + i);
  });
}

function oneOf<T extends string>(text: string | null, choices: readonly [T, ...T[]]): T {
  return choices.find((choice) => choice === text) ?? choices[0];
}

function finite(text: string | null): number | null {
  return text?.trim() && Number.isFinite(Number(text)) ? Number(text) : null;
}

function positive(text: string | null): number | null {
  const number = Number(text);
  return Number.isFinite(number) && number > 0 ? number : null;
}
