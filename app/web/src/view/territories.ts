// Territories: borders as lines, and the faces that they cross, coloured on either side.

import type { Border } from "geodesic-client";
import { BufferAttribute, BufferGeometry, Mesh, type ShaderMaterial } from "three";
import { divide, type Piece } from "../mesh/division";
import type { LoadedMesh } from "../mesh/loader";
import { placeIn } from "../mesh/plane";
import type { Rgb } from "./colours";
import { IsolineLayer } from "./isolines";
import { LINES, type Stage } from "./scene";
import { inFront } from "./surface";

export class Territories {
  private readonly lines: IsolineLayer;
  private readonly object: Mesh<BufferGeometry, ShaderMaterial>;

  constructor(
    private readonly stage: Stage,
    paint: ShaderMaterial,
  ) {
    this.lines = new IsolineLayer(stage);
    this.object = new Mesh(new BufferGeometry(), inFront(paint));
    this.object.visible = false;
    this.object.layers.set(LINES);
    stage.add(this.object);
  }

  /** Show borders on a mesh that is coloured by ``nearest``, the nearest source of each vertex. */
  show(
    mesh: LoadedMesh | null,
    nearest: Int32Array,
    borders: Border[],
    colourOf: (source: number) => Rgb,
  ): void {
    this.lines.show(mesh, borders);
    this.object.geometry.dispose();
    this.object.geometry = mesh ? divided(mesh, nearest, borders, colourOf) : new BufferGeometry();
    this.object.visible = mesh !== null && borders.length > 0;
    this.stage.invalidate();
  }
}

/** Return the faces that borders cross, in parts of one colour each. */
function divided(
  mesh: LoadedMesh,
  nearest: Int32Array,
  borders: Border[],
  colourOf: (source: number) => Rgb,
): BufferGeometry {
  const whole = mesh.shown;
  const [positions, normals, values] = ["position", "normal", "value"].map((name) =>
    whole.getAttribute(name),
  );
  const drawn: Record<"position" | "normal" | "value" | "tint", number[]> = {
    position: [],
    normal: [],
    value: [],
    tint: [],
  };
  for (const [face, pieces] of piecesByFace(mesh, borders)) {
    const corners = mesh.corners(face);
    const sources = corners.map((corner) => nearest[corner]!);
    if (sources.some((source) => source < 0) || mesh.plane?.keeps(face) === false) continue;
    for (const { places, source } of divide(sources, pieces)) {
      for (const [v, w] of places) {
        const weights = [1 - v - w, v, w];
        const at = (attribute: typeof positions, axis: number): number =>
          weights.reduce(
            (sum, weight, i) =>
              sum + weight * attribute!.array[attribute!.itemSize * corners[i]! + axis]!,
            0,
          );
        drawn.position.push(at(positions, 0), at(positions, 1), at(positions, 2));
        drawn.normal.push(at(normals, 0), at(normals, 1), at(normals, 2));
        drawn.value.push(at(values, 0));
        drawn.tint.push(...colourOf(source));
      }
    }
  }
  const geometry = new BufferGeometry();
  for (const [name, numbers] of Object.entries(drawn)) {
    const size = name === "value" ? 1 : 3;
    geometry.setAttribute(name, new BufferAttribute(Float32Array.from(numbers), size));
  }
  geometry.boundingSphere = whole.boundingSphere;
  return geometry;
}

/** Return the pieces of borders in each face. */
function piecesByFace(mesh: LoadedMesh, borders: Border[]): Map<number, Piece[]> {
  const found = new Map<number, Piece[]>();
  for (const { points, faces, sources } of borders) {
    if (!points) continue; // of a mesh without positions, which is not drawn
    let last: Piece | null = null;
    faces.forEach((face, i) => {
      const next = points[(i + 1) % points.length]!;
      if (last === null || face !== faces[i - 1]) {
        last = { places: [placeIn(mesh, face, points[i]!)], sources };
        const others = found.get(face);
        if (others) others.push(last);
        else found.set(face, [last]);
      }
      last.places.push(placeIn(mesh, face, next));
    });
  }
  return found;
}
