// The rays of a polar grid: straight lines from each source, as far as they are shortest paths.
import type { StraightLine } from "geodesic-client";
import { differences } from "../mesh/frame";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { startsOf } from "../state/places";
import { type Point, pointOf } from "../state/point";
import type { State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { hasCost } from "./costs";
import { Drawing } from "./drawing";
import { type Fields, questionOf } from "./fields";

/** Rays from each source. */
const RAYS = 24;
/** Points of a ray whose distances are asked for at once. */
const PROBES = 16;
/** A share of the largest distance by which a shortest path may seem longer. */
const ROUNDING = 1e-9;

export class Rays {
  private readonly drawing: Drawing;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
    notes: Notes,
  ) {
    this.drawing = new Drawing(status, notes, "rays", () => sceneView.showRays([]));
  }

  /** Request the rays that `state` needs and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, polar } = state;
    const barriers = blockedFaces(state);
    const sources = startsOf(state);
    const largest = this.fields.of(state)?.largest ?? 0;
    if (!mesh || !polar || hasCost(state) || largest === 0 || !this.sceneView.surface) {
      this.drawing.clear();
      return;
    }
    const question = questionOf(state, "exact");
    this.drawing.follow(JSON.stringify([mesh, question]), async (_onProgress, signal) => {
      const around = await Promise.all(
        sources.map((source) => service.logMap(mesh, source, { barriers, maxDistance: 0, signal })),
      );
      const { lines: traced } = await service.trace(
        mesh,
        sources.flatMap((source) => Array<Point>(RAYS).fill(source)),
        around.flatMap(({ total_angle }) => evenly(total_angle)),
        [largest],
        { barriers, signal },
      );
      const counts = await shortestParts(traced, ROUNDING * largest, async (targets) => {
        const { distances } = await service.distances(mesh, sources, {
          ...question,
          targets,
          signal,
        });
        return distances;
      });
      return () =>
        this.sceneView.showRays(
          traced.map(({ points, faces }, i) => ({
            points: points?.slice(0, counts[i]) ?? [],
            faces,
          })),
        );
    });
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}

function evenly(total: number): number[] {
  return Array.from({ length: RAYS }, (_, i) => ((i + 0.5) / RAYS) * total);
}

/** A point of a line: where it is, and how long the line is up to there. */
interface Passed {
  point: Point;
  length: number;
}

/** A line of which all points before one are known to be reached by it as a shortest path. */
interface Part {
  passed: Passed[];
  known: number;
  /** The first point that is known not to be reached so. */
  beyond: number;
}

/**
 * Return for each line how many of its points it reaches as a shortest path.
 *
 * A line that is not the shortest way to a point is not to any later one either, so that few points
 * of each tell: some between those known on both sides, again and again.
 */
export async function shortestParts(
  lines: Pick<StraightLine, "points" | "locations">[],
  tolerance: number,
  askDistances: (points: Point[]) => Promise<ArrayLike<number>>,
): Promise<number[]> {
  const parts = lines.map((line): Part => {
    const passed = passedBy(line);
    return { passed, known: 1, beyond: passed.length };
  });
  for (;;) {
    const probes = parts.flatMap((part) => between(part).map((at) => ({ part, ...at })));
    if (probes.length === 0) return parts.map(({ known }) => known);
    const distances = await askDistances(probes.map(({ point }) => point));
    probes.forEach(({ part, number, length }, i) => {
      const isShortest = length <= (distances[i] ?? Infinity) + tolerance;
      if (!isShortest) part.beyond = Math.min(part.beyond, number);
      else if (number < part.beyond) part.known = number + 1;
    });
  }
}

/** Return some points between those that are known, evenly spaced; none where there is none. */
function between({ passed, known, beyond }: Part): (Passed & { number: number })[] {
  const count = Math.min(PROBES, beyond - known);
  const step = (beyond - known + 1) / (count + 1);
  return Array.from({ length: count }, (_, i) => Math.round(known - 1 + (i + 1) * step)).flatMap(
    (number) => passed.slice(number, number + 1).map((at) => ({ ...at, number })),
  );
}

function passedBy({ points, locations }: Pick<StraightLine, "points" | "locations">): Passed[] {
  let length = 0;
  let before: readonly number[] | undefined;
  return (points ?? []).flatMap((position, i) => {
    length += before ? Math.hypot(...differences(position, before)) : 0;
    before = position;
    return locations.slice(i, i + 1).map((location) => ({ point: pointOf(location), length }));
  });
}
