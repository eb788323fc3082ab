// Borders and areas of territories: requested when the surface is coloured by them, then shown.
import type { Question } from "geodesic-client";
import type { Notes } from "../panel/notes";
import { service } from "../service";
import type { State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { Drawing } from "./drawing";
import { type Fields, questionOf, shadeOf } from "./fields";

export class Borders {
  private readonly drawing: Drawing;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    private readonly fields: Fields,
    private readonly notes: Notes,
  ) {
    const clear = () => sceneView.showBorders(new Int32Array(), []);
    this.drawing = new Drawing(status, notes, "borders", clear);
  }

  /** Request the borders that `state` shows and that are not drawn yet, and draw them. */
  follow(state: State): void {
    const { mesh, starts } = state;
    const nearest = this.fields.territories(state);
    const isDrawn = starts > 1 && shadeOf(state) === "territories" && this.sceneView.surface;
    if (!mesh || !nearest || !isDrawn) {
      this.drawing.clear();
      return;
    }
    const question = bordersOf(state);
    this.drawing.follow(JSON.stringify([mesh, question]), async (onProgress, signal) => {
      const { sources, ...rest } = question;
      const asked = { ...rest, onProgress, signal };
      const { borders, warnings } = await service.borders(mesh, sources, asked);
      const cells = await service.cells(mesh, sources, asked);
      return () => {
        this.sceneView.showBorders(nearest, borders);
        this.fields.tellAreas(cells.areas, state);
        this.notes.tell("borders", [...warnings, ...cells.warnings]);
      };
    });
  }

  /** Draw them again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}

/** Return a question for borders, which are exact by any method. */
export function bordersOf(state: State): Question<"borders"> {
  const { method: _, ...question } = questionOf(
    { ...state, slope: null, faceCosts: null },
    "exact",
  );
  return question;
}
