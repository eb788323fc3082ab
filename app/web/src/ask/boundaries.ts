// The boundary of the surface: requested when it is to be drawn.
import type { Notes } from "../panel/notes";
import { service } from "../service";
import type { State } from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import { Drawing } from "./drawing";

export class Boundaries {
  private readonly drawing: Drawing;

  constructor(
    status: Status,
    private readonly sceneView: SceneView,
    notes: Notes,
  ) {
    this.drawing = new Drawing(status, notes, "boundary", () => sceneView.showBoundary([]));
  }

  /** Draw the boundary of the mesh that is open, if ``state`` shows it. */
  follow({ mesh, boundary }: State): void {
    if (!mesh || !boundary || this.sceneView.mesh?.document.id !== mesh) {
      this.drawing.clear();
      return;
    }
    this.drawing.follow(mesh, async (onProgress, signal) => {
      const { boundaries } = await service.boundaries(mesh, { onProgress, signal });
      return () => this.sceneView.showBoundary(boundaries);
    });
  }

  /** Draw it again on a mesh that has been opened anew. */
  forget(): void {
    this.drawing.forget();
  }
}
