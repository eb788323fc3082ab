// Picking: from a place on the screen to a point of the surface, and the positions of points.
import { type Camera, DoubleSide, Ray, Vector3 } from "three";
import type { MeshBVH } from "three-mesh-bvh";
import type { Point } from "../state/point";
import type { LoadedMesh } from "./loader";

/** What is no farther in front of a position, in radii of the mesh, does not hide it. */
const CLOSE = 0.01;

/** Whether a drawn position is beyond the section. */
export type IsHidden = (position: Vector3) => boolean;

export type FacePoint = Extract<Point, { face: number }>;

/** Return the point of the surface under ``x``, ``y`` (-1 to 1, y upwards), or null where there is none. */
export function pick(
  mesh: LoadedMesh,
  tree: MeshBVH,
  camera: Camera,
  x: number,
  y: number,
  isHidden: IsHidden,
): FacePoint | null {
  const origin = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  const direction = new Vector3(x, y, 0.5).unproject(camera).sub(origin).normalize();
  const hit = firstHit(tree, new Ray(origin, direction), isHidden);
  if (hit?.faceIndex == null) return null;
  const [a, b, c] = mesh.corners(hit.faceIndex).map((v) => new Vector3(...mesh.drawnVertex(v)));
  return { face: hit.faceIndex, barycentric: weights(a!, b!, c!, hit.point) };
}

/** Whether neither a section nor the surface before it hides a drawn position from the camera. */
export function isSeen(
  tree: MeshBVH,
  camera: Camera,
  position: readonly number[],
  isHidden: IsHidden,
): boolean {
  const origin = new Vector3().setFromMatrixPosition(camera.matrixWorld);
  const place = new Vector3(...position);
  if (isHidden(place)) return false;
  const way = place.sub(origin);
  const hit = firstHit(tree, new Ray(origin, way.clone().normalize()), isHidden);
  return hit === null || hit.distance > way.length() - CLOSE;
}

/** Return the first place on a ray where the surface is not hidden by a section, or null. */
function firstHit(tree: MeshBVH, ray: Ray, isHidden: IsHidden) {
  const first = tree.raycastFirst(ray, DoubleSide);
  if (!first || !isHidden(first.point)) return first;
  const seen = tree.raycast(ray, DoubleSide).filter(({ point }) => !isHidden(point));
  return seen.sort((a, b) => a.distance - b.distance)[0] ?? null;
}

/** Return the barycentric weights of a point, none below 0, with sum 1. */
function weights(a: Vector3, b: Vector3, c: Vector3, point: Vector3): [number, number, number] {
  const area = (p: Vector3, q: Vector3): number => {
    const normal = b.clone().sub(a).cross(c.clone().sub(a));
    return p.clone().sub(point).cross(q.clone().sub(point)).dot(normal);
  };
  const parts = [area(b, c), area(c, a), area(a, b)].map((part) => Math.max(part, 0));
  const sum = parts[0]! + parts[1]! + parts[2]!;
  return sum > 0 ? (parts.map((part) => part / sum) as [number, number, number]) : [1, 0, 0];
}

/** Return the position of a point, in mesh units. */
export function positionOf(mesh: LoadedMesh, point: Point): [number, number, number] {
  return between(mesh, point, (vertex) => mesh.vertex(vertex));
}

/** Return where a point is drawn. */
export function drawnAt(mesh: LoadedMesh, point: Point): [number, number, number] {
  return between(mesh, point, (vertex) => mesh.drawnVertex(vertex));
}

function between(
  mesh: LoadedMesh,
  point: Point,
  place: (vertex: number) => [number, number, number],
): [number, number, number] {
  if ("vertex" in point) return place(point.vertex);
  const [vertices, shares] =
    "edge" in point
      ? [point.edge, [1 - point.t, point.t]]
      : [mesh.corners(point.face), point.barycentric];
  const corners = vertices.map(place);
  return [0, 1, 2].map((axis) =>
    corners.reduce((sum, corner, i) => sum + shares[i]! * corner[axis]!, 0),
  ) as [number, number, number];
}
