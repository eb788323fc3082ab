// Distances to all vertices: requested when sources, method or limits change, then painted.
import type { Field, Question } from "../api/queries";
import { askDistances, askTerritories } from "../api/queries";
import type { Method } from "../api/types";
import { byId, duration, written } from "../dom";
import { writePoint } from "../state/point";
import type { State } from "../state/state";
import type { Status } from "../status";
import { hideLegend, showScale, showTerritories } from "../view/legend";
import type { SceneView } from "../view/sceneView";
import type { Surface } from "../view/surface";

/** Answers for one set of sources, barriers and limit. */
interface Answers {
  key: string;
  exact?: Field;
  approximate?: Field;
  /** The error allowed in ``approximate``. */
  error?: number;
  nearest?: Int32Array;
}

export class Fields {
  private answers: Answers = { key: "" };
  private requested = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
  ) {}

  /** Return the field that is drawn, or null. */
  of(state: State): Field | null {
    return this.answers[state.method] ?? null;
  }

  /** Request what ``state`` needs and has not been answered yet, and paint it. */
  follow(state: State): void {
    const { mesh, sources, barriers, maxDistance, method, error, shade } = state;
    const requested = JSON.stringify([mesh, sources, barriers, maxDistance, method, error, shade]);
    if (requested === this.requested) return;
    this.requested = requested;
    this.stop.abort();
    const key = JSON.stringify([mesh, sources, barriers, maxDistance]);
    if (key !== this.answers.key) this.answers = { key };
    if (error !== this.answers.error) delete this.answers.approximate;
    if (!mesh || sources.length === 0) this.paint(state);
    else this.request(mesh, state);
  }

  private request(mesh: string, state: State): void {
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("busy", "Computing distances…", stop, async (onProgress) => {
      try {
        await this.fetchMissing(mesh, state, onProgress, stop.signal);
      } catch (failure) {
        // After a failure or an abort, the same request may be made again.
        if (this.stop === stop) this.requested = "";
        throw failure;
      }
      if (!stop.signal.aborted) this.paint(state);
    });
  }

  private async fetchMissing(
    mesh: string,
    state: State,
    onProgress: (share: number) => void,
    signal: AbortSignal,
  ): Promise<void> {
    const { answers } = this;
    const isCompared = state.shade === "difference";
    const methods: Method[] = isCompared ? ["exact", "approximate"] : [state.method];
    for (const method of methods) {
      if (answers[method]) continue;
      answers[method] = await askDistances(mesh, questionOf(state, method), onProgress, signal);
      if (method === "approximate") answers.error = state.error;
    }
    if (state.shade === "territories") {
      answers.nearest ??= await askTerritories(mesh, questionOf(state, state.method), signal);
    }
  }

  /** Paint the answers that are there; a mesh without any stays grey. */
  paint(state: State): void {
    const { surface } = this.sceneView;
    const field = this.of(state);
    this.compare();
    if (!surface) return;
    surface.setTerritories(null);
    if (field) this.paintField(surface, field, state);
    else {
      surface.setValues(null, 1);
      hideLegend();
    }
    this.setIsolines(state);
  }

  private paintField(surface: Surface, field: Field, { shade, sources }: State): void {
    const { exact, approximate, nearest } = this.answers;
    if (shade === "difference" && exact && approximate) {
      const errors = shortfall(exact, approximate);
      const largest = largestOf(errors);
      surface.setValues(errors, largest);
      showScale(`Error, % (promised: ${written(100 * approximate.bound.value, 3)})`, largest);
      return;
    }
    surface.setValues(field.distances, field.largest);
    if (shade === "territories" && nearest) {
      surface.setTerritories(nearest);
      showTerritories(sources.map(writePoint));
    } else showScale("Distance in mesh units", field.largest);
  }

  /** Draw the isolines that ``state`` asks for. */
  setIsolines(state: State): void {
    const field = this.of(state);
    const { surface, stage } = this.sceneView;
    const isDrawn = field !== null && state.shade !== "difference";
    surface?.setIsolines(isDrawn ? spacingOf(state, field.largest) : 0);
    stage.invalidate();
  }

  /** Show time and error of both methods side by side. */
  private compare(): void {
    const { exact, approximate } = this.answers;
    const both = exact && approximate;
    byId("time-exact").textContent = timeOf(exact);
    byId("time-approximate").textContent = timeOf(approximate);
    byId("bound-exact").textContent = exact ? "0" : "–";
    byId("bound-approximate").textContent = approximate ? percent(approximate.bound.value) : "–";
    byId("measured-exact").textContent = both ? "0" : "–";
    byId("measured-approximate").textContent = both
      ? percent(largestOf(shortfall(exact, approximate)) / 100)
      : "–";
  }
}

/** Return the body of a query for distances. */
export function questionOf(state: State, method: Method): Question {
  return {
    sources: state.sources as Question["sources"],
    method,
    ...(method === "approximate" ? { relative_error: state.error } : {}),
    ...(state.maxDistance === null ? {} : { max_distance: state.maxDistance }),
    ...(state.barriers.length > 0 ? { barriers: state.barriers } : {}),
  };
}

/** Return the distance between isolines, by the rule that the service has for its levels. */
function spacingOf({ lines }: State, largest: number): number {
  if (lines === null) return 0;
  return "count" in lines ? largest / (lines.count + 1) : lines.spacing;
}

/** Return by how many per cent each approximate distance is too short; -1 where unreachable. */
function shortfall(exact: Field, approximate: Field): Float64Array {
  return exact.distances.map((distance, i) => {
    if (distance === Infinity) return -1;
    const missing = distance - (approximate.distances[i] ?? Number.NaN);
    return distance > 0 ? Math.max(0, (100 * missing) / distance) : 0;
  });
}

function largestOf(values: Float64Array): number {
  return values.reduce((most, x) => Math.max(most, x), 0);
}

function timeOf(field: Field | undefined): string {
  if (!field) return "–";
  return field.seconds === null ? "cached" : duration(field.seconds);
}

function percent(share: number): string {
  return `${written(100 * share, 3)} %`;
}
