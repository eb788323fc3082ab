// The operations of the service.
import { Connection } from "./connection.js";
import { answerOf } from "./jobs.js";
import { npyOf, parseNpy, toDoubles, toIntegers } from "./npy.js";
import type {
  About,
  ArrayName,
  BordersAnswer,
  Call,
  Distances,
  IsolinesAnswer,
  Job,
  Kind,
  LogMap,
  Matrix,
  MeshDocument,
  MeshList,
  Options,
  PathAnswer,
  Point,
  Queries,
  Question,
  Samples,
  Schemas,
  Source,
  Stop,
  SurfaceCurve,
  SweepAnswer,
  Table,
} from "./types.js";
import { plyOf, type Triangles, upload } from "./upload.js";

const JSON_TYPE = "application/json";
const NPY = "application/x-npy";
const FLOATS: readonly ArrayName[] = ["vertices", "lengths", "location_weights"];

/** A mesh of the store, or its id. */
export type MeshRef = string | { id: string };

/**
 * A client of a service.
 *
 * A query that takes longer than a second becomes a job of the service, which is watched and in the
 * end removed. Where the service is busy, requests wait as long as it asks them to. Options have the
 * names of the interface document in the case of TypeScript, answers and points those of the
 * document. Errors of the service are thrown as `ProblemError`; where none answers, as what `fetch`
 * throws.
 */
export class GeodesicClient {
  private readonly connection: Connection;

  /**
   * @param address The address of the service.
   * @param options `apiKey`, if the service requires one, and what to call instead of `fetch`.
   */
  constructor(
    address: string | URL = "http://127.0.0.1:8000",
    options: { apiKey?: string | null; fetch?: typeof globalThis.fetch } = {},
  ) {
    const base = new URL(address);
    if (!base.pathname.endsWith("/")) base.pathname += "/";
    const send = options.fetch ?? ((...request) => globalThis.fetch(...request));
    this.connection = new Connection(base, options.apiKey ?? null, send);
  }

  /** The address of the service, which ends with a slash. */
  get address(): string {
    return this.connection.address.href;
  }

  get apiKey(): string | null {
    return this.connection.apiKey;
  }

  set apiKey(key: string | null) {
    this.connection.apiKey = key;
  }

  /** Return version, formats and limits of the service. */
  about({ signal }: Stop = {}): Promise<About> {
    return this.connection.getJson("v1", signal);
  }

  /**
   * Store a mesh: a file in any format that the service reads, or vertices and triangles.
   *
   * The same mesh is never stored twice. `name` is the name of the file, by whose end the service
   * tells the format, unless `format` does. Progress is told in browsers.
   */
  upload(
    mesh: Blob | Triangles,
    options: { name?: string; format?: string; merge?: "none" | "exact" | number } & Call = {},
  ): Promise<MeshDocument> {
    const { merge = "none", format, signal, onProgress } = options;
    const [file, usual] = mesh instanceof Blob ? [mesh, nameOf(mesh)] : [plyOf(mesh), "mesh.ply"];
    const form = new FormData();
    form.set("file", file, options.name ?? usual);
    const parameters = new URLSearchParams({ merge: String(merge), ...(format && { format }) });
    return upload(this.connection, `v1/meshes?${parameters}`, form, { signal, onProgress });
  }

  /** Let the service make a sample; `about` lists their names. */
  async sample(name: string, faces = 20_000, { signal }: Stop = {}): Promise<MeshDocument> {
    const parameters = new URLSearchParams({ sample: name, faces: String(faces) });
    const init = { method: "POST", ...(signal && { signal }) };
    return (
      await this.connection.call(`v1/meshes?${parameters}`, init)
    ).json() as Promise<MeshDocument>;
  }

  /** Return meshes of the store, or those of a name, the newest first; `next_cursor` leads on. */
  meshes({
    signal,
    ...options
  }: { name?: string; limit?: number; cursor?: string } & Stop = {}): Promise<MeshList> {
    return this.connection.getJson(`v1/meshes${parametersOf(options)}`, signal);
  }

  /** Return a mesh of the store, with its report. */
  mesh(id: string, { signal }: Stop = {}): Promise<MeshDocument> {
    return this.connection.getJson(linkOf(id), signal);
  }

  /** Remove a mesh and its results from the store. */
  async deleteMesh(mesh: MeshRef): Promise<void> {
    await this.connection.call(linkOf(mesh), { method: "DELETE" });
  }

  /** Return an array of a mesh: its vertices, or its faces, for example. */
  async array<Name extends ArrayName>(
    mesh: MeshRef,
    name: Name,
    { signal }: Stop = {},
  ): Promise<Table<Name>> {
    const path = `${linkOf(mesh)}/arrays/${name}`;
    const response = await this.connection.call(path, signal ? { signal } : {});
    const array = parseNpy(await response.arrayBuffer());
    const data = FLOATS.includes(name) ? toDoubles(array) : toIntegers(array);
    return { data, shape: array.shape } as Table<Name>;
  }

