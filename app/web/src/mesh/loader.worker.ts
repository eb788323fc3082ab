// Off the main thread: fetch the arrays, compute normals, build the tree for picking.
import { GeodesicClient, ProblemError } from "geodesic-client";
import { BufferAttribute, BufferGeometry } from "three";
import { MeshBVH } from "three-mesh-bvh";
import { drawnIn, frameOf } from "./frame";
import type { LoaderRequest, LoaderResponse } from "./loader";

let faces = new Uint32Array(0);

self.onmessage = async ({ data }: MessageEvent<LoaderRequest>) => {
  try {
    if (data.kind === "mesh") await load(data);
    else sendEdges();
  } catch (error) {
    if (error instanceof ProblemError) send({ kind: "problem", problem: error.document });
    else send({ kind: "failure", message: error instanceof Error ? error.message : String(error) });
  }
};

async function load(question: LoaderRequest & { kind: "mesh" }): Promise<void> {
  const { id, address, apiKey, up } = question;
  const service = new GeodesicClient(address, { apiKey });
  const [{ data: doubles }, corners] = await Promise.all([
    service.array(id, "vertices"),
    service.array(id, "faces"),
  ]);
  faces = new Uint32Array(corners.data.buffer);
  const frame = frameOf(doubles, up);
  const positions = new Float32Array(doubles.length);
  for (let i = 0; i < doubles.length; i += 3) {
    positions.set(drawnIn(frame, [doubles[i]!, doubles[i + 1]!, doubles[i + 2]!]), i);
  }
  const normals = normalsOf(positions, faces);
  send({ kind: "shape", frame, vertices: doubles, positions, normals, faces }, []);
  sendTree(positions);
}

function sendTree(positions: Float32Array): void {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setIndex(new BufferAttribute(faces, 1));
  // An indirect tree leaves the faces, and so their numbers, in order.
  const tree = MeshBVH.serialize(new MeshBVH(geometry, { indirect: true }), {
    cloneBuffers: false,
  });
  send({ kind: "tree", roots: tree.roots as ArrayBuffer[], order: tree.indirectBuffer! });
}

/** Return area-weighted normals at vertices, pointing outwards on the whole whatever the winding. */
function normalsOf(p: Float32Array, corners: Uint32Array): Float32Array<ArrayBuffer> {
  const normals = new Float32Array(p.length);
  for (let f = 0; f < corners.length; f += 3) {
    const [a, b, c] = [3 * corners[f]!, 3 * corners[f + 1]!, 3 * corners[f + 2]!];
    const [ux, uy, uz] = [p[b]! - p[a]!, p[b + 1]! - p[a + 1]!, p[b + 2]! - p[a + 2]!];
    const [vx, vy, vz] = [p[c]! - p[a]!, p[c + 1]! - p[a + 1]!, p[c + 2]! - p[a + 2]!];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const corner of [a, b, c]) {
      normals[corner]! += nx;
      normals[corner + 1]! += ny;
      normals[corner + 2]! += nz;
    }
  }
  const outwards = normals.reduce((sum, x, i) => sum + x * p[i]!, 0) < 0 ? -1 : 1;
  for (let i = 0; i < normals.length; i += 3) {
    const length = outwards * Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!) || 1;
    normals[i]! /= length;
    normals[i + 1]! /= length;
    normals[i + 2]! /= length;
  }
  return normals;
}

/** Send each edge once, as pairs of vertices. */
function sendEdges(): void {
  const keys = new Float64Array(faces.length);
  for (let i = 0; i < faces.length; i++) {
    const [a, b] = [faces[i]!, faces[i % 3 === 2 ? i - 2 : i + 1]!];
    keys[i] = Math.min(a, b) * 2 ** 26 + Math.max(a, b);
  }
  keys.sort();
  const edges = new Uint32Array(2 * keys.length);
  let count = 0;
  for (let i = 0; i < keys.length; i++) {
    if (i > 0 && keys[i] === keys[i - 1]) continue;
    edges[count++] = Math.floor(keys[i]! / 2 ** 26);
    edges[count++] = keys[i]! % 2 ** 26;
  }
  send({ kind: "edges", edges: edges.slice(0, count) });
}

function send(answer: LoaderResponse, transfer: Transferable[] = []): void {
  self.postMessage(answer, { transfer });
}
