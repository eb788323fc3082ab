// Points as text: v12, e12-13:0.3, f7:0.2,0.3, p1,2,3; and lists of them: v12 > v5 > v99.

import type { ResolvedPoint } from "geodesic-client";
import { InputError } from "../inputError";
import { type Places, startsOf } from "./places";

/** A point of the surface. Positions in space are not stored: the service locates them first. */
export type Point =
  | { vertex: number }
  | { edge: [number, number]; t: number }
  | { face: number; barycentric: [number, number, number] };

export type WrittenPoint = Point | { position: [number, number, number] };

const NUMBER = String.raw`[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?`;
const TRIPLE = `(${NUMBER}),(${NUMBER}),(${NUMBER})`;
const VERTEX = /^v?(\d+)$/;
const EDGE = new RegExp(`^e(\\d+)-(\\d+):(${NUMBER})$`);
const FACE = new RegExp(`^f(\\d+):(${NUMBER}),(${NUMBER})(?:,(${NUMBER}))?$`);
const POSITION = new RegExp(`^p${TRIPLE}$`);

export function parsePoint(text: string): WrittenPoint {
  const vertex = VERTEX.exec(text);
  if (vertex) return { vertex: Number(vertex[1]) };
  const edge = EDGE.exec(text);
  if (edge) return { edge: [Number(edge[1]), Number(edge[2])], t: Number(edge[3]) };
  const face = FACE.exec(text);
  if (face) return { face: Number(face[1]), barycentric: weights(face) };
  const position = POSITION.exec(text);
  if (position) return { position: triple(position, 1) };
  throw new InputError(
    "Not a point",
    `“${text}” is not a point.`,
    "Write v12 for a vertex, e12-13:0.3 for a place on an edge, f7:0.2,0.3 for one in a face, " +
      "or p1,2,3 for a position.",
  );
}

/** Read the starts, and after each > a point that the path goes to; names stay with their points. */
export function parsePlaces(text: string, before: Places): Places<WrittenPoint> {
  const [first = [], ...others] = text.split(">").map((part) =>
    part
      .split(/,?\s+|,$/)
      .filter(Boolean)
      .map(parsePoint),
  );
  const names = new Map(before.places.map(({ point, name }) => [writePoint(point), name]));
  const points = [...first, ...others.flat()];
  return {
    places: points.map((point) => ({
      point,
      name: ("position" in point ? "" : names.get(writePoint(point))) ?? "",
    })),
    starts: Math.max(1, first.length),
  };
}

/** Return a point of an answer: at a vertex by its number, otherwise within a face. */
export function pointOf({ vertex, face, barycentric }: Partial<ResolvedPoint>): Point {
  if (vertex != null) return { vertex };
  if (face != null && barycentric) return { face, barycentric };
  throw new Error("The service returned a point that is neither at a vertex nor in a face.");
}

export function writePlaces(list: Places): string {
  const others = list.places.slice(list.starts).map(({ point }) => writePoint(point));
  return [startsOf(list).map(writePoint).join(" "), ...others].join(" > ");
}

export function writePoint(point: Point): string {
  if ("vertex" in point) return `v${point.vertex}`;
  if ("edge" in point) return `e${point.edge.join("-")}:${point.t}`;
  const [u, v] = point.barycentric;
  return `f${point.face}:${[u, v].map((weight) => String(short(weight)).replace(/^0\./, ".")).join(",")}`;
}

/** Return a point in words, without its coordinates. */
export function sayPoint(point: Point): string {
  if ("vertex" in point) return `vertex ${point.vertex}`;
  if ("edge" in point) return `on edge ${point.edge.join("–")}`;
  return `on face ${point.face}`;
}

/** Round weights to four digits, and keep their sum: less than that of a face can hardly be seen. */
export function rounded(point: Point): Point {
  if (!("face" in point)) return point;
  const [u, v] = point.barycentric.map((x) => short(x, 4)) as [number, number, number];
  return { face: point.face, barycentric: [u, v, short(Math.max(0, 1 - u - v), 4)] };
}

function short(x: number, digits = 6): number {
  return Number(x.toFixed(digits));
}

/** Return the three weights, of which the third may not be written. */
function weights(match: RegExpExecArray): [number, number, number] {
  const [u, v] = [Number(match[2]), Number(match[3])];
  return [u, v, match[4] === undefined ? Number((1 - u - v).toPrecision(12)) : Number(match[4])];
}

function triple(match: RegExpExecArray, from: number): [number, number, number] {
  return [Number(match[from]), Number(match[from + 1]), Number(match[from + 2])];
}
