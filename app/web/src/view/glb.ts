// What is drawn as a GLB file: the mesh with its colours, and lines on it, in mesh units.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshStandardMaterial,
} from "three";
import type { LoadedMesh } from "../mesh/loader";
import type { Palette } from "../state/state";
import { type Rgb, ramp } from "./colours";

export interface Drawn {
  mesh: LoadedMesh;
  palette: Palette;
  /** Values of the vertices, and those at the ends of the scale; null for a mesh without colours. */
  field: { values: ArrayLike<number>; least: number; largest: number } | null;
  lines: { name: string; points: readonly (readonly number[])[]; colour: Rgb }[];
}

const CLAY: Rgb = [0.72, 0.74, 0.78];

export async function glbOf({ mesh, palette, field, lines }: Drawn): Promise<Blob> {
  const { GLTFExporter } = await import("three/examples/jsm/exporters/GLTFExporter.js");
  const surface = new BufferGeometry();
  surface.setAttribute("position", new BufferAttribute(Float32Array.from(mesh.vertices), 3));
  surface.setAttribute("color", new BufferAttribute(coloursOf(mesh, palette, field), 3));
  surface.setIndex(mesh.geometry.getIndex());
  const scene = new Group();
  const paint = new MeshStandardMaterial({ vertexColors: true, side: DoubleSide });
  scene.add(named("surface", new Mesh(surface, paint)));
  for (const { name, points, colour } of lines) {
    const geometry = new BufferGeometry();
    const ends = points.slice(1).flatMap((point, i) => [...points[i]!, ...point]);
    geometry.setAttribute("position", new BufferAttribute(Float32Array.from(ends), 3));
    const material = new LineBasicMaterial({ color: linear(colour) });
    scene.add(named(name, new LineSegments(geometry, material)));
  }
  const file = await new GLTFExporter().parseAsync(scene, { binary: true });
  return new Blob([file as ArrayBuffer], { type: "model/gltf-binary" });
}

function named<T extends Mesh | LineSegments>(name: string, object: T): T {
  object.name = name;
  return object;
}

function coloursOf(mesh: LoadedMesh, palette: Palette, field: Drawn["field"]): Float32Array {
  const colours = ramp(palette).map(linear);
  const clay = linear(CLAY);
  const found = new Float32Array(mesh.vertices.length);
  for (let v = 0; v < found.length / 3; v++) {
    const share = field ? (field.values[v]! - field.least) / (field.largest - field.least) : NaN;
    const i = Math.round(Math.min(Math.max(share, 0), 1) * (colours.length - 1));
    (share < Infinity ? colours[i]! : clay).toArray(found, 3 * v);
  }
  return found;
}

/** Return a colour of the screen as glTF has them. */
function linear([r, g, b]: Rgb): Color {
  return new Color().setRGB(r, g, b, "srgb");
}
