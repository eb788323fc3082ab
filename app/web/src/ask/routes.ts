// The path to the target, which follows the pointer: fast at first, and the shortest once the
// pointer rests. And the steps of its search.
import type { PathAnswer, Step, SurfaceCost } from "geodesic-client";
import { byId, count, written } from "../dom";
import { InputError } from "../inputError";
import { differences } from "../mesh/frame";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { endOf, nameOf, startsOf, stopsOf } from "../state/places";
import { type Point, pointOf, writePoint } from "../state/point";
import { type State, unitOf } from "../state/state";
import { PATIENCE_MS, type Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { costKey, costOf, measureOf } from "./costs";
import { boundInWords } from "./fields";
import { LatestOnly } from "./latestOnly";

export interface RouteQuestion {
  sources: Point[];
  target: Point;
  waypoints: Point[];
  barriers: number[];
}

type RouteRequest = RouteQuestion & { mesh: string; cost: SurfaceCost | null };

const WORDS: Record<Step["name"], string> = {
  dijkstra: "A path along edges: a first bound",
  shorten: "The same path, shortened across faces",
  approximate: "An approximate sweep within that bound",
  backtrace: "The path of that sweep: a tighter bound",
  exact: "The exact sweep, within all bounds",
  path: "The shortest path, traced back",
};

export class Routes {
  outline: PathAnswer | null = null;
  /** Called when another path, or none, is drawn. */
  onDraw: (outline: PathAnswer | null) => void = () => undefined;
  private requested = "";
  private unit = "";
  private measure = "";
  private names: string[] = [];
  private steps: Step[] = [];
  private request: RouteRequest | null = null;
  private clearing = 0;
  private readonly latestOnly: LatestOnly<RouteRequest>;

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
    private readonly notes: Notes,
  ) {
    this.latestOnly = new LatestOnly<RouteRequest>(
      (request, stop) =>
        status.during("busy", "Searching for the path…", stop, () =>
          this.answer(request, stop.signal),
        ),
      (error) => {
        this.clear();
        status.fail(error);
      },
    );
    byId("explain-start").addEventListener("click", () => this.explain());
    byId("explain-stop").addEventListener("click", () => this.endSteps());
    byId("step").addEventListener("input", () => this.showStep());
  }

  /** Request the path that ``state`` asks for. */
  follow(state: State): void {
    const { mesh, isReadable } = state;
    const barriers = blockedFaces(state);
    const [sources, target, waypoints] = [startsOf(state), endOf(state), stopsOf(state)];
    this.unit = unitOf(state);
    this.measure = measureOf(state);
    this.names = state.places.map((_, i) => nameOf(state, i)).slice(state.starts - 1);
    if (state.starts > 1) this.names[0] = "nearest start";
    this.note();
    const cost = costOf(state);
    const asked = [mesh, sources, target, waypoints, barriers, isReadable];
    const requested = JSON.stringify([...asked, cost && costKey(state), cost?.max_cost]);
    if (requested === this.requested) return;
    this.requested = requested;
    this.endSteps();
    const hasPath = mesh !== null && target !== null && isReadable;
    this.request = hasPath ? { mesh, sources, target, waypoints, barriers, cost } : null;
    byId("explain-start", HTMLButtonElement).disabled = !hasPath || cost !== null;
    if (this.request) {
      this.latestOnly.ask(this.request);
      this.clearSoon();
    } else {
      this.latestOnly.cancel();
      this.clear();
    }
  }

  /** Let the path before remain for a moment only. */
  private clearSoon(): void {
    this.clearing ||= setTimeout(() => this.clear(), PATIENCE_MS);
  }

  private clear(): void {
    clearTimeout(this.clearing);
    this.clearing = 0;
    this.outline = null;
    byId("readout").hidden = true;
    this.notes.tell("path", []);
    this.draw();
  }

  /** The start of the path that was found. */
  get source(): Point | null {
    return this.outline && pointOf(this.outline.source);
  }

  /** Draw the path that was found; a mesh that was just loaded shows none yet. */
  draw(): void {
    this.sceneView.showRoute(this.outline);
    this.onDraw(this.outline);
  }

  private async answer(request: RouteRequest, signal: AbortSignal): Promise<void> {
    const { mesh, cost, ...question } = request;
    try {
      if (cost) {
        this.show(await cheapest(mesh, question, cost, signal), request);
        return;
      }
      const rests = () => this.latestOnly.rests();
      for await (const outline of askRoute(mesh, question, signal, rests)) {
        this.show(outline, request);
      }
    } catch (failure) {
      // After a failure or an abort, the same request may be made again.
      if (request === this.request) this.requested = "";
      throw failure;
    }
  }

  private show(outline: PathAnswer, request: RouteRequest): void {
    if (!this.request || !isPulled(request, this.request)) return;
    clearTimeout(this.clearing);
    this.clearing = 0;
    if (request !== this.request) this.clearSoon(); // a point has been pulled on meanwhile
    this.outline = outline;
    this.draw();
    this.notes.tell("path", outline.warnings);
    const readout = byId("readout");
    readout.hidden = false;
    readout.dataset.target = writePoint(request.target);
    const shown = outline.cost ?? outline.length;
    byId("length").textContent = shown == null ? "No path" : written(shown, 6);
    this.note();
  }

  private note(): void {
    const { outline, unit } = this;
    if (!outline) return;
    const isExact = outline.method === "exact";
    const error = boundInWords(outline.error_bound);
    const words =
      outline.cost == null
        ? `${unit}, ${isExact ? "exact" : `rough: ${error}`}; ${written(straight(outline), 6)} straight`
        : `${this.measure}, ${isExact ? "exact" : error}; ${written(outline.length ?? 0, 6)} ${unit} long`;
    byId("length-note").textContent = outline.length == null ? reason(outline) : words;
    byId("length-names").textContent = this.names.join(" → ");
  }

  private explain(): void {
    const { request } = this;
    if (!request) return;
    const { mesh, cost: _, ...question } = request;
    const stop = new AbortController();
    this.status.run("busy", "Searching step by step…", stop, async () => {
      const { target, waypoints, barriers } = question;
      const source = await nearestSource(mesh, question, stop.signal);
      const call = { waypoints, barriers, signal: stop.signal };
      const { steps } = await service.pathSteps(mesh, source, target, call);
      if (request !== this.request) return;
      this.steps = steps;
      byId("explain-start").hidden = true;
      byId("steps").hidden = false;
      const slider = byId("step", HTMLInputElement);
      slider.max = String(this.steps.length - 1);
      slider.value = "0";
      this.showStep();
      slider.focus();
    });
  }

  private showStep(): void {
    const number = byId("step", HTMLInputElement).valueAsNumber;
    const step = this.steps[number];
    if (!step) return;
    // A step without faces of its own works in the region of the step before.
    const region = this.steps.slice(0, number + 1).findLast(({ faces }) => faces.length > 0);
    this.sceneView.region.show(this.sceneView.mesh, region?.faces ?? []);
    const legs = (this.steps.at(-1)?.leg ?? 0) + 1;
    const leg = legs > 1 ? ` of leg ${step.leg + 1}` : "";
    byId("step-words").textContent =
      `${number + 1} of ${this.steps.length}${leg}. ${WORDS[step.name]}. ` +
      `Length at most ${written(step.bound, 6)}; ${count(step.faces.length, "face")}, ` +
      `${count(step.windows, "window")}.`;
  }

  private endSteps(): void {
    if (byId("steps").hidden) return;
    byId("steps").hidden = true;
    byId("explain-start").hidden = false;
    this.sceneView.region.show(null, []);
  }
}

