// The straight line from the first source in a direction, which follows the pointer.
import type { StraightLine } from "geodesic-client";
import { written } from "../dom";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { startsOf } from "../state/places";
import type { Point } from "../state/point";
import { type State, unitOf } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { LatestOnly } from "./latestOnly";

interface WalkRequest {
  mesh: string;
  start: Point;
  direction: [number, number, number];
  barriers: number[];
}

const ENDS: Record<StraightLine["stopped"], string> = {
  length: "as long as it was drawn",
  boundary: "up to the boundary",
  barrier: "up to a barrier",
  vertex: "up to a vertex",
  non_manifold: "up to where more than two faces meet",
  collapsed: "up to faces without area",
};

export class Walks {
  private requested = "";
  private request: WalkRequest | null = null;
  line: StraightLine | null = null;
  private unit = "";
  private readonly latestOnly: LatestOnly<WalkRequest>;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly notes: Notes,
  ) {
    this.latestOnly = new LatestOnly<WalkRequest>(
      (request, stop) =>
        status.during("busy", "Walking straight…", stop, () => this.answer(request, stop.signal)),
      (error) => {
        this.requested = "";
        this.show(null);
        status.fail(error);
      },
    );
  }

  /** Request the line that ``state`` asks for. */
  follow(state: State): void {
    const { mesh, walk, isReadable } = state;
    const barriers = blockedFaces(state);
    this.unit = unitOf(state);
    const [start] = startsOf(state);
    const requested = JSON.stringify([mesh, start, walk, barriers, isReadable]);
    if (requested === this.requested) return;
    this.requested = requested;
    this.request =
      mesh && start && walk && isReadable ? { mesh, start, direction: walk, barriers } : null;
    if (this.request) {
      this.latestOnly.ask(this.request);
    } else {
      this.latestOnly.cancel();
      this.show(null);
    }
  }

  /** Draw the line that was found; a mesh that was just loaded shows none yet. */
  draw(): void {
    this.sceneView.showWalk(this.line);
  }

  private async answer(request: WalkRequest, signal: AbortSignal): Promise<void> {
    const { mesh, start, direction, barriers } = request;
    const length = Math.hypot(...direction);
    const call = { barriers, signal };
    const { lines } = await service.trace(mesh, [start], [direction], [length], call);
    if (this.request?.mesh === mesh) this.show(lines[0] ?? null);
  }

  private show(line: StraightLine | null): void {
    this.line = line;
    this.draw();
    const words =
      line && `Straight on: ${written(line.length, 6)} ${this.unit}, ${ENDS[line.stopped]}.`;
    this.notes.tell("walk", words ? [words] : []);
  }
}
