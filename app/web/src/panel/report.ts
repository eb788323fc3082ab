// The report on a mesh in words, and its faults marked on the mesh.
import type { MeshDocument } from "../api/types";
import { button, byId, count, written } from "../dom";
import { positionOf } from "../mesh/picking";
import type { SceneView } from "../view/sceneView";

type Faults = MeshDocument["degenerate_faces"];
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
  for (const [faults, noun, plural, kind] of faultsOf(document_)) {
    if (faults.count === 0) continue;
    const line = row(count(faults.count, noun, plural), faults, kind, sceneView);
    if (join && faults === document_.duplicate_vertices) line.append(button("Join them", join));
    list.append(line);
  }
  for (const warning of document_.warnings) {
    const line = document.createElement("li");
    line.className = "warning";
    line.textContent = warning;
    list.append(line);
  }
  report.append(words, list);
}

function describe(mesh: MeshDocument, unit: string): string {
  const [low, high] = mesh.bounds;
  const size = high.map((x, i) => written(x - (low[i] ?? 0), 3)).join(" × ");
  const parts = mesh.components === 1 ? "one piece" : count(mesh.components, "piece");
  const rim =
    mesh.boundary_loops === 0
      ? "closed"
      : `with ${count(mesh.boundary_loops, "boundary", "boundaries")}`;
  return (
    `${count(mesh.vertices, "vertex", "vertices")}, ${count(mesh.faces, "face")}; ${parts}, ${rim}. ` +
    `${size} ${unit}, edges of ${written(mesh.mean_edge_length, 3)} on average.`
  );
}

function faultsOf(mesh: MeshDocument): [Faults, string, string, Kind][] {
  return [
    [
      mesh.non_manifold_edges,
      "edge of three or more faces",
      "edges of three or more faces",
      "edge",
    ],
    [
      mesh.misoriented_edges,
      "edge with faces of opposite orientation",
      "edges with faces of opposite orientation",
      "edge",
    ],
    [mesh.degenerate_faces, "face without area", "faces without area", "face"],
    [
      mesh.repeated_vertex_faces,
      "face that repeats a vertex",
      "faces that repeat a vertex",
      "face",
    ],
    [mesh.duplicate_faces, "duplicate face", "duplicate faces", "face"],
    [mesh.collapsed_faces, "collapsed face", "collapsed faces", "face"],
    [mesh.zero_length_edges, "edge of zero length", "edges of zero length", "edge"],
    [
      mesh.bow_tie_vertices,
      "vertex where several fans of faces meet",
      "vertices where several fans of faces meet",
      "vertex",
    ],
    [mesh.isolated_vertices, "vertex without a face", "vertices without a face", "vertex"],
    [mesh.duplicate_vertices, "duplicate vertex", "duplicate vertices", "vertex"],
  ];
}

function row(words: string, faults: Faults, kind: Kind, sceneView: SceneView): HTMLLIElement {
  const line = document.createElement("li");
  const text = document.createElement("span");
  text.textContent = words;
  const shows = button("Show", () => {
    const isShown = shows.getAttribute("aria-pressed") === "true";
    for (const other of byId("report").querySelectorAll("button"))
      other.setAttribute("aria-pressed", "false");
    shows.setAttribute("aria-pressed", String(!isShown));
    if (isShown) sceneView.showFaults([], []);
    else mark(faults.ids, kind, sceneView);
  });
  shows.setAttribute("aria-pressed", "false");
  shows.setAttribute("aria-label", `Show ${words}`);
  line.append(text, shows);
  return line;
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