  /** Return the distance of each vertex, or of each target, from the nearest source. */
  async distances(
    mesh: MeshRef,
    sources: Source | Source[],
    options: Options<"distances", "sources"> = {},
  ): Promise<Distances> {
    const question = { ...options, sources: listOf(sources) };
    const isPlain = !options.include?.length && !options.certify;
    const accept = isPlain ? NPY : JSON_TYPE;
    const response = await this.respond(mesh, "distances", question, options, accept);
    const seconds = secondsOf(response);
    if (isPlain) {
      const distances = toDoubles(parseNpy(await response.arrayBuffer()));
      return { ...membersOf(response, { warnings: [] }), distances, seconds } as Distances;
    }
    const answer = (await response.json()) as Schemas["DistancesAnswer"];
    const { mesh_id, method, error_bound, unreachable, warnings } = answer;
    return {
      ...{ mesh_id, method, error_bound, unreachable, warnings, seconds },
      distances: withInfinity(answer.distances),
      ...(answer.nearest_source && { nearest_source: withMinusOne(answer.nearest_source) }),
      ...(answer.gradient && { gradient: Float64Array.from(answer.gradient.flat()) }),
      ...(answer.lower && { lower: withInfinity(answer.lower) }),
      ...(answer.upper && { upper: withInfinity(answer.upper) }),
      ...(answer.violations && { violations: Float64Array.from(answer.violations) }),
      ...(answer.certificate && { certificate: answer.certificate }),
    };
  }

  /** Return the shortest path, past `waypoints` in their order; `length` is null for none. */
  path(
    mesh: MeshRef,
    source: Point,
    target: Point,
    options: Options<"path", "source" | "target"> = {},
  ): Promise<PathAnswer> {
    return this.ask(mesh, "path", { ...options, source, target });
  }

  /** Return the steps of the search for the exact path; none where there is no path. */
  pathSteps(
    mesh: MeshRef,
    source: Point,
    target: Point,
    options: Options<"path/steps", "source" | "target"> = {},
  ): Promise<Schemas["StepsAnswer"]> {
    return this.ask(mesh, "path/steps", { ...options, source, target });
  }

  /** Return the windows of an exact sweep, step by step, on a mesh of at most 5000 faces. */
  sweepSteps(
    mesh: MeshRef,
    sources: Point | Point[],
    options: Options<"sweep", "sources"> = {},
  ): Promise<SweepAnswer> {
    return this.ask(mesh, "sweep", { ...options, sources: listOf(sources) });
  }

  /** Return the shortest path from a source to each of the targets. */
  paths(
    mesh: MeshRef,
    source: Schemas["PathsRequest"]["source"],
    targets: Point[],
    options: Options<"paths", "source" | "targets"> = {},
  ): Promise<Schemas["PathsAnswer"]> {
    return this.ask(mesh, "paths", { ...options, source, targets });
  }

  /**
   * Return the lines at some distances (`levels`), or at `count` evenly spaced ones.
   *
   * In place of sources, values at the vertices may be given: lines are at levels of these.
   */
  async isolines(
    mesh: MeshRef,
    of: Source | Source[] | Float64Array,
    options: Options<"isolines", "sources" | "values"> = {},
  ): Promise<IsolinesAnswer> {
    if (!(of instanceof Float64Array)) {
      return this.ask(mesh, "isolines", { ...options, sources: listOf(of) });
    }
    const form = new FormData();
    form.set("request", new Blob([JSON.stringify(toWire(options))], { type: JSON_TYPE }));
    form.set("values", new Blob([npyOf(of)], { type: NPY }));
    const init = { body: form, headers: { Accept: JSON_TYPE } };
    const path = `${linkOf(mesh)}/isolines`;
    return (await answerOf(this.connection, path, init, options)).json() as Promise<IsolinesAnswer>;
  }

  /** Return the lines between the parts of the surface that are nearest to each source. */
  borders(
    mesh: MeshRef,
    sources: Source[],
    options: Options<"borders", "sources"> = {},
  ): Promise<BordersAnswer> {
    return this.ask(mesh, "borders", { ...options, sources });
  }

  /** Return the boundary of the surface, longest line first; none for a closed surface. */
  boundaries(
    mesh: MeshRef,
    options: Options<"boundaries"> = {},
  ): Promise<Schemas["BoundariesAnswer"]> {
    return this.ask(mesh, "boundaries", options);
  }

