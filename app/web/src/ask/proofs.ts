// The badge of a path: the proof that no other is shorter.
import type { PathAnswer } from "geodesic-client";
import { byId } from "../dom";
import type { LoadedMesh } from "../mesh/loader";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { endOf, placedAt, stopsOf } from "../state/places";
import { type Point, pointOf } from "../state/point";
import type { Store } from "../state/state";
import type { Status } from "../status";
import { proofInWords } from "./fields";

export class PathProofs {
  private outline: PathAnswer | null = null;
  /** Whether the path that comes next is to be proved. */
  private isNext = false;
  private stop = new AbortController();
  private readonly badge = byId("path-proof");
  private readonly button = byId("prove", HTMLButtonElement);

  constructor(
    private readonly store: Store,
    private readonly status: Status,
    private readonly mesh: () => LoadedMesh | null,
  ) {
    this.button.addEventListener("click", () => this.prove());
  }

  /** Show the proof of no other path than the one that is drawn. */
  follow(outline: PathAnswer | null): void {
    if (outline === this.outline) return;
    this.outline = outline;
    this.stop.abort();
    this.badge.hidden = true;
    this.button.disabled = !this.isProvable;
    if (this.isNext && this.isProvable) this.prove();
  }

  /** The service proves exact paths without stops. */
  private get isProvable(): boolean {
    const { outline } = this;
    const isExact = outline?.method === "exact" && outline.length != null;
    return isExact && stopsOf(this.store.state).length === 0;
  }

  private prove(): void {
    const { outline } = this;
    const target = endOf(this.store.state);
    if (!outline || !target) return;
    const source = pointOf(outline.source);
    this.isNext = !("vertex" in source || "vertex" in target);
    if (this.isNext) this.moveEnd(target);
    else this.run(outline, source, target);
  }

  /** Move the end to the nearest corner of its face: a proof needs one end at a vertex. */
  private moveEnd(target: Point): void {
    const vertex = this.cornerOf(target);
    const { places } = this.store.state;
    this.store.update({ places: placedAt(places, places.length - 1, { vertex }) });
  }

  private cornerOf(point: Point): number {
    if ("vertex" in point) return point.vertex;
    if ("edge" in point) return point.edge[point.t < 0.5 ? 0 : 1];
    const corners = this.mesh()?.corners(point.face) ?? [0, 0, 0];
    const nearest = point.barycentric.indexOf(Math.max(...point.barycentric));
    return corners[nearest] ?? corners[0];
  }

  private run(outline: PathAnswer, source: Point, target: Point): void {
    const { state } = this.store;
    const { mesh } = state;
    if (!mesh) return;
    this.stop = new AbortController();
    const { signal } = this.stop;
    this.status.run("drawing", "Proving the path…", this.stop, async (onProgress) => {
      const call = { barriers: blockedFaces(state), certify: true, onProgress, signal };
      const { certificate } = await service.path(mesh, source, target, call);
      if (outline !== this.outline) return;
      if (!certificate) throw new Error("The service returned no proof.");
      this.badge.hidden = false;
      this.badge.textContent = proofInWords(certificate, "its length");
    });
  }
}
