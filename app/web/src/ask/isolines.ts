// Isolines: requested when the field or the levels change, then drawn.
import type { Isoline, IsolinesAnswer, Question, Source } from "geodesic-client";
import { extremesOf } from "../mesh/values";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import type { Lines, State, Values } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { hasCost } from "./costs";
import { Drawing } from "./drawing";
import { boundInWords, type Fields, questionOf, shadeOf } from "./fields";

export class Isolines {
  /** The lines that are drawn. */
  lines: Isoline[] = [];
  private readonly drawing: Drawing;
  /** Called when lines are drawn, or none any more. */
  onDraw: () => void = () => undefined;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
    private readonly notes: Notes,
  ) {
    this.drawing = new Drawing(status, notes, "isolines", () => this.show([]));
  }

  /** Request the isolines that `state` needs and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, lines, values } = state;
    if (mesh && values && lines && this.sceneView.surface) {
      this.followValues(mesh, values, lines);
      return;
    }
    const field = this.fields.of(state);
    const isDrawn = lines && shadeOf(state) !== "difference" && this.sceneView.surface;
    // Where nothing but the sources is reached, there is no line.
    const question =
      isDrawn && field && field.largest > 0 ? isolinesOf(state, lines, field.largest) : null;
    const isEmpty = question?.levels?.length === 0;
    if (!mesh || !question || isEmpty) {
      this.drawing.clear();
      return;
    }
    const asked = JSON.stringify([mesh, question, state.method]);
    this.drawing.follow(asked, async (onProgress, signal) => {
      const { sources, ...rest } = question;
      const answer = await service.isolines(mesh, sources, { ...rest, onProgress, signal });
      const isOfOtherMethod = !hasCost(state) && answer.method !== state.method;
      return () => {
        this.show(answer.isolines);
        this.notes.tell("isolines", [
          ...(isOfOtherMethod ? [`Isolines: ${boundInWords(answer.error_bound)}.`] : []),
          ...answer.warnings,
        ]);
      };
    });
  }

  private followValues(mesh: string, of: Values, lines: NonNullable<Lines>): void {
    const { values, ...question } = levelSetsOf(of, lines);
    if (question.levels?.length === 0) {
      this.drawing.clear();
      return;
    }
    const asked = JSON.stringify([mesh, of.key, lines]);
    this.drawing.follow(asked, async (onProgress, signal) => {
      const { isolines, warnings } = await service.isolines(mesh, values, {
        ...question,
        onProgress,
        signal,
      });
      return () => {
        this.show(isolines);
        this.notes.tell("isolines", warnings);
      };
    });
  }

  private show(levels: IsolinesAnswer["isolines"]): void {
    this.lines = levels.flatMap(({ lines }) => lines);
    this.sceneView.showIsolines(levels);
    this.onDraw();
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}

/** Return a question for the level sets of values, and these: NaN where there is none. */
export function levelSetsOf(
  { numbers }: Values,
  lines: NonNullable<Lines>,
): { values: Float64Array; count?: number; levels?: number[] } {
  const values = numbers.map((x) => (Number.isFinite(x) ? x : Number.NaN));
  if ("count" in lines) return { values, count: lines.count };
  const { spacing } = lines;
  const [least, largest] = extremesOf(numbers);
  const first = Math.floor(least / spacing) + 1;
  const count = Math.max(0, Math.ceil(largest / spacing) - first);
  return { values, levels: Array.from({ length: count }, (_, i) => (first + i) * spacing) };
}

type IsolinesQuestion = Question<"isolines"> & { sources: Source[] };

/** Return a question for isolines, up to the largest distance. */
export function isolinesOf(
  state: State,
  lines: NonNullable<Lines>,
  largest: number,
): IsolinesQuestion {
  // From a fast field they would take as long as exact ones.
  const question = questionOf(state, state.method === "fast" ? "approximate" : state.method);
  if ("count" in lines) return { ...question, count: lines.count };
  const count = Math.floor(largest / lines.spacing);
  return {
    ...question,
    levels: Array.from({ length: count }, (_, i) => (i + 1) * lines.spacing),
  };
}