  /**
   * Return the shortest loop through a point that cannot be shrunk to a point.
   *
   * Without a point, return two loops for each handle of the surface, the shortest first.
   */
  loops(mesh: MeshRef, options: Options<"loop", "curves"> = {}): Promise<Schemas["LoopAnswer"]> {
    return this.ask(mesh, "loop", options);
  }

  /** Return curves pulled tight, in their order: each the shortest near it, with the same ends. */
  straighten(
    mesh: MeshRef,
    curves: SurfaceCurve[],
    options: Options<"loop", "curves" | "through"> = {},
  ): Promise<Schemas["LoopAnswer"]> {
    return this.ask(mesh, "loop", { ...options, curves });
  }

  /** Cut a mesh along curves; `cut_mesh_id` of the answer is the new mesh in the store. */
  cut(
    mesh: MeshRef,
    curves: SurfaceCurve[],
    options: Options<"cut", "curves"> = {},
  ): Promise<Schemas["CutAnswer"]> {
    return this.ask(mesh, "cut", { ...options, curves });
  }

  /** Return the distances from each source to each target, or for pairs of them. */
  async matrix(
    mesh: MeshRef,
    sources: Point[],
    options: Options<"matrix", "sources"> = {},
  ): Promise<Matrix> {
    const { layout = "dense" } = options;
    const question = { ...options, sources };
    if (layout === "sparse") {
      const { distances, rows, columns, error_bound } = await this.ask(mesh, "matrix", question);
      return {
        ...{ layout, error_bound, distances: withInfinity(distances as number[]) },
        rows: Int32Array.from(rows ?? []),
        columns: Int32Array.from(columns ?? []),
      };
    }
    const response = await this.respond(mesh, "matrix", question, options, NPY);
    const array = parseNpy(await response.arrayBuffer());
    const { error_bound } = membersOf(response) as Pick<Matrix, "error_bound">;
    return { layout, shape: array.shape, distances: toDoubles(array), error_bound };
  }

  /** Return the `k` candidates that are nearest along the surface, nearest first. */
  nearest(
    mesh: MeshRef,
    source: Point,
    candidates: Point[],
    options: Options<"nearest", "source" | "candidates"> = {},
  ): Promise<Schemas["NearestAnswer"]> {
    return this.ask(mesh, "nearest", { ...options, source, candidates });
  }

  /** Return points spread over a surface, `count` of them, or as many as `radius` needs. */
  async samples(mesh: MeshRef, options: Options<"samples"> = {}): Promise<Samples> {
    const { distances, nearest, radii, ...rest } = await this.ask(mesh, "samples", options);
    return {
      ...rest,
      radii: withInfinity(radii),
      ...(distances && { distances: withInfinity(distances) }),
      ...(nearest && { nearest: withMinusOne(nearest) }),
    };
  }

  /** Return areas, centroids and neighbours of what is nearest to each source. */
  cells(
    mesh: MeshRef,
    sources: Source[],
    options: Options<"cells", "sources"> = {},
  ): Promise<Schemas["CellsAnswer"]> {
    return this.ask(mesh, "cells", { ...options, sources });
  }

  /** Return the point whose squared distances from some points sum to the least. */
  mean(
    mesh: MeshRef,
    points: Point[],
    options: Options<"mean", "points"> = {},
  ): Promise<Schemas["MeanAnswer"]> {
    return this.ask(mesh, "mean", { ...options, points });
  }

  /** Return how far each vertex is from a source, and in which direction. */
  async logMap(
    mesh: MeshRef,
    source: Point,
    options: Options<"log-map", "source"> = {},
  ): Promise<LogMap> {
    const response = await this.respond(mesh, "log-map", { ...options, source }, options, NPY);
    const rows = toDoubles(parseNpy(await response.arrayBuffer()));
    const count = rows.length / 5;
    const at = (i: number, column: number) => rows[5 * i + column] as number;
    const column = (k: number) => Float64Array.from({ length: count }, (_, i) => at(i, k));
    const { mesh_id, total_angle } = membersOf(response);
    return {
      ...{ mesh_id: String(mesh_id), total_angle: Number(total_angle) },
      distances: column(0),
      angles: column(1),
      coordinates: Float64Array.from({ length: 2 * count }, (_, i) => at(i >> 1, 2 + (i & 1))),
      bends: Int32Array.from(column(4)),
    };
  }

  /**
   * Return the straightest lines from some points, in some directions, for some lengths.
   *
   * Of each there is one for all lines, or one for each line. Directions are angles in radians, or
   * vectors in space.
   */
  trace(
    mesh: MeshRef,
    starts: Point[],
    directions: Question<"trace">["directions"],
    lengths: number[],
    options: Options<"trace", "starts" | "directions" | "lengths"> = {},
  ): Promise<Schemas["TraceAnswer"]> {
    return this.ask(mesh, "trace", { ...options, starts, directions, lengths });
  }

