export { GeodesicClient, type MeshRef, toWire } from "./client.js";
export { type NpyArray, parseNpy } from "./npy.js";
export { ProblemError } from "./problemError.js";
export type { components, operations, paths } from "./schema.js";
export type * from "./types.js";
export type { Triangles } from "./upload.js";