/** Return how far the ends of a path are apart in space. */
function straight({ points }: PathAnswer): number {
  const [first, last] = [points?.at(0), points?.at(-1)];
  return first && last ? Math.hypot(...differences(last, first)) : 0;
}

/** Return the cheapest path from the source from where it is cheapest. */
async function cheapest(
  mesh: string,
  { sources, target, waypoints, barriers }: RouteQuestion,
  cost: SurfaceCost,
  signal: AbortSignal,
): Promise<PathAnswer> {
  if (waypoints.length > 0) {
    throw new InputError(
      "No stops on the cheapest path",
      "The service finds cheapest paths from one point to another only.",
      "Remove the stops, or the cost.",
    );
  }
  const call = { barriers, cost, signal };
  const found = await Promise.all(
    sources.map((source) => service.path(mesh, source, target, call)),
  );
  const costFrom = ({ cost: each }: PathAnswer): number => each ?? Infinity;
  return found.reduce((best, each) => (costFrom(each) < costFrom(best) ? each : best));
}

/**
 * Yield a fast path, then the shortest once the question rests; of several sources, both start at
 * the nearest.
 */
export async function* askRoute(
  mesh: string,
  question: RouteQuestion,
  signal: AbortSignal,
  rests: () => Promise<boolean>,
): AsyncGenerator<PathAnswer> {
  const { target, waypoints, barriers } = question;
  const source = await nearestSource(mesh, question, signal);
  for (const method of ["fast", "exact"] as const) {
    if (method === "exact" && !(await rests())) return;
    yield await service.path(mesh, source, target, { waypoints, barriers, method, signal });
  }
}

/** Return the source that is nearest to where a path goes first; the first where none has a way. */
async function nearestSource(
  mesh: string,
  { sources, target, waypoints, barriers }: RouteQuestion,
  signal: AbortSignal,
): Promise<Point> {
  let nearest = 0;
  if (sources.length > 1) {
    const { nearest_source } = await service.distances(mesh, sources, {
      targets: [waypoints[0] ?? target],
      barriers,
      include: ["nearest_source"],
      signal,
    });
    nearest = Math.max(0, nearest_source?.[0] ?? 0);
  }
  return sources[nearest] as Point;
}

/** Whether two requests differ by the points of the path after its start at most. */
function isPulled(before: RouteRequest, now: RouteRequest): boolean {
  const fixed = ({ mesh, sources, barriers }: RouteRequest): string =>
    JSON.stringify([mesh, sources, barriers]);
  return fixed(before) === fixed(now) && (before.cost === null) === (now.cost === null);
}

function reason({ reason: code }: PathAnswer): string {
  if (code === "disconnected") return "start and end are not connected";
  return code === "beyond_max_cost"
    ? "the end costs more than the limit"
    : "the end is farther than the distance limit";
}
