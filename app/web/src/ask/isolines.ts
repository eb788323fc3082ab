// Isolines: requested when the field or the levels change, then drawn.
import type { Isoline, Question, Source } from "geodesic-client";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import type { Lines, State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { Drawing } from "./drawing";
import { boundInWords, type Fields, questionOf } from "./fields";

export class Isolines {
  /** The lines that are drawn. */
  lines: Isoline[] = [];
  private readonly drawing: Drawing;

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
    const { mesh, lines, shade } = state;
    const field = this.fields.of(state);
    const isDrawn = lines && shade !== "difference" && this.sceneView.surface;
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
      const isOfOtherMethod = answer.method !== state.method;
      return () => {
        this.show(answer.isolines.flatMap((level) => level.lines));
        this.notes.tell("isolines", [
          ...(isOfOtherMethod ? [`Isolines: ${boundInWords(answer.error_bound)}.`] : []),
          ...answer.warnings,
        ]);
      };
    });
  }

  private show(lines: Isoline[]): void {
    this.lines = lines;
    this.sceneView.showIsolines(lines);
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}

type IsolinesQuestion = Question<"isolines"> & { sources: Source[] };

/** Return a question for isolines, up to the largest distance. */
export function isolinesOf(
  state: State,
  lines: NonNullable<Lines>,
  largest: number,
): IsolinesQuestion {
  // From a fast field they would take as long as exact ones.
  const method = state.method === "fast" ? "approximate" : state.method;
  const question = { ...questionOf(state, method), method };
  if ("count" in lines) return { ...question, count: lines.count };
  const count = Math.floor(largest / lines.spacing);
  return {
    ...question,
    levels: Array.from({ length: count }, (_, i) => (i + 1) * lines.spacing),
  };
}
