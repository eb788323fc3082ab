// A mesh as an OBJ file.
import type { LoadedMesh } from "./loader";

/** Return a mesh as OBJ, with every digit of its vertices. */
export function objOf(mesh: LoadedMesh): Blob {
  const { vertices } = mesh;
  const lines: string[] = [];
  for (let i = 0; i < vertices.length; i += 3) {
    lines.push(`v ${vertices[i]} ${vertices[i + 1]} ${vertices[i + 2]}`);
  }
  for (let face = 0; face < mesh.document.faces; face++) {
    const [a, b, c] = mesh.corners(face);
    lines.push(`f ${a + 1} ${b + 1} ${c + 1}`);
  }
  return new Blob([lines.join("\n"), "\n"], { type: "model/obj" });
}
