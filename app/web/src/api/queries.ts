// Queries of the page: distances, territories, paths, points.
import { getJson, post } from "./http";
import { answerOf } from "./jobs";
import { parseNpy } from "./npy";
import type {
  About,
  BordersAnswer,
  Certificate,
  DistancesAnswer,
  DistancesRequest,
  ErrorBound,
  IsolinesAnswer,
  LocateAnswer,
  Outline,
  Point,
  ResolvedPoint,
  Step,
  StepsAnswer,
  StraightLine,
  SweepAnswer,
  TraceAnswer,
  TraceRequest,
  Unreachable,
} from "./types";

const JSON_TYPE = "application/json";
const NPY = "application/x-npy";

export type Question = Partial<DistancesRequest> & Pick<DistancesRequest, "sources">;

/** Distances to all vertices, infinite where unreachable. */
export interface Field {
  distances: Float64Array;
  largest: number;
  bound: ErrorBound;
  unreachable: Unreachable;
  warnings: string[];
  /** Computing time by the service's own clock; null for a cached answer. */
  seconds: number | null;
}

export async function askDistances(
  mesh: string,
  question: Question,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<Field> {
  const path = `v1/meshes/${mesh}/distances`;
  const response = await answerOf(path, question, NPY, onProgress, signal);
  const distances = parseNpy(await response.arrayBuffer()).data as Float64Array;
  return {
    distances,
    largest: largestOf(distances),
    bound: jsonHeader(response, "Geodesic-Error-Bound"),
    unreachable: jsonHeader(response, "Geodesic-Unreachable"),
    warnings: jsonHeader<string[] | null>(response, "Geodesic-Warnings") ?? [],
    seconds: secondsOf(response),
  };
}

/** What proves the distances of a field. */
export interface Proof {
  certificate: Certificate;
  /** By how much each face widens the gap at most, in mesh units. */
  violations: number[];
}

/** Prove the distances from the sources of a question. */
export async function askProof(
  mesh: string,
  question: Question,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<Proof> {
  const body = { ...question, certify: true, include: ["violations"] };
  const path = `v1/meshes/${mesh}/distances`;
  const response = await answerOf(path, body, JSON_TYPE, onProgress, signal);
  const { certificate, violations } = (await response.json()) as DistancesAnswer;
  if (!certificate || !violations) throw new Error("The service returned no proof.");
  return { certificate, violations };
}

/** Return the index of the nearest source of each vertex, -1 where there is none. */
export async function askTerritories(
  mesh: string,
  question: Question,
  signal: AbortSignal,
): Promise<Int32Array> {
  const body = { ...question, include: ["nearest_source"] };
  const response = await post(`v1/meshes/${mesh}/distances`, body, {}, signal);
  const { nearest_source } = (await response.json()) as DistancesAnswer;
  return Int32Array.from(nearest_source ?? [], (source) => source ?? -1);
}

export type IsolinesQuestion = Question & ({ levels: number[] } | { count: number });

/** Return the isolines at some levels. */
export async function askIsolines(
  mesh: string,
  question: IsolinesQuestion,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<IsolinesAnswer> {
  const path = `v1/meshes/${mesh}/isolines`;
  const response = await answerOf(path, question, JSON_TYPE, onProgress, signal);
  return response.json() as Promise<IsolinesAnswer>;
}

export type BordersQuestion = Omit<Question, "method" | "relative_error" | "effort">;

/** Return the borders between the territories of some sources. */
export async function askBorders(
  mesh: string,
  question: BordersQuestion,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<BordersAnswer> {
  const path = `v1/meshes/${mesh}/borders`;
  const response = await answerOf(path, question, JSON_TYPE, onProgress, signal);
  return response.json() as Promise<BordersAnswer>;
}

export type TraceQuestion = Pick<TraceRequest, "starts" | "directions" | "lengths" | "barriers">;

/** Return straight lines. */
export async function askTrace(
  mesh: string,
  question: TraceQuestion,
  signal: AbortSignal,
): Promise<StraightLine[]> {
  const response = await post(`v1/meshes/${mesh}/trace`, question, {}, signal);
  return ((await response.json()) as TraceAnswer).lines;
}

/** Return the sum of the angles of the surface around a point, in radians. */
export async function askTotalAngle(
  mesh: string,
  source: Point,
  barriers: number[],
  signal: AbortSignal,
): Promise<number> {
  const body = { source, barriers, max_distance: 0 };
  const response = await post(`v1/meshes/${mesh}/log-map`, body, { Accept: NPY }, signal);
  return jsonHeader(response, "Geodesic-Total-Angle");
}

/** Return the distances of some points, infinite where unreachable. */
export async function askDistancesOf(
  mesh: string,
  question: Question,
  targets: Point[],
  signal: AbortSignal,
): Promise<number[]> {
  const body = { ...question, targets };
  const response = await post(`v1/meshes/${mesh}/distances`, body, {}, signal);
  const { distances } = (await response.json()) as DistancesAnswer;
  return distances.map((distance) => distance ?? Infinity);
}

export interface RouteQuestion {
  sources: Point[];
  target: Point;
  waypoints: Point[];
  barriers: number[];
}

/**
 * Yield a fast path, then the shortest, unless there is a newer question by then; of several
 * sources, both start at the nearest.
 */
export async function* askRoute(
  mesh: string,
  question: RouteQuestion,
  signal: AbortSignal,
  isOld: () => boolean,
): AsyncGenerator<Outline> {
  const { sources, ...rest } = question;
  const source = sources[await nearestSource(mesh, question, signal)];
  for (const method of ["fast", "exact"] as const) {
    if (method === "exact" && isOld()) return;
    const body = { source, method, ...rest };
    const response = await post(`v1/meshes/${mesh}/path`, body, {}, signal);
    yield (await response.json()) as Outline;
  }
}

/** Return the steps of the search for the shortest path. */
export async function askSteps(
  mesh: string,
  question: RouteQuestion,
  signal: AbortSignal,
): Promise<Step[]> {
  const { sources, ...rest } = question;
  const source = sources[await nearestSource(mesh, question, signal)];
  const response = await post(`v1/meshes/${mesh}/path/steps`, { source, ...rest }, {}, signal);
  return ((await response.json()) as StepsAnswer).steps;
}

export interface SweepQuestion {
  sources: Point[];
  barriers: number[];
  steps: number;
}

/** Return the steps of an exact sweep. */
export async function askSweep(
  mesh: string,
  question: SweepQuestion,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<SweepAnswer> {
  const path = `v1/meshes/${mesh}/sweep`;
  const response = await answerOf(path, question, JSON_TYPE, onProgress, signal);
  return response.json() as Promise<SweepAnswer>;
}

async function nearestSource(
  mesh: string,
  { sources, target, waypoints, barriers }: RouteQuestion,
  signal: AbortSignal,
): Promise<number> {
  if (sources.length === 1) return 0;
  const first = waypoints[0] ?? target;
  const body = { sources, targets: [first], barriers, include: ["nearest_source"] };
  const response = await post(`v1/meshes/${mesh}/distances`, body, {}, signal);
  return ((await response.json()) as DistancesAnswer).nearest_source?.[0] ?? 0;
}

/** Return the point of the surface that is nearest to a position, and its distance from there. */
export async function locate(
  mesh: string,
  position: [number, number, number],
): Promise<{ point: Point; distance: number }> {
  const response = await post(`v1/meshes/${mesh}/locate`, { points: [position] });
  const [found] = ((await response.json()) as LocateAnswer).points;
  if (!found) throw new Error("The service found no point of the surface there.");
  return { point: pointOf(found), distance: found.distance };
}

/** Return a point as the page has it: at a vertex by its number, otherwise within a face. */
export function pointOf({ vertex, face, barycentric }: Partial<ResolvedPoint>): Point {
  if (vertex != null) return { vertex };
  if (face != null && barycentric) return { face, barycentric };
  throw new Error("The service returned a point that is neither at a vertex nor in a face.");
}

export function getAbout(): Promise<About> {
  return getJson("v1");
}

function jsonHeader<T>(response: Response, name: string): T {
  return JSON.parse(response.headers.get(name) ?? "null") as T;
}

function secondsOf(response: Response): number | null {
  const phase = /compute;dur=([\d.]+)/.exec(response.headers.get("Server-Timing") ?? "");
  return phase ? Number(phase[1]) / 1000 : null;
}

function largestOf(distances: Float64Array): number {
  let largest = 0;
  for (const distance of distances) {
    if (distance > largest && distance < Infinity) largest = distance;
  }
  return largest;
}
