// The report on a mesh in words, and its faults marked on the mesh.
import type { MeshDocument } from "geodesic-client";
import { button, byId, count, written } from "../dom";
import { positionOf } from "../mesh/picking";
import type { SceneView } from "../view/sceneView";

type Faults = MeshDocument["degenerate_faces"];
const NONE: Faults = { count: 0, ids: [] };
type Kind = "face" | "vertex" | "edge";

/** Show the report; `join` uploads the mesh again with vertices at one position joined. */
export function showReport(
  document_: MeshDocument | null,
  sceneView: SceneView,
  unit: string,
  join: (() => void) | null,
): void {
  const report = byId("report");
  report.replaceChildren();
  if (!document_) return;
  const words = document.createElement("p");
  words.textContent = describe(document_, unit);
  const list = document.createElement("ul");
  const lines = new Map(document_.warnings.map((warning) => [warning, lineOf(warning)]));
  for (const [faults, kind, what, title] of faultsOf(document_)) {
    if (faults.count === 0) continue;
    // The service has told it in a sentence, with the remedy.
    const words = document_.warnings.find((warning) => what.test(warning)) ?? title;
    const line = lines.get(words) ?? lineOf(words);
    lines.set(words, line);
    line.append(showing(faults, kind, title, sceneView));
    if (join && faults === document_.duplicate_vertices) line.append(button("Join them", join));
  }
  list.append(...lines.values());
  report.append(words, list);
}

function lineOf(words: string): HTMLLIElement {
  const line = document.createElement("li");
  const text = document.createElement("span");
  text.textContent = words;
  line.append(text);
  return line;
}

function describe(mesh: MeshDocument, unit: string): string {
  const [low, high] = mesh.bounds ?? [[], []]; // a mesh without positions is not drawn
  const size = high.map((x, i) => written(x - (low[i] ?? 0), 3)).join(" × ");
  const parts = mesh.components === 1 ? "one piece" : count(mesh.components, "piece");
  const rim =
    mesh.boundary_loops === 0
      ? "closed"
      : `with ${count(mesh.boundary_loops, "boundary", "boundaries")}`;
  const divided =
    mesh.triangulated_polygons === 0
      ? ""
      : ` ${count(mesh.triangulated_polygons, "polygon")} divided into triangles.`;
  return (
    `${count(mesh.vertices, "vertex", "vertices")}, ${count(mesh.faces, "face")}; ${parts}, ${rim}. ` +
    `${size} ${unit}, edges of ${written(mesh.mean_edge_length, 3)} on average.${divided}`
  );
}

/** Return the faults of each kind, how the service's sentence on them is known, and their name. */
function faultsOf(mesh: MeshDocument): [Faults, Kind, RegExp, string][] {
  return [
    [mesh.duplicate_vertices, "vertex", /position of an earlier vertex/, "duplicate vertices"],
    [mesh.near_vertices ?? NONE, "edge", /apart but not joined/, "borders that are nearly joined"],
    [mesh.t_junctions ?? NONE, "vertex", /T-junction/, "vertices on an edge of others"],
    [mesh.isolated_vertices, "vertex", /in no face/, "vertices without a face"],
    [mesh.repeated_vertex_faces, "face", /than three different/, "faces that repeat a vertex"],
    [mesh.zero_length_edges, "edge", /zero length/, "edges of zero length"],
    [mesh.collapsed_faces, "face", /reduced to an edge/, "collapsed faces"],
    [mesh.duplicate_faces, "face", /same vertices as an earlier/, "duplicate faces"],
    [mesh.degenerate_faces, "face", /without area/, "faces without area"],
    [mesh.non_manifold_edges, "edge", /three faces or more/, "edges of three or more faces"],
    [mesh.misoriented_edges, "edge", /in the same direction/, "edges of opposite orientation"],
    [mesh.bow_tie_vertices, "vertex", /fans of faces/, "vertices of several fans of faces"],
  ];
}

/** Return a button that marks faults on the mesh, or ends this. */
function showing(faults: Faults, kind: Kind, title: string, sceneView: SceneView): HTMLElement {
  const shows = button("Show", () => {
    const isShown = shows.getAttribute("aria-pressed") === "true";
    for (const other of byId("report").querySelectorAll("[aria-pressed]"))
      other.setAttribute("aria-pressed", "false");
    shows.setAttribute("aria-pressed", String(!isShown));
    if (isShown) sceneView.showFaults([], []);
    else mark(faults.ids, kind, sceneView);
  });
  shows.setAttribute("aria-pressed", "false");
  shows.title = `Show ${title}`;
  shows.setAttribute("aria-label", shows.title);
  return shows;
}

/** Mark faults by their ids; the report lists the first ten of each kind. */
function mark(ids: Faults["ids"], kind: Kind, sceneView: SceneView): void {
  const mesh = sceneView.mesh;
  if (!mesh) return;
  const points = ids.map((id) => {
    if (Array.isArray(id)) return positionOf(mesh, { edge: id as [number, number], t: 0.5 });
    if (kind === "vertex") return mesh.vertex(id as number);
    return positionOf(mesh, { face: id as number, barycentric: [1 / 3, 1 / 3, 1 / 3] });
  });
  sceneView.showFaults(kind === "face" ? (ids as number[]) : [], points);
}
