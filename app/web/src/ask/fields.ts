// Distances to all vertices: requested when sources, method or limits change, then painted.
import type { Field, Proof, Question } from "../api/queries";
import { askDistances, askProof, askTerritories } from "../api/queries";
import type { Certificate, Effort, ErrorBound, Method } from "../api/types";
import { byId, count, duration, written } from "../dom";
import type { LoadedMesh } from "../mesh/loader";
import type { FacePoint } from "../mesh/picking";
import { extremesOf } from "../mesh/values";
import type { Notes } from "../panel/notes";
import { nameOf, startsOf } from "../state/places";
import { type Shade, type State, unitOf, type Values } from "../state/state";
import { PATIENCE_MS, type Status } from "../status";
import { huesOf } from "../view/hues";
import {
  hideLegend,
  showDifference,
  showHere,
  showProof,
  showScale,
  showTerritories,
} from "../view/legend";
import type { SceneView } from "../view/sceneView";
import type { Surface } from "../view/surface";
import { costKey, costOf, hasCost, measureOf } from "./costs";

/** Answers for one set of sources, barriers, limit and cost. Of costs there is one method only. */
interface Answers {
  key: string;
  exact?: Field;
  approximate?: Field;
  fast?: Field;
  /** The error allowed in ``approximate``, and the effort of ``fast``. */
  error?: number;
  effort?: Effort;
  nearest?: Int32Array;
  /** Areas of the territories. */
  areas?: number[];
  proofs: Partial<Record<Method, Proof>>;
}

