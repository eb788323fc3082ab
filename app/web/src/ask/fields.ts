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
import type { Notes } from "../panel/notes";
import { service } from "../service";
import { nameOf, startsOf } from "../state/places";
import { INITIAL, type State, unitOf } from "../state/state";
import { PATIENCE_MS, type Status } from "../status";
import { hideLegend, showHere, showProof, showScale, showTerritories } from "../view/legend";
import type { SceneView } from "../view/sceneView";
import type { Surface } from "../view/surface";
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

/** Answers for one set of sources, barriers and limit. */
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
    return isAsked(state) ? (this.answersTo(state)[state.method] ?? null) : null;
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
    return state.shade === "territories" ? (this.answersTo(state).nearest ?? null) : null;
  }

  /** Request what ``state`` needs and has not been answered yet, and paint it. */
  follow(state: State): void {
    this.state = state;
    const { mesh, method, error, effort, shade } = state;
    const requested = JSON.stringify([keyOf(state), method, error, effort, shade]);
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
        answers.rough = fieldOf(
          await service.distances(asked.mesh, sources, { ...question, ...call }),
        );
        this.show(answers, asked);
        if (!this.latestOnly.refines()) return;
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
  private takesLong({ method, shade }: Asked, answers: Answers): boolean {
    const faces = this.sceneView.mesh?.document.faces ?? 0;
    const isPlain = shade === "distance" || shade === "territories";
    return faces >= MANY_FACES && isPlain && method !== "fast" && !answers[method];
  }

  /** Paint answers, also those for points that have been pulled on meanwhile, for a moment. */
  private show(answers: Answers, asked: Asked): void {
    const { surface, mesh } = this.sceneView;
    if (keyOf(asked) === keyOf(this.state)) {
      this.answers = answers;
      this.paint(this.state);
    } else if (isPulled(asked, this.state) && surface && mesh) {
      const field = answers[asked.method] ?? answers.rough;
      if (field) this.paintField(surface, mesh, field, asked, answers);
      clearTimeout(this.clearing);
      this.clearing = setTimeout(() => this.paint(this.state), PATIENCE_MS);
      this.onPaint(this.state);
      this.sceneView.stage.invalidate();
    }
  }

  private async fetchMissing(answers: Answers, state: Asked, call: Call): Promise<void> {
    const { mesh } = state;
    const isCompared = state.shade === "difference";
    const methods: Method[] = isCompared ? ["exact", roughOf(state)] : [state.method];
    for (const method of methods) {
      if (answers[method]) continue;
      const { sources, ...question } = questionOf(state, method);
      answers[method] = fieldOf(await service.distances(mesh, sources, { ...question, ...call }));
      if (method === "approximate") answers.error = state.error;
      if (method === "fast") answers.effort = state.effort;
    }
    if (state.shade === "territories") {
      // Borders are exact in any case.
      answers.nearest ??= await askTerritories(mesh, questionOf(state, "exact"), call);
    }
    if (state.shade === "proof" && state.method !== "fast") {
      const question = questionOf(state, state.method);
      answers.proofs[state.method] ??= await askProof(mesh, question, call);
    }
  }

  /** Paint the answers that are there; a mesh without any stays grey. */
  paint(state: State): void {
    clearTimeout(this.clearing);
    this.clearing = 0;
    const { surface, mesh } = this.sceneView;
    const field = this.shown(state);
    this.compare(this.answersTo(state));
    if (!surface || !mesh) return;
    this.notes.tell("distances", field ? notesOn(field, state) : []);
    if (field) this.paintField(surface, mesh, field, state, this.answers);
    else {
      surface.setTerritories(null);
      surface.setValues(null, 1);
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
    const { shade, starts } = state;
    const { exact, nearest } = answers;
    const rough = answers[roughOf(state)];
    const proof = answers.proofs[state.method];
    surface.setTerritories(null);
    showProof(proof ? proofInWords(proof.certificate) : null);
    if (shade === "proof" && proof) {
      const violations = atVertices(proof.violations, mesh);
      surface.setValues(violations, proof.certificate.worst_violation);
      showScale(`Violation by face, ${unitOf(state)}`, proof.certificate.worst_violation);
      return;
    }
    if (shade === "difference" && exact && rough) {
      const errors = errorsOf(exact, rough);
      const largest = largestOf(errors);
      surface.setValues(errors, largest);
      const bound = `${rough.error_bound.kind}: ${written(100 * rough.error_bound.value, 3)}`;
      showScale(`Error, % (${bound})`, largest);
      return;
    }
    const largest = state.range ?? field.largest;
    surface.setValues(field.distances, largest);
    if (shade === "territories" && nearest) {
      surface.setTerritories(nearest);
      showTerritories(Array.from({ length: starts }, (_, i) => nameOf(state, i)));
    } else {
      const isRough = field === answers.rough;
      showScale(`${isRough ? "Rough distance" : "Distance"} in ${unitOf(state)}`, largest);
    }
  }

  /** Tell the distance at a point, interpolated within its face; null: nowhere. */
  tell(point: FacePoint | null, state: State): void {
    const field = this.shown(state);
    const mesh = this.sceneView.mesh;
    const isTold = point && field && mesh && !["difference", "proof"].includes(state.shade);
    const value = isTold
      ? mesh
          .corners(point.face)
          .reduce((sum, v, i) => sum + (point.barycentric[i] ?? 0) * (field.distances[v] ?? NaN), 0)
      : Number.NaN;
    showHere(Number.isFinite(value) ? `≈ ${written(value, 4)} ${unitOf(state)} here` : null);
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
  return JSON.stringify([mesh, isAsked(state) ? startsOf(state) : [], barriers, maxDistance]);
}

/** Whether two states ask for distances that differ by where the sources are at most. */
function isPulled(before: State, now: State): boolean {
  const fixed = ({ mesh, barriers, maxDistance, method, shade, starts }: State): string =>
    JSON.stringify([mesh, barriers, maxDistance, method, shade, starts]);
  return isAsked(now) && startsOf(now).length > 0 && fixed(before) === fixed(now);
}

function isAsked({ distances, isReadable }: State): boolean {
  return distances && isReadable;
}

type FieldQuestion = Pick<
  Question<"distances">,
  "sources" | "method" | "relativeError" | "effort" | "maxDistance" | "barriers"
>;

/** Return a question for distances. */
export function questionOf(state: State, method: Method): FieldQuestion {
  return {
    sources: startsOf(state),
    method,
    ...(method === "approximate" ? { relativeError: state.error } : {}),
    ...(method === "fast" ? { effort: state.effort } : {}),
    ...(state.maxDistance === null ? {} : { maxDistance: state.maxDistance }),
    ...(state.barriers.length > 0 ? { barriers: state.barriers } : {}),
  };
}

/** Return the method that is compared with the exact one. */
function roughOf({ method }: State): Exclude<Method, "exact"> {
  return method === "exact" ? "approximate" : method;
}

/** Return what there is to know about a field but its colours. */
function notesOn(
  { error_bound, unreachable, warnings }: Field,
  { method, shade }: State,
): string[] {
  const { disconnected, beyond_max_distance } = unreachable;
  const isExact = method === "exact" && error_bound.value === 0;
  const said = (n: number, what: string): string[] =>
    n > 0 ? [`${count(n, "vertex", "vertices")} ${what}`] : [];
  return [
    ...(isExact ? [] : [`Distances: ${boundInWords(error_bound)}.`]),
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

function proofInWords({ holds, relative_gap, worst_face }: Certificate): string {
  const size = `${relative_gap.toExponential(0)} of the largest distance`;
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
