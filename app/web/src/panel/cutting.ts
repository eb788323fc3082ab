// Cutting the mesh along what is drawn on it: the cut mesh opens in place of the mesh.
import type {
  Call,
  Isoline,
  IsolinesAnswer,
  PathAnswer,
  StraightLine,
  SurfaceCurve,
} from "geodesic-client";
import { bordersOf } from "../ask/borders";
import { isolinesOf, levelSetsOf } from "../ask/isolines";
import { byId, count } from "../dom";
import { service } from "../service";
import { CURVES, type Curves, type Cut, type State, type Store, withCut } from "../state/state";
import type { Status } from "../status";
import type { Notes } from "./notes";

/** What is drawn now. */
export interface Drawn {
  path: PathAnswer | null;
  walk: StraightLine | null;
  /** The largest distance or cost, up to which isolines are drawn. */
  largest: number;
  /** The camera, which stays where it is. */
  up: State["up"];
  view: State["view"];
}

export class Cutting {
  private readonly form = byId("cut");
  /** What was told of cuts, by the meshes that they made. */
  private readonly told = new Map<string, string>();

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
    const offered: Record<Curves, boolean> = {
      path: path?.locations != null,
      walk: walk !== null,
      isolines: hasLines && state.shade !== "difference",
      borders: state.distances && state.starts > 1 && state.shade === "territories",
    };
    for (const kind of CURVES) boxOf(kind).disabled = !offered[kind];
    byId("cut-start", HTMLButtonElement).disabled = !CURVES.some((kind) => offered[kind]);
    byId("cut-note").textContent = this.told.get(state.mesh ?? "") ?? "";
  }

  private cut(): void {
    const { state } = this.store;
    const { mesh } = state;
    const kinds = CURVES.filter((kind) => boxOf(kind).checked && !boxOf(kind).disabled);
    if (mesh === null || kinds.length === 0) {
      byId("cut-note").textContent = "Choose what to cut along.";
      return;
    }
    const stop = new AbortController();
    this.status.run("busy", "Cutting…", stop, async (onProgress) => {
      const call = { onProgress, signal: stop.signal };
      const curves = await Promise.all(
        kinds.map((kind) => curvesOf(kind, mesh, state, this.drawn(), call)),
      );
      const name = `cut along ${kinds.join(", ")}`;
      const answer = await service.cut(mesh, curves.flat(), { name, ...call });
      const { cut_mesh_id, parts, vertices, warnings } = answer;
      stop.signal.throwIfAborted();
      const { up, view } = this.drawn();
      const words = `Cut along ${count(curves.flat().length, "curve")}: ${count(parts, "part")}`;
      this.told.set(cut_mesh_id, `${words}, ${count(vertices, "vertex", "vertices")}.`);
      this.store.update(withCut(cut_mesh_id, kinds, { ...state, up: up ?? state.up, view }));
      this.notes.tell("points", warnings);
      await this.list();
    });
  }
}

/** Return what a cut was along, in the words of its boxes: the path, isolines. */
export function wordsOf({ along }: Cut): string {
  return along.map((kind) => boxOf(kind).labels?.[0]?.textContent).join(", ");
}

function boxOf(kind: Curves): HTMLInputElement {
  return byId(`cut-${kind}`, HTMLInputElement);
}

async function curvesOf(
  kind: Curves,
  mesh: string,
  state: State,
  { path, walk, largest }: Drawn,
  call: Call,
): Promise<SurfaceCurve[]> {
  if (kind === "path" || kind === "walk") {
    const locations = (kind === "path" ? path : walk)?.locations;
    return locations ? [{ polyline: locations }] : [];
  }
  const more = { include: ["locations" as const], ...call };
  if (kind === "borders") {
    const { sources, ...question } = bordersOf(state);
    return curvesAlong((await service.borders(mesh, sources, { ...question, ...more })).borders);
  }
  const { lines, values } = state;
  if (lines === null) return [];
  if (values) {
    const { values: numbers, ...question } = levelSetsOf(values, lines);
    return curvesAt((await service.isolines(mesh, numbers, { ...question, ...more })).isolines);
  }
  const { sources, ...question } = isolinesOf(state, lines, largest);
  return curvesAt((await service.isolines(mesh, sources, { ...question, ...more })).isolines);
}

function curvesAt(levels: IsolinesAnswer["isolines"]): SurfaceCurve[] {
  return curvesAlong(levels.flatMap(({ lines }) => lines));
}

function curvesAlong(lines: Pick<Isoline, "locations" | "closed">[]): SurfaceCurve[] {
  return lines.map(({ locations, closed }) => ({ polyline: locations ?? [], closed }));
}