export class Fields {
  /** Called when the colours have changed. */
  onPaint: (state: State) => void = () => undefined;
  private answers: Answers = { key: "", proofs: {} };
  private requested = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
    private readonly notes: Notes,
  ) {}

  /** Return the field that is drawn, or null. */
  of(state: State): Field | null {
    return isAsked(state) ? (this.answers[methodOf(state)] ?? null) : null;
  }

  /** Return the nearest source of each vertex, where it is drawn; else null. */
  territories(state: State): Int32Array | null {
    return shadeOf(state) === "territories" ? (this.answers.nearest ?? null) : null;
  }

  /** Tell the areas of the territories that are drawn. */
  tellAreas(areas: number[], state: State): void {
    this.answers.areas = areas;
    this.showTerritories(state);
  }

  /** Request what ``state`` needs and has not been answered yet, and paint it. */
  follow(state: State): void {
    const { mesh, barriers, maxDistance, error, effort } = state;
    const sources = isAsked(state) ? startsOf(state) : [];
    const asks = [mesh, sources, barriers, maxDistance, costKey(state)];
    const asked = [...asks, methodOf(state), error, effort, shadeOf(state), versusOf(state)];
    const requested = JSON.stringify(asked);
    if (requested === this.requested) return;
    this.requested = requested;
    this.stop.abort();
    this.stop = new AbortController();
    const key = JSON.stringify(asks);
    if (key !== this.answers.key) this.answers = { key, proofs: {} };
    if (error !== this.answers.error) {
      delete this.answers.approximate;
      delete this.answers.proofs.approximate;
    }
    if (effort !== this.answers.effort) delete this.answers.fast;
    if (!mesh || sources.length === 0) this.paint(state);
    else this.request(mesh, state);
  }

  private request(mesh: string, state: State): void {
    const stop = new AbortController();
    this.stop = stop;
    const isLatest = (): boolean => this.stop === stop;
    // Until the answer is there, the one before remains for a moment only.
    const clearing = setTimeout(() => isLatest() && this.paint(state), PATIENCE_MS);
    this.status.run("busy", "Computing distances…", stop, async (onProgress) => {
      try {
        await this.fetchMissing(mesh, state, onProgress, stop.signal);
      } catch (failure) {
        // After a failure or an abort, the same request may be made again.
        if (isLatest()) this.requested = "";
        throw failure;
      } finally {
        clearTimeout(clearing);
        if (isLatest()) this.paint(state);
      }
    });
  }

  private async fetchMissing(
    mesh: string,
    state: State,
    onProgress: (share: number) => void,
    signal: AbortSignal,
  ): Promise<void> {
    const { answers } = this;
    const shade = shadeOf(state);
    const method = methodOf(state);
    const methods = shade === "difference" ? [method, versusOf(state)] : [method];
    for (const method of methods) {
      if (answers[method]) continue;
      answers[method] = await askDistances(mesh, questionOf(state, method), onProgress, signal);
      if (method === "approximate") answers.error = state.error;
      if (method === "fast") answers.effort = state.effort;
    }
    if (shade === "territories") {
      // Borders are exact in any case.
      answers.nearest ??= await askTerritories(mesh, questionOf(state, "exact"), signal);
    }
    if (shade === "proof" && state.method !== "fast") {
      const question = questionOf(state, state.method);
      answers.proofs[state.method] ??= await askProof(mesh, question, onProgress, signal);
    }
  }

  /** Paint the answers that are there; a mesh without any stays grey. */
  paint(state: State): void {
    const { surface, mesh } = this.sceneView;
    const field = this.of(state);
    this.compare();
    if (!surface || !mesh) return;
    surface.setTerritories(null);
    showProof(null);
    showDifference(null);
    this.notes.tell("distances", field ? notesOn(field, state) : []);
    if (state.values) this.paintValues(surface, state.values, state);
    else if (field) this.paintField(surface, mesh, field, state);
    else {
      surface.setValues(null, 1);
      hideLegend();
    }
    this.onPaint(state);
    this.sceneView.stage.invalidate();
  }

  private paintValues(surface: Surface, { name, numbers }: Values, state: State): void {
    const [low, high] = extremesOf(numbers);
    const [least, largest] = [state.least ?? low, state.range ?? high];
    surface.setValues(numbers, largest, least);
    showScale(name, largest, least);
  }

  private paintField(surface: Surface, mesh: LoadedMesh, field: Field, state: State): void {
    const shade = shadeOf(state);
    const { nearest } = this.answers;
    const method = methodOf(state);
    const other = this.answers[versusOf(state)];
    const proof = this.answers.proofs[method];
    showProof(proof && !hasCost(state) ? proofInWords(proof.certificate) : null);
    if (shade === "proof" && proof) {
      const violations = atVertices(proof.violations, mesh);
      surface.setValues(violations, proof.certificate.worst_violation);
      showScale(`Violation by face, ${unitOf(state)}`, proof.certificate.worst_violation);
      return;
    }
    if (shade === "difference" && other) {
      const { values, largest, mean } = differenceOf(field, other);
      surface.setValues(values, largest);
      showScale(`|${method} − ${versusOf(state)}| in ${unitOf(state)}`, largest);
      const share = mean / (field.largest || 1);
      showDifference(
        `Largest ${written(largest, 3)}, mean ${written(mean, 3)} (${percent(share)} of the largest distance)`,
      );
      return;
    }
    const [least, largest] = [state.least ?? 0, state.range ?? field.largest];
    surface.setValues(field.distances, largest, least);
    if (shade === "territories" && nearest) {
      const hues = huesOf(state.starts, nearest, mesh);
      this.sceneView.hues = hues;
      surface.setTerritories(nearest.map((source) => hues[source] ?? source));
      this.sceneView.showPoints(state);
      this.showTerritories(state);
    } else {
      const what = hasCost(state) ? "Cost" : method === "fast" ? "Rough distance" : "Distance";
      showScale(`${what} in ${measureOf(state)}`, largest, least);
    }
  }

  private showTerritories(state: State): void {
    const { areas } = this.answers;
    const whole = areas?.reduce((sum, area) => sum + area, 0) ?? 0;
    showTerritories(
      Array.from({ length: state.starts }, (_, i) => {
        const area = areas?.[i];
        return {
          name: nameOf(state, i),
          area: area === undefined ? "" : `${written(area, 4)} (${percent(area / whole)})`,
          colour: this.sceneView.colourOf(i),
        };
      }),
      state.unit && ` in ${state.unit}²`,
    );
  }

  /** Tell the distance at a point, interpolated within its face; null: nowhere. */
  tell(point: FacePoint | null, state: State): void {
    const numbers = state.values?.numbers ?? this.of(state)?.distances;
    const mesh = this.sceneView.mesh;
    const isTold = point && numbers && mesh && !["difference", "proof"].includes(shadeOf(state));
    const value = isTold
      ? mesh
          .corners(point.face)
          .reduce((sum, v, i) => sum + (point.barycentric[i] ?? 0) * (numbers[v] ?? NaN), 0)
      : Number.NaN;
    const unit = state.values ? "" : ` ${measureOf(state)}`;
    showHere(Number.isFinite(value) ? `≈ ${written(value, 4)}${unit} here` : null);
  }

  /** Show time and error of all methods side by side. */
  private compare(): void {
    const { exact, approximate, fast } = this.answers;
    byId("time-exact").textContent = timeOf(exact);
    byId("bound-exact").textContent = exact ? "0" : "–";
    byId("measured-exact").textContent = exact && (approximate ?? fast) ? "0" : "–";
    for (const [method, rough] of Object.entries({ approximate, fast })) {
      byId(`time-${method}`).textContent = timeOf(rough);
      byId(`bound-${method}`).textContent = rough ? percent(rough.bound.value) : "–";
      byId(`measured-${method}`).textContent =
        exact && rough ? percent(largestOf(errorsOf(exact, rough)) / 100) : "–";
    }
  }
}

