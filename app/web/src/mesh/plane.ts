// The surface unrolled: each vertex where the log map of a point has it, and cut where this tears.
import type { LogMap } from "geodesic-client";
import { BufferAttribute, BufferGeometry } from "three";
import type { Triple } from "./frame";
import type { LoadedMesh } from "./loader";

/** Paths to both ends of an edge go round different sides if it is this many times as long. */
const TORN = 2;

export class Plane {
  readonly geometry = new BufferGeometry();
  /** The largest distance, which is drawn as 1. */
  readonly radius: number;
  private readonly positions: Float32Array;
  private readonly kept: Uint8Array;

  constructor(
    private readonly mesh: LoadedMesh,
    { distances, coordinates }: Pick<LogMap, "distances" | "coordinates">,
  ) {
    const { vertices, faces } = mesh.document;
    let radius = 0;
    for (const distance of distances) {
      if (distance < Infinity) radius = Math.max(radius, distance);
    }
    this.radius = radius || 1;
    this.positions = new Float32Array(3 * vertices);
    for (let v = 0; v < vertices; v++) {
      for (const axis of [0, 1])
        this.positions[3 * v + axis] = (coordinates[2 * v + axis] ?? 0) / this.radius;
    }
    this.kept = new Uint8Array(faces);
    const index = new Uint32Array(3 * faces);
    for (let face = 0; face < faces; face++) {
      const corners = mesh.corners(face);
      const isKept =
        corners.every((v) => (distances[v] ?? Infinity) < Infinity) && !this.isTorn(corners);
      this.kept[face] = isKept ? 1 : 0;
      // Other faces have no extent, so that all keep their numbers.
      index.set(isKept ? corners : [corners[0], corners[0], corners[0]], 3 * face);
    }
    for (let i = 0; i < this.positions.length; i++)
      if (!Number.isFinite(this.positions[i])) this.positions[i] = 0;
    const normals = new Float32Array(3 * vertices).map((_, i) => (i % 3 === 2 ? 1 : 0));
    this.geometry.setAttribute("position", new BufferAttribute(this.positions, 3));
    this.geometry.setAttribute("normal", new BufferAttribute(normals, 3));
    this.geometry.setIndex(new BufferAttribute(index, 1));
    this.geometry.computeBoundingSphere();
  }

  keeps(face: number): boolean {
    return this.kept[face] === 1;
  }

  vertex(v: number): Triple {
    return [this.positions[3 * v] ?? 0, this.positions[3 * v + 1] ?? 0, 0];
  }

  /** Return the polylines that are left of a line on the surface, with the face of each segment. */
  lines(points: readonly (readonly number[])[], faces: readonly number[]): Triple[][] {
    const lines: Triple[][] = [];
    let face = -1;
    faces.forEach((next, i) => {
      const [from, to] = points.slice(i, i + 2);
      if (!from || !to || !this.keeps(next)) {
        face = -1;
        return;
      }
      if (face < 0) lines.push([this.place(next, from)]);
      lines.at(-1)?.push(this.place(next, to));
      face = next;
    });
    return lines;
  }

  /** Return where a position of a face is. */
  private place(face: number, position: readonly number[]): Triple {
    const corners = this.mesh.corners(face);
    const [v, w] = placeIn(this.mesh, face, position);
    const weights = [1 - v - w, v, w];
    const place: Triple = [0, 0, 0];
    corners.forEach((corner, i) => {
      const at = this.vertex(corner);
      for (const axis of [0, 1] as const) place[axis] += (weights[i] ?? 0) * at[axis];
    });
    return place;
  }

  private isTorn(corners: Triple): boolean {
    return corners.some((a, i) => {
      const b = corners[(i + 1) % 3] ?? a;
      const apart = (p: Triple, q: Triple): number =>
        Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
      const there = apart(this.mesh.vertex(a), this.mesh.vertex(b));
      return this.radius * apart(this.vertex(a), this.vertex(b)) > TORN * there;
    });
  }
}

/** Return the weights of the second and third corner of a face at a position in it. */
export function placeIn(
  mesh: Pick<LoadedMesh, "corners" | "vertex">,
  face: number,
  position: readonly number[],
): [number, number] {
  const [a, b, c] = mesh.corners(face).map((corner) => mesh.vertex(corner));
  const [p, q, r] = [b!, c!, position].map((end) => end.map((x, axis) => x - a![axis]!));
  const dot = (x: number[], y: number[]): number =>
    x.reduce((sum, value, axis) => sum + value * y[axis]!, 0);
  const [pp, pq, qq, rp, rq] = [dot(p!, p!), dot(p!, q!), dot(q!, q!), dot(r!, p!), dot(r!, q!)];
  const spread = pp * qq - pq * pq;
  if (!(spread > 0)) return [0, 0];
  return [(qq * rp - pq * rq) / spread, (pp * rq - pq * rp) / spread];
}
