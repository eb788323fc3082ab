// A mesh of the store in the page. A worker fetches its arrays and derives what takes long.

import type { MeshDocument } from "geodesic-client";
import { ProblemError } from "geodesic-client";
import { BufferAttribute, BufferGeometry } from "three";
import { MeshBVH } from "three-mesh-bvh";
import { InputError } from "../inputError";
import { service } from "../service";
import type { Point } from "../state/point";
import { drawnIn, type Frame, type Up } from "./frame";
import type { Plane } from "./plane";

type Triple = [number, number, number];

export type LoaderRequest =
  | {
      kind: "mesh";
      id: string;
      address: string;
      apiKey: string | null;
      up: Up | null;
    }
  | { kind: "edges" };

export type LoaderResponse =
  | {
      kind: "shape";
      frame: Frame;
      vertices: Float64Array;
      positions: Float32Array<ArrayBuffer>;
      normals: Float32Array<ArrayBuffer>;
      faces: Uint32Array<ArrayBuffer>;
    }
  | { kind: "tree"; roots: ArrayBuffer[]; order: Uint32Array | Uint16Array }
  | { kind: "edges"; edges: Uint32Array<ArrayBuffer> }
  | { kind: "problem"; problem: ProblemError["document"] }
  | { kind: "failure"; message: string };

type ResponseOf<K> = Extract<LoaderResponse, { kind: K }>;

/** More colours than this tell no piece from another. */
const MOST_PIECES = 100;

/** A mesh to draw and to pick points of. */
export class LoadedMesh {
  readonly geometry = new BufferGeometry();
  /** The tree for picking, which the worker builds last. */
  readonly tree: Promise<MeshBVH>;
  /** Where the surface is unrolled; null: it is as it is in space. */
  plane: Plane | null = null;
  private edges: Promise<Uint32Array<ArrayBuffer>> | undefined;

  constructor(
    readonly document: MeshDocument,
    /** The connected piece of each vertex; null where they have no colours. */
    readonly pieces: Int32Array | null,
    private readonly shape: ResponseOf<"shape">,
    private readonly worker: LoaderWorker,
  ) {
    this.geometry.setAttribute("position", new BufferAttribute(shape.positions, 3));
    this.geometry.setAttribute("normal", new BufferAttribute(shape.normals, 3));
    this.geometry.setIndex(new BufferAttribute(shape.faces, 1));
    this.tree = worker
      .next("tree")
      .then(({ roots, order }) =>
        MeshBVH.deserialize(
          { version: 1, roots, index: null, indirectBuffer: order } as never,
          this.geometry,
          { setIndex: false },
        ),
      );
  }

  get frame(): Frame {
    return this.shape.frame;
  }

  /** Whether the vertex, the edge's ends or the face of a point are among those of the mesh. */
  has(point: Point): boolean {
    const { vertices, faces } = this.document;
    if ("face" in point) return point.face < faces;
    return ("edge" in point ? point.edge : [point.vertex]).every((vertex) => vertex < vertices);
  }

  corners(face: number): Triple {
    const { faces } = this.shape;
    return [faces[3 * face]!, faces[3 * face + 1]!, faces[3 * face + 2]!];
  }

  /** Positions of the vertices, in mesh units. */
  get vertices(): Float64Array {
    return this.shape.vertices;
  }

  /** Return the position of a vertex, in mesh units. */
  vertex(index: number): Triple {
    const { vertices } = this.shape;
    return [vertices[3 * index]!, vertices[3 * index + 1]!, vertices[3 * index + 2]!];
  }

  /** Return the drawn position of one in mesh units. */
  drawn(position: readonly number[]): Triple {
    return drawnIn(this.frame, position);
  }

  /** The geometry that is drawn: of the surface, or of its plane. */
  get shown(): BufferGeometry {
    return this.plane?.geometry ?? this.geometry;
  }

  /** Return where a vertex is drawn. */
  drawnVertex(index: number): Triple {
    return this.plane?.vertex(index) ?? this.drawn(this.vertex(index));
  }

  /** Return the polylines that draw one on the surface; ``faces`` has the face of each segment. */
  drawnLines(
    points: readonly (readonly number[])[],
    faces: readonly number[],
    isClosed = false,
  ): Triple[][] {
    const [first] = points;
    const line = isClosed && first ? [...points, first] : points;
    return this.plane?.lines(line, faces) ?? [line.map((point) => this.drawn(point))];
  }

  /** Return the vertices of all edges, in pairs. */
  allEdges(): Promise<Uint32Array<ArrayBuffer>> {
    this.edges ??= this.worker.ask({ kind: "edges" }, "edges").then(({ edges }) => edges);
    return this.edges;
  }

  dispose(): void {
    this.geometry.dispose();
    this.plane?.geometry.dispose();
    this.worker.end();
  }
}

export async function loadMesh(
  document: MeshDocument,
  up: Up | null,
  signal: AbortSignal,
): Promise<LoadedMesh> {
  if (!("vertices" in document.arrays)) {
    throw new InputError(
      "This mesh cannot be drawn",
      "It is given by the lengths of its edges, and has no positions in space.",
      "Upload it with vertices, or ask the service or the command line about it.",
    );
  }
  const worker = new LoaderWorker();
  signal.addEventListener("abort", () => worker.end());
  const { address, apiKey } = service;
  const [shape, pieces] = await Promise.all([
    worker.ask({ kind: "mesh", id: document.id, address, apiKey, up }, "shape"),
    document.components > 1 && document.components <= MOST_PIECES
      ? service.array(document.id, "components", { signal })
      : null,
  ]);
  signal.throwIfAborted();
  return new LoadedMesh(document, pieces?.data ?? null, shape, worker);
}

/** The worker, with a promise for each kind of response. */
class LoaderWorker {
  private readonly worker = new Worker(new URL("./loader.worker.ts", import.meta.url), {
    type: "module",
  });

  ask<K extends LoaderResponse["kind"]>(question: LoaderRequest, kind: K): Promise<ResponseOf<K>> {
    const answer = this.next(kind);
    this.worker.postMessage(question);
    return answer;
  }

  next<K extends LoaderResponse["kind"]>(kind: K): Promise<ResponseOf<K>> {
    return new Promise((resolve, reject) => {
      const listen = ({ data }: MessageEvent<LoaderResponse>): void => {
        if (![kind, "problem", "failure"].includes(data.kind)) return;
        this.worker.removeEventListener("message", listen as EventListener);
        if (data.kind === "problem") reject(new ProblemError(data.problem));
        else if (data.kind === "failure") reject(new Error(data.message));
        else resolve(data as ResponseOf<K>);
      };
      this.worker.addEventListener("message", listen as EventListener);
    });
  }

  end(): void {
    this.worker.terminate();
  }
}
