// Distances to all vertices: requested when sources, method or limits change, then painted.
import type {
  Call,
  Certificate,
  Distances,
  Effort,
  ErrorBound,
  Method,
  Question,
} from "geodesic-client";
import { byId, count, duration, written } from "../dom";
import type { LoadedMesh } from "../mesh/loader";
import type { FacePoint } from "../mesh/picking";
import { extremesOf } from "../mesh/values";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { nameOf, startsOf } from "../state/places";
import { INITIAL, type Shade, type State, unitOf } from "../state/state";
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
import { LatestOnly } from "./latestOnly";

/** Distances to all vertices, infinite where unreachable. */
export interface Field extends Distances {
  largest: number;
}

/** What proves the distances of a field. */
interface Proof {
  certificate: Certificate;
  /** By how much each face widens the gap at most, in mesh units. */
  violations: Float64Array;
}

/** Faces from which exact distances take noticeably longer than fast ones. */
const MANY_FACES = 50_000;

/** Answers for one set of sources, barriers, limit and cost. Of costs there is one method only. */
interface Answers {
  key: string;
  exact?: Field;
  approximate?: Field;
  fast?: Field;
  /** Fast distances of least effort, shown until those that were asked for are there. */
  rough?: Field;
  /** The error allowed in ``approximate``, and the effort of ``fast``. */
  error?: number;
  effort?: Effort;
  nearest?: Int32Array;
  /** Areas of the territories. */
  areas?: number[];
  proofs: Partial<Record<Method, Proof>>;
}

/** A state that asks for distances. */
type Asked = State & { mesh: string };

