// Distances to all vertices: asked for when sources, method or limits change, and painted.
import type { Field, Question } from "../api/queries";
import { askDistances, askTerritories } from "../api/queries";
import type { Method } from "../api/types";
import { byId, duration, written } from "../dom";
import { writePoint } from "../state/point";
import type { State } from "../state/state";
import type { Status } from "../status";
import { hideLegend, showScale, showTerritories } from "../view/legend";
import type { SceneView } from "../view/sceneView";

/** What is known for the same sources, barriers and limit. */
interface Known {
  key: string;
  exact?: Field;
  approximate?: Field;
  error?: number;
  nearest?: Int32Array;
}

export class Fields {
  private known: Known = { key: "" };
  private asked = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
  ) {}

  /** The field that is drawn, or null. */
  of(state: State): Field | null {
    return this.known[state.method] ?? null;
  }

  /** Ask for what ``state`` needs and nobody has told yet, and paint it. */
  follow(state: State): void {
    const { mesh, sources, barriers, maxDistance, method, error, shade } = state;
    const asked = JSON.stringify([mesh, sources, barriers, maxDistance, method, error, shade]);
    if (asked === this.asked) return;
    this.asked = asked;
    this.stop.abort();
    const key = JSON.stringify([mesh, sources, barriers, maxDistance]);
    if (key !== this.known.key) this.known = { key };
    if (error !== this.known.error) delete this.known.approximate;
    if (!mesh || sources.length === 0) {
      this.paint(state);
      return;
    }
    const stop = (this.stop = new AbortController());
    this.status.run("busy", "Computing distances…", stop, async (onProgress) => {
      // When this fails or is cancelled it may be asked for again.
      try {
        await this.fetchMissing(state, onProgress, stop.signal);
      } catch (failure) {
        if (this.stop === stop) this.asked = "";
        throw failure;
      }
      if (!stop.signal.aborted) this.paint(state);
    });
  }

  /** Paint what is known; a mesh that was just loaded has no colours yet. */
  paint(state: State): void {
    const { surface } = this.sceneView;
    const { exact, approximate, nearest } = this.known;
    const field = this.of(state);
    this.compare();
    if (!surface) return;
    surface.divide(null);
    if (!field) {
      surface.colour(null, 1);
      hideLegend();
    } else if (state.shade === "difference" && exact && approximate) {
      const share = shortfall(exact, approximate);
      const largest = share.reduce((most, x) => Math.max(most, x), 0);
      surface.colour(share, largest);
      showScale(`Short by, % (promised: ${written(100 * approximate.bound.value, 3)})`, largest);
    } else {
      surface.colour(field.distances, field.largest);
      if (state.shade === "territories" && nearest) {
        surface.divide(nearest);
        showTerritories(state.sources.map(writePoint));
      } else showScale("Distance in mesh units", field.largest);
    }
    this.setIsolines(state);
  }

  /** Draw isolines as ``state`` has them. */
  setIsolines(state: State): void {
    const field = this.of(state);
    const { surface, stage } = this.sceneView;
    surface?.setIsolines(
      field && state.shade !== "difference" ? spacingOf(state, field.largest) : 0,
    );
    stage.invalidate();
  }

  private async fetchMissing(
    state: State,
    onProgress: (share: number) => void,
    signal: AbortSignal,
  ): Promise<void> {
    const { known } = this;
    const methods: Method[] =
      state.shade === "difference" ? ["exact", "approximate"] : [state.method];
    for (const method of methods) {
      if (known[method]) continue;
      known[method] = await askDistances(
        state.mesh!,
        questionOf(state, method),
        onProgress,
        signal,
      );
      if (method === "approximate") known.error = state.error;
    }
    if (state.shade === "territories") {
      known.nearest ??= await askTerritories(state.mesh!, questionOf(state, state.method), signal);
    }
  }

  /** Show time and error of both methods side by side. */
  private compare(): void {
    const { exact, approximate } = this.known;
    const time = (field?: Field): string =>
      !field ? "–" : field.seconds === null ? "kept" : duration(field.seconds);
    byId("time-exact").textContent = time(exact);
    byId("time-approximate").textContent = time(approximate);
    byId("bound-exact").textContent = exact ? "0" : "–";
    byId("bound-approximate").textContent = approximate ? percent(approximate.bound.value) : "–";
    const both = exact && approximate;
    byId("measured-exact").textContent = both ? "0" : "–";
    byId("measured-approximate").textContent = both
      ? percent(shortfall(exact, approximate).reduce((most, x) => Math.max(most, x), 0) / 100)
      : "–";
  }
}

export function questionOf(state: State, method: Method): Question {
  return {
    sources: state.sources as Question["sources"],
    method,
    ...(method === "approximate" ? { relative_error: state.error } : {}),
    ...(state.maxDistance === null ? {} : { max_distance: state.maxDistance }),
    ...(state.barriers.length > 0 ? { barriers: state.barriers } : {}),
  };
}

/** Return how far apart isolines are: as the service spaces its levels. */
function spacingOf({ lines }: State, largest: number): number {
  if (lines === null) return 0;
  return "count" in lines ? largest / (lines.count + 1) : lines.spacing;
}

/** Return by how many per cent each approximate distance is too short; -1 where there is none. */
function shortfall(exact: Field, approximate: Field): Float64Array {
  return exact.distances.map((distance, i) => {
    if (distance === Infinity) return -1;
    return distance > 0
      ? Math.max(0, (100 * (distance - approximate.distances[i]!)) / distance)
      : 0;
  });
}

export function percent(share: number): string {
  return `${written(100 * share, 3)} %`;
}
