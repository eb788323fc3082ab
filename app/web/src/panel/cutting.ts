// Cutting the mesh along what is drawn on it: the cut mesh opens in place of the mesh.
import { askCurves, askCut, type SurfaceCurve, type Waiting } from "../api/tools";
import type { Outline, StraightLine } from "../api/types";
import { bordersOf } from "../ask/borders";
import { isolinesOf, levelSetsOf } from "../ask/isolines";
import { byId, count } from "../dom";
import { type State, type Store, withMesh } from "../state/state";
import type { Status } from "../status";
import type { Notes } from "./notes";

const KINDS = ["path", "walk", "isolines", "borders"] as const;
type Kind = (typeof KINDS)[number];

/** What is drawn now. */
export interface Drawn {
  path: Outline | null;
  walk: StraightLine | null;
  /** The largest distance or cost, up to which isolines are drawn. */
  largest: number;
  /** The camera, which stays where it is. */
  up: State["up"];
  view: State["view"];
}

export class Cutting {
  private readonly form = byId("cut");

  constructor(
    private readonly store: Store,
    private readonly status: Status,
    private readonly notes: Notes,
    private readonly drawn: () => Drawn,
    private readonly list: () => Promise<void>,
  ) {
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.cut();
    });
  }

  /** Offer what is drawn to cut along. */
  show(): void {
    const { state } = this.store;
    const { path, walk, largest } = this.drawn();
    const hasLines = state.lines !== null && (largest > 0 || state.values !== null);
    const offered: Record<Kind, boolean> = {
      path: path?.locations != null,
      walk: walk !== null,
      isolines: hasLines && state.shade !== "difference",
      borders: state.distances && state.starts > 1 && state.shade === "territories",
    };
    for (const kind of KINDS) boxOf(kind).disabled = !offered[kind];
    byId("cut-start", HTMLButtonElement).disabled = !KINDS.some((kind) => offered[kind]);
  }

  private cut(): void {
    const { state } = this.store;
    const { mesh } = state;
    const kinds = KINDS.filter((kind) => boxOf(kind).checked && !boxOf(kind).disabled);
    if (mesh === null || kinds.length === 0) {
      byId("cut-note").textContent = "Choose what to cut along.";
      return;
    }
    const stop = new AbortController();
    this.status.run("busy", "Cutting…", stop, async (onProgress) => {
      const waiting = { onProgress, signal: stop.signal };
      const curves = await Promise.all(
        kinds.map((kind) => curvesOf(kind, mesh, state, this.drawn(), waiting)),
      );
      const question = { curves: curves.flat(), name: `cut along ${kinds.join(", ")}` };
      const { cut_mesh_id, parts, vertices, warnings } = await askCut(mesh, question, waiting);
      stop.signal.throwIfAborted();
      const { unit, up } = state;
      const seen = { unit, up: this.drawn().up ?? up, view: this.drawn().view, boundary: true };
      this.store.update({ ...withMesh(cut_mesh_id, state), ...seen });
      const words = `Cut along ${count(curves.flat().length, "curve")}: ${count(parts, "part")}`;
      byId("cut-note").textContent = `${words}, ${count(vertices, "vertex", "vertices")}.`;
      this.notes.tell("points", warnings);
      await this.list();
    });
  }
}

function boxOf(kind: Kind): HTMLInputElement {
  return byId(`cut-${kind}`, HTMLInputElement);
}

async function curvesOf(
  kind: Kind,
  mesh: string,
  state: State,
  { path, walk, largest }: Drawn,
  waiting: Waiting,
): Promise<SurfaceCurve[]> {
  if (kind === "path" || kind === "walk") {
    const locations = (kind === "path" ? path : walk)?.locations;
    return locations ? [{ polyline: locations }] : [];
  }
  if (kind === "borders") return askCurves(mesh, kind, bordersOf(state), waiting);
  const { lines, values } = state;
  if (lines === null) return [];
  const question = values ? levelSetsOf(values, lines) : isolinesOf(state, lines, largest);
  return askCurves(mesh, kind, question, waiting);
}
