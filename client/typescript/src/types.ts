// Types of requests and answers: the service's, by its names. schema.ts is generated.
import type { components } from "./schema.js";

export type Schemas = components["schemas"];

export type About = Schemas["About"];
export type Border = Schemas["BorderDocument"];
export type BordersAnswer = Schemas["BordersAnswer"];
export type Boundary = Schemas["BoundaryDocument"];
export type Certificate = Schemas["Certificate"];
export type ErrorBound = Schemas["ErrorBound"];
export type Isoline = Schemas["IsolineDocument"];
export type IsolinesAnswer = Schemas["IsolinesAnswer"];
export type Job = Schemas["JobDocument"];
export type ListedMesh = Schemas["ListedMesh"];
export type MeshDocument = Schemas["MeshDocument"];
export type MeshList = Schemas["MeshList"];
export type PathAnswer = Schemas["PathAnswer"];
export type Problem = Schemas["ProblemDocument"];
export type ResolvedPoint = Schemas["ResolvedPoint"];
export type Step = Schemas["SearchStep"];
export type StraightLine = Schemas["StraightLine"];
export type SurfaceCost = Schemas["SurfaceCost"];
export type SurfaceCurve = Schemas["SurfaceCurve"];
export type SweepAnswer = Schemas["SweepAnswer"];
export type Unreachable = Schemas["Unreachable"];

/** The index of a vertex; or a point of an edge, in a face, or nearest to a position. */
export type Point = Schemas["PathRequest"]["source"];
/** A point or a curve, where distances may begin with another value than 0. */
export type Source = Schemas["DistancesRequest"]["sources"][number];
export type Method = NonNullable<Schemas["DistancesRequest"]["method"]>;
export type Effort = NonNullable<Schemas["DistancesRequest"]["effort"]>;

/** Request and answer of each query, by the last part of its address. */
export interface Queries {
  distances: { request: Schemas["DistancesRequest"]; answer: Schemas["DistancesAnswer"] };
  path: { request: Schemas["PathRequest"]; answer: PathAnswer };
  "path/steps": { request: Schemas["StepsRequest"]; answer: Schemas["StepsAnswer"] };
  sweep: { request: Schemas["SweepRequest"]; answer: SweepAnswer };
  paths: { request: Schemas["PathsRequest"]; answer: Schemas["PathsAnswer"] };
  isolines: { request: Schemas["IsolinesRequest"]; answer: IsolinesAnswer };
  borders: { request: Schemas["BordersRequest"]; answer: BordersAnswer };
  boundaries: { request: Schemas["BoundariesRequest"]; answer: Schemas["BoundariesAnswer"] };
  loop: { request: Schemas["LoopRequest"]; answer: Schemas["LoopAnswer"] };
  cut: { request: Schemas["CutRequest"]; answer: Schemas["CutAnswer"] };
  matrix: { request: Schemas["MatrixRequest"]; answer: Schemas["MatrixAnswer"] };
  nearest: { request: Schemas["NearestRequest"]; answer: Schemas["NearestAnswer"] };
  samples: { request: Schemas["SamplesRequest"]; answer: Schemas["SamplesAnswer"] };
  cells: { request: Schemas["CellsRequest"]; answer: Schemas["CellsAnswer"] };
  mean: { request: Schemas["MeanRequest"]; answer: Schemas["MeanAnswer"] };
  "log-map": { request: Schemas["LogMapRequest"]; answer: Schemas["LogMapAnswer"] };
  trace: { request: Schemas["TraceRequest"]; answer: Schemas["TraceAnswer"] };
  locate: { request: Schemas["LocateRequest"]; answer: Schemas["LocateAnswer"] };
}

export type Kind = keyof Queries;

type CamelCase<Name extends string> = Name extends `${infer Head}_${infer Tail}`
  ? `${Head}${Capitalize<CamelCase<Tail>>}`
  : Name;

/** A request in the names of TypeScript, such as `maxDistance` for `max_distance`. */
export type Question<K extends Kind> = {
  [Name in keyof Queries[K]["request"] as CamelCase<Name & string>]:
    | Queries[K]["request"][Name]
    | (undefined extends Queries[K]["request"][Name] ? undefined : never);
};

export interface Stop {
  /** An abort stops the work at the service. */
  signal?: AbortSignal | undefined;
}

/** How the work on an answer is watched and stopped. */
export interface Call extends Stop {
  /** Is called with the share of the work that is done, 0 to 1, where it takes long. */
  onProgress?: ((share: number) => void) | undefined;
}

/** The members of a request that are not arguments, and how the work is watched and stopped. */
export type Options<K extends Kind, Given extends keyof Question<K> = never> = Partial<
  Omit<Question<K>, Given>
> &
  Call;

/** Distances of all vertices, or of the targets; infinite where they cannot be reached. */
export interface Distances
  extends Pick<
    Schemas["DistancesAnswer"],
    "mesh_id" | "method" | "error_bound" | "unreachable" | "warnings"
  > {
  distances: Float64Array<ArrayBuffer>;
  /** Index of the nearest source, -1 where unreachable; these are there if they were included. */
  nearest_source?: Int32Array;
  /** The direction in which distance grows, three numbers for each vertex. */
  gradient?: Float64Array;
  /** Proved bounds of each distance. */
  lower?: Float64Array;
  upper?: Float64Array;
  /** By how much each face widens the gap at most, mesh units. */
  violations?: Float64Array;
  certificate?: Certificate;
  /** Computing time by the service's own clock; null for an answer that it had. */
  seconds: number | null;
}

/** Distances between many points; infinite where they cannot be reached. */
export interface Matrix {
  layout: NonNullable<Schemas["MatrixRequest"]["layout"]>;
  /** A row for each source where `dense`; one for each pair, or for each finite one. */
  distances: Float64Array;
  /** Rows and columns of a dense one. */
  shape?: number[];
  /** The source and the target of each distance of a sparse one. */
  rows?: Int32Array;
  columns?: Int32Array;
  error_bound: ErrorBound;
}

/** Where each vertex lies as seen from a source. */
export interface LogMap {
  mesh_id: string;
  /** Sum of the angles of the surface around the source, radians. */
  total_angle: number;
  /** Infinite where unreachable. */
  distances: Float64Array;
  /** Radians at which the shortest path leaves the source; NaN where unreachable. */
  angles: Float64Array;
  /** Two for each vertex, in the tangent plane; NaN where unreachable. */
  coordinates: Float64Array;
  /** Vertices that the path bends at; -1 where unreachable. */
  bends: Int32Array;
}

/** Points spread over a surface. */
export interface Samples extends Omit<Schemas["SamplesAnswer"], "radii" | "distances" | "nearest"> {
  /** Infinite while a part has no point. */
  radii: Float64Array;
  /** Of each vertex from the nearest point; infinite where unreachable. */
  distances?: Float64Array;
  /** Index of that point; -1 where unreachable. */
  nearest?: Int32Array;
}

type Doubles = "vertices" | "lengths" | "location_weights";

/** An array of a mesh. */
export type ArrayName =
  | Doubles
  | "faces"
  | "vertex_map"
  | "face_map"
  | "components"
  | "face_of"
  | "location_faces"
  | "curve_edges"
  | "edge_curves"
  | "copy_of"
  | "parts";

export interface Table<Name extends ArrayName> {
  data: Name extends Doubles ? Float64Array<ArrayBuffer> : Int32Array<ArrayBuffer>;
  shape: number[];
}