export class Fields {
  /** Called when the colours have changed. */
  onPaint: (state: State) => void = () => undefined;
  private answers: Answers = { key: "", proofs: {} };
  private requested = "";
  private state: State = INITIAL;
  private latest: Asked | null = null;
  private clearing = 0;
  private readonly latestOnly: LatestOnly<Asked>;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly notes: Notes,
  ) {
    this.latestOnly = new LatestOnly<Asked>(
      (asked, stop) =>
        status.during("busy", "Computing distances…", stop, (onProgress) =>
          this.answer(asked, { onProgress, signal: stop.signal }),
        ),
      (error) => status.fail(error),
    );
  }

  /** Return the field that was asked for, once it is there. */
  of(state: State): Field | null {
    return isAsked(state) ? (this.answersTo(state)[methodOf(state)] ?? null) : null;
  }

  /** Return the field that is drawn: a rough one until then. */
  private shown(state: State): Field | null {
    return this.of(state) ?? (isAsked(state) ? (this.answersTo(state).rough ?? null) : null);
  }

  /** Return the answers that are there, without those for another error or effort. */
  private answersTo(state: State): Answers {
    const key = keyOf(state);
    const { answers } = this;
    if (key !== answers.key) return { key, proofs: {} };
    if (state.error !== answers.error) {
      delete answers.approximate;
      delete answers.proofs.approximate;
    }
    if (state.effort !== answers.effort) delete answers.fast;
    return answers;
  }

  /** Return the nearest source of each vertex, where it is drawn; else null. */
  territories(state: State): Int32Array | null {
    return shadeOf(state) === "territories" ? (this.answersTo(state).nearest ?? null) : null;
  }

  /** Return the numbers that colour the surface, with the ends of their scale; null: none. */
  scale(state: State): Scale | null {
    const field = this.of(state);
    return state.values || field ? scaleOf(state, field) : null;
  }

  /** Tell the areas of the territories that are drawn. */
  tellAreas(areas: number[], state: State): void {
    const answers = this.answersTo(state);
    answers.areas = areas;
    this.showTerritories(state, answers);
  }

  /** Request what ``state`` needs and has not been answered yet, and paint it. */
  follow(state: State): void {
    this.state = state;
    const { mesh, error, effort } = state;
    const asked = [keyOf(state), methodOf(state), error, effort, shadeOf(state), versusOf(state)];
    const requested = JSON.stringify(asked);
    if (requested === this.requested) return;
    this.requested = requested;
    const isQuestion = mesh !== null && isAsked(state) && startsOf(state).length > 0;
    this.latest = isQuestion ? { ...state, mesh } : null;
    if (this.latest) {
      this.latestOnly.ask(this.latest);
      // Until the answer is there, the one before remains for a moment only.
      this.clearing ||= setTimeout(() => this.paint(this.state), PATIENCE_MS);
    } else {
      this.latestOnly.cancel();
      this.paint(state);
    }
  }

  private async answer(asked: Asked, call: Call & { signal: AbortSignal }): Promise<void> {
    const answers = this.answersTo(asked);
    try {
      if (this.takesLong(asked, answers)) {
        const { sources, ...question } = questionOf({ ...asked, effort: 1 }, "fast");
        const { signal } = call; // progress is told of the work that remains
        answers.rough = fieldOf(
          await service.distances(asked.mesh, sources, { ...question, signal }),
        );
        this.show(answers, asked);
        if (!(await this.latestOnly.rests())) return;
      }
      await this.fetchMissing(answers, asked, call);
      this.show(answers, asked);
    } catch (failure) {
      if (asked === this.latest) {
        // After a failure or an abort, the same request may be made again.
        this.requested = "";
        delete answers.rough;
        this.paint(this.state);
      }
      throw failure;
    }
  }

  /** Whether a rough answer is worth while. */
  private takesLong(asked: Asked, answers: Answers): boolean {
    const { method } = asked;
    const shade = shadeOf(asked);
    const faces = this.sceneView.mesh?.document.faces ?? 0;
    const isPlain = shade === "distance" || shade === "territories";
    const isQuick = method === "fast" || hasCost(asked); // of costs there is no rough answer
    return faces >= MANY_FACES && isPlain && !isQuick && !answers[method];
  }

  /** Paint answers, also those for points that have been pulled on meanwhile, for a moment. */
  private show(answers: Answers, asked: Asked): void {
    const { surface, mesh } = this.sceneView;
    if (keyOf(asked) === keyOf(this.state)) {
      this.answers = answers;
      this.paint(this.state);
    } else if (isPulled(asked, this.state) && surface && mesh) {
      const field = answers[methodOf(asked)] ?? answers.rough;
      blank(surface);
      if (field) this.paintField(surface, mesh, field, asked, answers);
      clearTimeout(this.clearing);
      this.clearing = setTimeout(() => this.paint(this.state), PATIENCE_MS);
      this.onPaint(this.state);
      this.sceneView.stage.invalidate();
    }
  }

  private async fetchMissing(answers: Answers, state: Asked, call: Call): Promise<void> {
    const { mesh } = state;
    const shade = shadeOf(state);
    const asked = methodOf(state);
    const methods = shade === "difference" ? [asked, versusOf(state)] : [asked];
    for (const method of methods) {
      if (answers[method]) continue;
      const { sources, ...question } = questionOf(state, method);
      answers[method] = fieldOf(await service.distances(mesh, sources, { ...question, ...call }));
      if (method === "approximate") answers.error = state.error;
      if (method === "fast") answers.effort = state.effort;
    }
    if (shade === "territories") {
      // Borders are exact in any case.
      answers.nearest ??= await askTerritories(mesh, questionOf(state, "exact"), call);
    }
    if (shade === "proof" && state.method !== "fast") {
      const question = questionOf(state, state.method);
      answers.proofs[state.method] ??= await askProof(mesh, question, call);
    }
  }

  /** Paint the answers that are there; a mesh without any shows its pieces. */
  paint(state: State): void {
    clearTimeout(this.clearing);
    this.clearing = 0;
    const { surface, mesh } = this.sceneView;
    const field = this.shown(state);
    this.compare(this.answersTo(state));
    if (!surface || !mesh) return;
    blank(surface);
    this.notes.tell("distances", field ? notesOn(field, state) : []);
    if (state.values) {
      const { values, least, largest } = scaleOf(state, null);
      surface.setValues(values, largest, least);
      showScale(state.values.name, largest, least);
    } else if (field) this.paintField(surface, mesh, field, state, this.answers);
    else {
      surface.setPieces(mesh.pieces);
      hideLegend();
    }
    this.onPaint(state);
    this.sceneView.stage.invalidate();
  }

  private paintField(
    surface: Surface,
    mesh: LoadedMesh,
    field: Field,
    state: State,
    answers: Answers,
  ): void {
    const shade = shadeOf(state);
    const { nearest } = answers;
    const method = methodOf(state);
    const other = answers[versusOf(state)];
    const proof = answers.proofs[method];
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
    const { values, least, largest } = scaleOf(state, field);
    surface.setValues(values, largest, least);
    if (shade === "territories" && nearest) {
      const hues = huesOf(state.starts, nearest, mesh);
      this.sceneView.hues = hues;
      surface.setTerritories(nearest.map((source) => hues[source] ?? source));
      this.sceneView.showPoints(this.state);
      this.showTerritories(state, answers);
    } else {
      const isRough = method === "fast" || field === answers.rough;
      const what = hasCost(state) ? "Cost" : isRough ? "Rough distance" : "Distance";
      showScale(`${what} in ${measureOf(state)}`, largest, least);
    }
  }

  private showTerritories(state: State, { areas }: Answers): void {
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
    const numbers = state.values?.numbers ?? this.shown(state)?.distances;
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
  private compare({ exact, approximate, fast }: Answers): void {
    byId("time-exact").textContent = timeOf(exact);
    byId("bound-exact").textContent = exact ? "0" : "–";
    byId("measured-exact").textContent = exact && (approximate ?? fast) ? "0" : "–";
    for (const [method, rough] of Object.entries({ approximate, fast })) {
      byId(`time-${method}`).textContent = timeOf(rough);
      byId(`bound-${method}`).textContent = rough ? percent(rough.error_bound.value) : "–";
      byId(`measured-${method}`).textContent =
        exact && rough ? percent(largestOf(errorsOf(exact, rough)) / 100) : "–";
    }
  }
}

