// Queries of the tools: samples, cells, cuts, level sets, cheapest paths, proofs, maps.
import { call, post } from "./http";
import { answerOf } from "./jobs";
import { parseNpy } from "./npy";
import type { components } from "./schema";
import type { Certificate, IsolinesAnswer, Line, Outline, Point } from "./types";

type Schemas = components["schemas"];
export type SurfaceCost = Schemas["SurfaceCost"];
export type SurfaceCurve = Schemas["SurfaceCurve"];
export type CellsAnswer = Schemas["CellsAnswer"];
export type CutAnswer = Schemas["CutAnswer"];
export type SamplesAnswer = Schemas["SamplesAnswer"];

export interface Waiting {
  onProgress: (share: number) => void;
  signal: AbortSignal;
}

export type SamplesQuestion = { starts: Point[]; barriers: number[] } & (
  | { count: number }
  | { radius: number }
);

/** Return points spread over the surface. */
export function askSamples(
  mesh: string,
  question: SamplesQuestion,
  waiting: Waiting,
): Promise<SamplesAnswer> {
  return ask(mesh, "samples", question, waiting);
}

/** Return the areas of the territories of some sources, and which of them share a border. */
export function askCells(mesh: string, question: object, waiting: Waiting): Promise<CellsAnswer> {
  return ask(mesh, "cells", question, waiting);
}

/** Cut a mesh along curves; the new mesh is in the store then. */
export function askCut(
  mesh: string,
  question: { curves: SurfaceCurve[]; name: string },
  waiting: Waiting,
): Promise<CutAnswer> {
  return ask(mesh, "cut", question, waiting);
}

/** Return the isolines or borders that a question is about, each as a curve to cut along. */
export async function askCurves(
  mesh: string,
  what: "isolines" | "borders",
  question: object,
  waiting: Waiting,
): Promise<SurfaceCurve[]> {
  const body = { ...question, include: ["locations"] };
  const answer = await ask<{ isolines?: { lines: Line[] }[]; borders?: Line[] }>(
    mesh,
    what,
    body,
    waiting,
  );
  const lines = answer.borders ?? (answer.isolines ?? []).flatMap(({ lines }) => lines);
  return lines.map(({ locations, closed }) => ({ polyline: locations ?? [], closed }));
}

/** Return the lines along which values at vertices, null where there are none, have some levels. */
export function askLevelSets(
  mesh: string,
  question: { values: (number | null)[] } & ({ count: number } | { levels: number[] }),
  waiting: Waiting,
): Promise<IsolinesAnswer> {
  return ask(mesh, "isolines", question, waiting);
}

/** Return the lines along the boundary of the surface. */
export async function askBoundaries(mesh: string, waiting: Waiting): Promise<Line[]> {
  const { boundaries } = await ask<Schemas["BoundariesAnswer"]>(mesh, "boundaries", {}, waiting);
  return boundaries;
}

/** Return the cheapest path. */
export async function askCheapest(
  mesh: string,
  question: { source: Point; target: Point; barriers: number[]; cost: SurfaceCost },
  signal: AbortSignal,
): Promise<Outline> {
  return (await post(`v1/meshes/${mesh}/path`, question, {}, signal)).json() as Promise<Outline>;
}

/** Prove that no path is shorter than the shortest; one of its ends has to be a vertex. */
export async function askPathProof(
  mesh: string,
  question: { source: Point; target: Point; barriers: number[] },
  waiting: Waiting,
): Promise<Certificate> {
  const body = { ...question, certify: true };
  const { certificate } = await ask<Outline>(mesh, "path", body, waiting);
  if (!certificate) throw new Error("The service returned no proof.");
  return certificate;
}

/** Return for each vertex five numbers: distance and angle from a point, x and y in its tangent plane,
 * and how often the path there bends; infinite or NaN where it is unreachable. */
export async function askLogMap(
  mesh: string,
  question: { source: Point; barriers: number[]; max_distance?: number },
  { onProgress, signal }: Waiting,
): Promise<Float64Array> {
  const path = `v1/meshes/${mesh}/log-map`;
  const response = await answerOf(path, question, "application/x-npy", onProgress, signal);
  return parseNpy(await response.arrayBuffer()).data as Float64Array;
}

/** Return the number of the connected piece that each vertex belongs to. */
export async function askComponents(mesh: string, signal: AbortSignal): Promise<Int32Array> {
  const response = await call(`v1/meshes/${mesh}/arrays/components`, { signal });
  return Int32Array.from(parseNpy(await response.arrayBuffer()).data as Int32Array);
}

async function ask<T>(
  mesh: string,
  operation: string,
  body: object,
  { onProgress, signal }: Waiting,
): Promise<T> {
  const path = `v1/meshes/${mesh}/${operation}`;
  const response = await answerOf(path, body, "application/json", onProgress, signal);
  return response.json() as Promise<T>;
}
