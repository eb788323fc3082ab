// Isolines: requested when the field or the levels change, then drawn.
import { askIsolines, type IsolinesQuestion } from "../api/queries";
import type { Lines, State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { type Fields, questionOf } from "./fields";

export class Isolines {
  private requested = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
  ) {}

  /** Request the isolines that ``state`` needs and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, lines, shade } = state;
    const field = this.fields.of(state);
    const isDrawn = mesh && field && lines && shade !== "difference" && this.sceneView.surface;
    const question = isDrawn ? isolinesOf(state, lines, field.largest) : null;
    const requested = JSON.stringify([mesh, question]);
    if (requested === this.requested) return;
    this.requested = requested;
    this.stop.abort();
    this.sceneView.showIsolines([]);
    if (!mesh || !question || ("levels" in question && question.levels.length === 0)) return;
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("busy", "Drawing isolines…", stop, async (onProgress) => {
      const found = await askIsolines(mesh, question, onProgress, stop.signal);
      if (!stop.signal.aborted) this.sceneView.showIsolines(found);
    });
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.stop.abort();
    this.requested = "";
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
