// Points as text: v12, e12-13:0.3, f7:0.2,0.3,0.5, p1,2,3.
import type { Point } from "../api/types";
import { InputError } from "../inputError";

export type WrittenPoint = Point | { position: [number, number, number] };

const NUMBER = String.raw`[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?`;
const TRIPLE = `(${NUMBER}),(${NUMBER}),(${NUMBER})`;
const VERTEX = /^v?(\d+)$/;
const EDGE = new RegExp(`^e(\\d+)-(\\d+):(${NUMBER})$`);
const FACE = new RegExp(`^f(\\d+):${TRIPLE}$`);
const POSITION = new RegExp(`^p${TRIPLE}$`);

export function parsePoint(text: string): WrittenPoint {
  const vertex = VERTEX.exec(text);
  if (vertex) return { vertex: Number(vertex[1]) };
  const edge = EDGE.exec(text);
  if (edge) return { edge: [Number(edge[1]), Number(edge[2])], t: Number(edge[3]) };
  const face = FACE.exec(text);
  if (face) return { face: Number(face[1]), barycentric: triple(face, 2) };
  const position = POSITION.exec(text);
  if (position) return { position: triple(position, 1) };
  throw new InputError(
    "Not a point",
    `“${text}” is not a point.`,
    "Write v12 for a vertex, e12-13:0.3 for a place on an edge, f7:0.2,0.3,0.5 for one in a face, " +
      "or p1,2,3 for a position.",
  );
}

/** Read points, with blanks between them, and commas before the blanks if there are any. */
export function parsePoints(text: string): WrittenPoint[] {
  return text
    .split(/,?\s+|,$/)
    .filter(Boolean)
    .map(parsePoint);
}

export function writePoint(point: Point): string {
  if ("vertex" in point) return `v${point.vertex}`;
  if ("edge" in point) return `e${point.edge.join("-")}:${point.t}`;
  return `f${point.face}:${point.barycentric.map((weight) => short(weight)).join(",")}`;
}

/** Return a point in words, without its coordinates. */
export function sayPoint(point: Point): string {
  if ("vertex" in point) return `vertex ${point.vertex}`;
  if ("edge" in point) return `on edge ${point.edge.join("–")}`;
  return `on face ${point.face}`;
}

/** Round the weights to six digits: less than a millionth of a face cannot be seen. */
export function rounded(point: Point): Point {
  if (!("face" in point)) return point;
  const [u, v] = point.barycentric.map((weight) => Number(weight.toFixed(6))) as [
    number,
    number,
    number,
  ];
  return { face: point.face, barycentric: [u, v, short(Math.max(0, 1 - u - v))] };
}

function short(x: number): number {
  return Number(x.toFixed(6));
}

function triple(match: RegExpExecArray, from: number): [number, number, number] {
  return [Number(match[from]), Number(match[from + 1]), Number(match[from + 2])];
}