  /** Return the point of the surface nearest to each position; null where too far. */
  locate(
    mesh: MeshRef,
    points: [number, number, number][],
    options: Options<"locate", "points"> = {},
  ): Promise<Schemas["LocateAnswer"]> {
    return this.ask(mesh, "locate", { ...options, points });
  }

  /** Return the answer to a question as a file in a format of the service, such as `obj`. */
  async file<K extends Kind>(
    mesh: MeshRef,
    kind: K,
    question: Question<K> & Call,
    format: string,
  ): Promise<Blob> {
    const parameters = { format };
    return (await this.respond(mesh, kind, question, question, "*/*", parameters)).blob();
  }

  /** Return jobs of this caller, the newest first; `next_cursor` leads on. */
  jobs({
    signal,
    ...options
  }: { limit?: number; cursor?: string } & Stop = {}): Promise<Schemas["JobList"]> {
    return this.connection.getJson(`v1/jobs${parametersOf(options)}`, signal);
  }

  /** Return the state of a job. */
  job(id: string, { signal }: Stop = {}): Promise<Job> {
    return this.connection.getJson(jobLinkOf(id), signal);
  }

  /** Stop a job that waits or runs; one that has finished stays, with its answer. */
  async cancelJob(id: string): Promise<Job> {
    const response = await this.connection.call(`${jobLinkOf(id)}/cancel`, { method: "POST" });
    return response.json() as Promise<Job>;
  }

  /** Remove a job and its answer; one that waits or runs is stopped. */
  async deleteJob(id: string): Promise<void> {
    await this.connection.call(jobLinkOf(id), { method: "DELETE" });
  }

  private async ask<K extends Kind>(
    mesh: MeshRef,
    kind: K,
    question: Question<K> & Call,
  ): Promise<Queries[K]["answer"]> {
    const response = await this.respond(mesh, kind, question, question, JSON_TYPE);
    return response.json() as Promise<Queries[K]["answer"]>;
  }

  private respond(
    mesh: MeshRef,
    kind: Kind,
    question: object,
    call: Call,
    accept: string,
    parameters: Record<string, string> = {},
  ): Promise<Response> {
    const init = {
      body: JSON.stringify(toWire(question)),
      headers: { "Content-Type": JSON_TYPE, Accept: accept },
    };
    const path = `${linkOf(mesh)}/${kind}${parametersOf(parameters)}`;
    return answerOf(this.connection, path, init, call);
  }
}

/** Return a question as the body of a request: its members, by the service's names. */
export function toWire({
  signal: _,
  onProgress: __,
  ...question
}: object & Call): Record<string, unknown> {
  return Object.fromEntries(
    Object.entries(question).map(([name, value]) => [
      name.replace(/[A-Z]/g, (letter) => `_${letter.toLowerCase()}`),
      value as unknown,
    ]),
  );
}

function linkOf(mesh: MeshRef): string {
  return `v1/meshes/${encodeURIComponent(typeof mesh === "string" ? mesh : mesh.id)}`;
}

function jobLinkOf(id: string): string {
  return `v1/jobs/${encodeURIComponent(id)}`;
}

function parametersOf(options: object): string {
  const given = Object.entries(options).map(([name, value]) => [name, String(value)]);
  return given.length > 0 ? `?${new URLSearchParams(given)}` : "";
}

function nameOf(file: Blob): string {
  return "name" in file ? String(file.name) : "mesh";
}

function listOf<T>(values: T | T[]): T[] {
  return Array.isArray(values) ? values : [values];
}

/** Return the members of an answer that are in headers, as an array has no place for them. */
function membersOf({ headers }: Response, usual: object = {}): Record<string, unknown> {
  const members = [...headers].flatMap(([header, value]) => {
    const [, name] = /^geodesic-(.+)$/.exec(header) ?? [];
    if (name === undefined) return [];
    const member: unknown = /^[[{]/.test(value) ? JSON.parse(value) : value;
    return [[name.replaceAll("-", "_"), member]];
  });
  return { ...usual, ...Object.fromEntries(members) };
}

function secondsOf({ headers }: Response): number | null {
  const phase = /compute;dur=([\d.]+)/.exec(headers.get("Server-Timing") ?? "");
  return phase ? Number(phase[1]) / 1000 : null;
}

function withInfinity(values: readonly (number | null)[]): Float64Array<ArrayBuffer> {
  return Float64Array.from(values, (value) => value ?? Infinity);
}

function withMinusOne(values: readonly (number | null)[]): Int32Array {
  return Int32Array.from(values, (value) => value ?? -1);
}