function isAsked({ distances, isReadable, values }: State): boolean {
  return distances && isReadable && !values;
}

/** Return what the surface is coloured by: costs have no other colours than their own. */
export function shadeOf(state: State): Shade {
  return hasCost(state) ? "distance" : state.shade;
}

function methodOf(state: State): Method {
  return hasCost(state) ? "exact" : state.method;
}

/** Return the body of a query for distances, or for costs. */
export function questionOf(state: State, method: Method): Question {
  const cost = costOf(state);
  const sources = startsOf(state) as Question["sources"];
  if (cost) {
    return { sources, cost, ...(state.barriers.length > 0 ? { barriers: state.barriers } : {}) };
  }
  return {
    sources,
    method,
    ...(method === "approximate" ? { relative_error: state.error } : {}),
    ...(method === "fast" ? { effort: state.effort } : {}),
    ...(state.maxDistance === null ? {} : { max_distance: state.maxDistance }),
    ...(state.barriers.length > 0 ? { barriers: state.barriers } : {}),
  };
}

/** Return the method that the one of the question is compared with. */
export function versusOf({ method, versus }: State): Method {
  if (versus !== null && versus !== method) return versus;
  return method === "exact" ? "approximate" : "exact";
}

/** Return what there is to know about a field but its colours. */
function notesOn({ bound, unreachable, warnings }: Field, state: State): string[] {
  const { method, shade } = state;
  const { disconnected, beyond_max_distance } = unreachable;
  const said = (n: number, what: string): string[] =>
    n > 0 ? [`${count(n, "vertex", "vertices")} ${what}`] : [];
  return [
    ...(hasCost(state)
      ? [`Costs: ${boundInWords(bound)}.`]
      : method === "exact"
        ? []
        : [`Distances: ${boundInWords(bound)}.`]),
    ...(shade === "proof" && method === "fast"
      ? ["Fast distances have no proof: choose another method."]
      : []),
    ...said(disconnected, "not connected to a start."),
    ...said(beyond_max_distance, "beyond the limit."),
    ...warnings,
  ];
}

export function boundInWords({ value, kind, type }: ErrorBound): string {
  const size = type === "relative" ? percent(value) : written(value, 3);
  return `error ${kind === "estimated" ? "about" : "at most"} ${size} (${kind})`;
}

export function proofInWords(
  { holds, relative_gap, worst_face }: Certificate,
  of = "the largest distance",
): string {
  const size = `${relative_gap.toExponential(0)} of ${of}`;
  return holds ? `✓ Proved to ${size}` : `Not proved: ${size} in doubt, most at face ${worst_face}`;
}

/** Return at each vertex the largest value of its faces. */
function atVertices(ofFaces: number[], mesh: LoadedMesh): Float64Array {
  const largest = new Float64Array(mesh.document.vertices);
  for (const [face, value] of ofFaces.entries()) {
    for (const vertex of mesh.corners(face)) {
      largest[vertex] = Math.max(largest[vertex] ?? 0, value);
    }
  }
  return largest;
}

/** Return by how many per cent each distance is wrong; -1 where unreachable. */
function errorsOf(exact: Field, rough: Field): Float64Array {
  return exact.distances.map((distance, i) => {
    const found = rough.distances[i] ?? Number.NaN;
    if (distance === Infinity || found === Infinity) return -1;
    return distance > 0 ? (100 * Math.abs(distance - found)) / distance : 0;
  });
}

/** Return by how much distances differ, infinite where unreachable; the largest and the mean. */
function differenceOf(a: Field, b: Field): { values: Float64Array; largest: number; mean: number } {
  const values = a.distances.map((distance, i) =>
    distance === Infinity ? Infinity : Math.abs(distance - (b.distances[i] ?? Number.NaN)),
  );
  const known = values.filter(Number.isFinite);
  const mean = known.reduce((sum, x) => sum + x, 0) / (known.length || 1);
  return { values, largest: largestOf(known), mean };
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
