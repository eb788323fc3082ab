// Borders of territories: requested when the surface is coloured by them, then drawn.
import { askBorders, type BordersQuestion } from "../api/queries";
import type { State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { type Fields, questionOf } from "./fields";

export class Borders {
  private requested = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
  ) {}

  /** Request the borders that ``state`` shows and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, sources, shade } = state;
    const nearest = this.fields.territories(state);
    const isDrawn = mesh && nearest && sources.length > 1 && shade === "territories";
    const question = bordersOf(state);
    const requested = isDrawn && this.sceneView.surface ? JSON.stringify([mesh, question]) : "";
    if (requested === this.requested) return;
    this.requested = requested;
    this.stop.abort();
    this.sceneView.showBorders(new Int32Array(), []);
    if (requested === "" || !mesh || !nearest) return;
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("busy", "Drawing borders…", stop, async (onProgress) => {
      const borders = await askBorders(mesh, question, onProgress, stop.signal);
      if (!stop.signal.aborted) this.sceneView.showBorders(nearest, borders);
    });
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.stop.abort();
    this.requested = "";
  }
}

/** Return the body of a query for borders, which are exact by any method. */
export function bordersOf(state: State): BordersQuestion {
  const { method: _, ...question } = questionOf(state, "exact");
  return question;
}
