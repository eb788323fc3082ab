// A mesh of the store in the page: its arrays, and in a worker what takes long to make of them.
import { BufferAttribute, BufferGeometry } from "three";
import { MeshBVH } from "three-mesh-bvh";
import { authorization } from "../api/http";
import { ProblemError } from "../api/problemError";
import type { MeshDocument } from "../api/types";

type Triple = [number, number, number];

/** How the mesh is drawn: moved to the origin, and scaled into the unit ball. */
export interface Frame {
  centre: Triple;
  radius: number;
}

export type LoaderQuestion =
  | { ask: "mesh"; vertices: string; faces: string; headers: Record<string, string> }
  | { ask: "edges" };

export type LoaderAnswer =
  | {
      tell: "shape";
      frame: Frame;
      vertices: Float64Array;
      positions: Float32Array<ArrayBuffer>;
      normals: Float32Array<ArrayBuffer>;
      faces: Uint32Array<ArrayBuffer>;
    }
  | { tell: "tree"; roots: ArrayBuffer[]; order: Uint32Array | Uint16Array }
  | { tell: "edges"; edges: Uint32Array<ArrayBuffer> }
  | { tell: "problem"; problem: ProblemError["problem"] }
  | { tell: "failure"; message: string };

type Told<K> = Extract<LoaderAnswer, { tell: K }>;

/** A mesh as it is drawn and picked. */
export class LoadedMesh {
  readonly geometry = new BufferGeometry();
  /** Settled when points can be picked. */
  readonly tree: Promise<MeshBVH>;
  private edges: Promise<Uint32Array<ArrayBuffer>> | undefined;

  constructor(
    readonly document: MeshDocument,
    private readonly shape: Told<"shape">,
    private readonly worker: Answering,
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

  corners(face: number): Triple {
    const { faces } = this.shape;
    return [faces[3 * face]!, faces[3 * face + 1]!, faces[3 * face + 2]!];
  }

  /** Where a vertex is, in mesh units. */
  vertex(index: number): Triple {
    const { vertices } = this.shape;
    return [vertices[3 * index]!, vertices[3 * index + 1]!, vertices[3 * index + 2]!];
  }

  /** Return a position as it is drawn. */
  drawn(position: readonly number[]): Triple {
    const { centre, radius } = this.frame;
    return position.map((x, i) => (x - centre[i]!) / radius) as Triple;
  }

  /** Return the vertices of all edges, in pairs. */
  allEdges(): Promise<Uint32Array<ArrayBuffer>> {
    this.edges ??= this.worker.ask({ ask: "edges" }, "edges").then(({ edges }) => edges);
    return this.edges;
  }

  dispose(): void {
    this.geometry.dispose();
    this.worker.end();
  }
}

export async function loadMesh(document: MeshDocument, signal: AbortSignal): Promise<LoadedMesh> {
  const worker = new Answering();
  signal.addEventListener("abort", () => worker.end());
  const { vertices, faces } = document.arrays as Record<string, string>;
  const question = {
    ask: "mesh" as const,
    vertices: vertices!,
    faces: faces!,
    headers: authorization(),
  };
  const shape = await worker.ask(question, "shape");
  signal.throwIfAborted();
  return new LoadedMesh(document, shape, worker);
}

/** The worker, whose answers are awaited by name. */
class Answering {
  private readonly worker = new Worker(new URL("./loader.worker.ts", import.meta.url), {
    type: "module",
  });

  ask<K extends LoaderAnswer["tell"]>(question: LoaderQuestion, tell: K): Promise<Told<K>> {
    const answer = this.next(tell);
    this.worker.postMessage(question);
    return answer;
  }

  next<K extends LoaderAnswer["tell"]>(tell: K): Promise<Told<K>> {
    return new Promise((resolve, reject) => {
      const listen = ({ data }: MessageEvent<LoaderAnswer>): void => {
        if (![tell, "problem", "failure"].includes(data.tell)) return;
        this.worker.removeEventListener("message", listen as EventListener);
        if (data.tell === "problem") reject(new ProblemError(data.problem));
        else if (data.tell === "failure") reject(new Error(data.message));
        else resolve(data as Told<K>);
      };
      this.worker.addEventListener("message", listen as EventListener);
    });
  }

  end(): void {
    this.worker.terminate();
  }
}