/** Numbers of the vertices, and those of the first and the last colour. */
export interface Scale {
  values: Float64Array;
  least: number;
  largest: number;
}

/** Return the scale of the values of a file where there are some, otherwise of a field. */
function scaleOf({ values, least, range }: State, field: Field | null): Scale {
  const numbers = values?.numbers ?? field?.distances ?? new Float64Array();
  const [low, high] = values ? extremesOf(values.numbers) : [0, field?.largest ?? 0];
  return { values: numbers, least: least ?? low, largest: range ?? high };
}

/** Take territories, proof and difference away. */
function blank(surface: Surface): void {
  surface.setTerritories(null);
  showProof(null);
  showDifference(null);
}

export function fieldOf(answer: Distances): Field {
  const reached = answer.distances.filter((distance) => distance < Infinity);
  return { ...answer, largest: largestOf(reached) };
}

/** Prove the distances from the sources of a question. */
export async function askProof(
  mesh: string,
  { sources, ...question }: FieldQuestion,
  call: Call,
): Promise<Proof> {
  const asked = { ...question, certify: true, include: ["violations" as const], ...call };
  const { certificate, violations } = await service.distances(mesh, sources, asked);
  if (!certificate || !violations) throw new Error("The service returned no proof.");
  return { certificate, violations };
}

/** Return the index of the nearest source of each vertex, -1 where there is none. */
async function askTerritories(
  mesh: string,
  { sources, ...question }: FieldQuestion,
  call: Call,
): Promise<Int32Array> {
  const asked = { ...question, include: ["nearest_source" as const], ...call };
  return (await service.distances(mesh, sources, asked)).nearest_source ?? new Int32Array();
}

/** Return what answers belong to. */
function keyOf(state: State): string {
  const { mesh, barriers, maxDistance } = state;
  const sources = isAsked(state) ? startsOf(state) : [];
  return JSON.stringify([mesh, sources, barriers, maxDistance, costKey(state)]);
}

/** Whether two states ask for distances that differ by where the sources are at most. */
function isPulled(before: State, now: State): boolean {
  const fixed = (state: State): string => {
    const { mesh, barriers, maxDistance, starts } = state;
    const colours = [methodOf(state), shadeOf(state), versusOf(state), costKey(state)];
    return JSON.stringify([mesh, barriers, maxDistance, starts, colours]);
  };
  return isAsked(now) && startsOf(now).length > 0 && fixed(before) === fixed(now);
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

type FieldQuestion<M extends Method = Method> = Pick<
  Question<"distances">,
  "sources" | "relativeError" | "effort" | "maxDistance" | "barriers" | "cost"
> & { method?: M };

/** Return a question for distances, or for costs: of these there is no other method. */
export function questionOf<M extends Method>(state: State, method: M): FieldQuestion<M> {
  const sources = startsOf(state);
  const cost = costOf(state);
  const barriers = blockedFaces(state);
  const blocked = barriers.length > 0 ? { barriers } : {};
  if (cost) return { sources, cost, ...blocked };
  return {
    sources,
    method,
    ...(method === "approximate" ? { relativeError: state.error } : {}),
    ...(method === "fast" ? { effort: state.effort } : {}),
    ...(state.maxDistance === null ? {} : { maxDistance: state.maxDistance }),
    ...blocked,
  };
}

/** Return the method that the one of the question is compared with. */
export function versusOf({ method, versus }: State): Method {
  if (versus !== null && versus !== method) return versus;
  return method === "exact" ? "approximate" : "exact";
}

/** Return what there is to know about a field but its colours. */
function notesOn({ error_bound, unreachable, warnings }: Field, state: State): string[] {
  const { method, shade } = state;
  const { disconnected, beyond_max_distance } = unreachable;
  const isExact = method === "exact" && error_bound.value === 0;
  const said = (n: number, what: string): string[] =>
    n > 0 ? [`${count(n, "vertex", "vertices")} ${what}`] : [];
  return [
    ...(hasCost(state)
      ? [`Costs: ${boundInWords(error_bound)}.`]
      : isExact
        ? []
        : [`Distances: ${boundInWords(error_bound)}.`]),
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
function atVertices(ofFaces: Float64Array, mesh: LoadedMesh): Float64Array {
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
