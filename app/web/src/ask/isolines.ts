// Isolines: requested when the field or the levels change, then drawn.
import { askIsolines, type IsolinesQuestion } from "../api/queries";
import type { Lines, State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { Drawing } from "./drawing";
import { type Fields, questionOf } from "./fields";

export class Isolines {
  private readonly drawing: Drawing;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
  ) {
    this.drawing = new Drawing(status, "Drawing isolines…", () => sceneView.showIsolines([]));
  }

  /** Request the isolines that `state` needs and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, lines, shade } = state;
    const field = this.fields.of(state);
    const isDrawn = field && lines && shade !== "difference" && this.sceneView.surface;
    const question = isDrawn ? isolinesOf(state, lines, field.largest) : null;
    const isEmpty = question && "levels" in question && question.levels.length === 0;
    if (!mesh || !question || isEmpty) {
      this.drawing.clear();
      return;
    }
    this.drawing.follow(JSON.stringify([mesh, question]), async (onProgress, signal) => {
      const found = await askIsolines(mesh, question, onProgress, signal);
      return () => this.sceneView.showIsolines(found);
    });
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}

/** Return the body of a query for isolines, up to the largest distance. */
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
