// The service's own names for what goes over the wire; schema.d.ts is generated when the page is built.
import type { components } from "./schema";

type Schemas = components["schemas"];

export type About = Schemas["About"];
export type ErrorBound = Schemas["ErrorBound"];
export type Estimate = Schemas["Estimate"];
export type Job = Schemas["JobDocument"];
export type LocateAnswer = Schemas["LocateAnswer"];
export type MeshDocument = Schemas["MeshDocument"];
export type MeshList = Schemas["MeshList"];
export type Method = DistancesRequest["method"] & string;
export type Outline = Schemas["PathAnswer"];
export type Problem = Schemas["ProblemDocument"];
export type Step = Schemas["SearchStep"];
export type Unreachable = Schemas["Unreachable"];
export type DistancesRequest = Schemas["DistancesRequest"];
export type DistancesAnswer = Schemas["DistancesAnswer"];

/** Points as the page keeps them: a position is looked up when it is written down. */
export type Point =
  | { vertex: number }
  | { edge: [number, number]; t: number }
  | { face: number; barycentric: [number, number, number] };
