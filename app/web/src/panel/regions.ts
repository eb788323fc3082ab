// Points spread over the surface, as starts of their own territories.
import { byId, count, written } from "../dom";
import { InputError } from "../inputError";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { startsOf } from "../state/places";
import { pointOf } from "../state/point";
import { type Store, unitOf } from "../state/state";
import type { Status } from "../status";
import type { Notes } from "./notes";

/** More starts than this are hard to tell apart, and make a long address. */
const MOST = 300;

export class Regions {
  constructor(
    private readonly store: Store,
    private readonly status: Status,
    private readonly notes: Notes,
  ) {
    const [kind, value] = [
      byId("spread-kind", HTMLSelectElement),
      byId("spread-value", HTMLInputElement),
    ];
    kind.addEventListener("change", () => {
      value.value = kind.value === "count" ? "12" : "";
    });
    byId("spread").addEventListener("submit", (event) => {
      event.preventDefault();
      this.spread(kind.value, value.valueAsNumber);
    });
  }

  /** Add points to the starts, each the farthest from those before. Other places are dropped. */
  private spread(kind: string, value: number): void {
    const { state } = this.store;
    const { mesh } = state;
    if (mesh === null) return;
    const stop = new AbortController();
    this.status.run("busy", "Spreading points…", stop, async (onProgress) => {
      const starts = state.distances ? startsOf(state) : [];
      const wanted = kind === "count" ? { count: Math.round(value) } : { radius: value };
      if (!(value > 0) || (wanted.count ?? 0) > MOST) throw wrongNumber(kind);
      const { points, covering_radius, warnings } = await service.samples(mesh, {
        ...{ starts, barriers: blockedFaces(state), ...wanted },
        onProgress,
        signal: stop.signal,
      });
      if (points.length > MOST) throw tooMany(points.length);
      stop.signal.throwIfAborted();
      const names = state.places.slice(0, starts.length).map(({ name }) => name);
      const places = points.map((point, i) => ({ point: pointOf(point), name: names[i] ?? "" }));
      this.store.update({ places, starts: places.length, distances: true, shade: "territories" });
      const near =
        covering_radius == null
          ? "not all of the surface can be reached from them"
          : `each vertex is within ${written(covering_radius, 4)} ${unitOf(state)} of one`;
      this.notes.tell("points", [`${count(points.length, "point")}: ${near}.`, ...warnings]);
    });
  }
}

function wrongNumber(kind: string): InputError {
  return kind === "count"
    ? new InputError(
        "Not a number of points",
        "Points are counted from 1.",
        `Up to ${MOST} are drawn.`,
      )
    : new InputError("Not a radius", "A radius is a length above 0.", "Write it in mesh units.");
}

function tooMany(points: number): InputError {
  return new InputError(
    "Too many points",
    `That radius takes ${count(points, "point")}; up to ${MOST} are drawn.`,
    "Choose a larger radius.",
  );
}
