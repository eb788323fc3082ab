// What a user must know of the answers that are shown: sentences below the legend.
import type { MeshDocument } from "geodesic-client";
import { byId } from "../dom";

type Topic =
  | "points"
  | "distances"
  | "isolines"
  | "borders"
  | "rays"
  | "boundary"
  | "path"
  | "walk";

export class Notes {
  private readonly told = new Map<Topic, readonly string[]>();
  /** The warnings of the mesh: its report shows them already. */
  private known: readonly string[] = [];

  /** Begin anew with a mesh; null: with one that is not known yet. */
  begin(mesh: MeshDocument | null): void {
    this.known = mesh?.warnings ?? [];
    this.show();
  }

  /** Tell sentences, in place of those on the same topic. */
  tell(topic: Topic, sentences: readonly string[]): void {
    this.told.set(topic, sentences);
    this.show();
  }

  private show(): void {
    const sentences = new Set([...this.told.values()].flat());
    for (const sentence of this.known) sentences.delete(sentence);
    byId("notes").replaceChildren(
      ...[...sentences].map((sentence) => {
        const line = document.createElement("li");
        line.textContent = sentence;
        return line;
      }),
    );
  }
}
