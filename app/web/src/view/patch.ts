// A set of faces, painted over.
import { BufferAttribute, BufferGeometry, DoubleSide, Mesh, MeshBasicMaterial } from "three";
import type { LoadedMesh } from "../mesh/loader";
import type { Stage } from "./scene";
import { SECTION } from "./section";

export class Patch {
  private readonly object: Mesh<BufferGeometry, MeshBasicMaterial>;

  constructor(
    private readonly stage: Stage,
    colour: number,
    opacity: number,
  ) {
    const material = new MeshBasicMaterial({
      color: colour,
      transparent: true,
      opacity,
      side: DoubleSide,
      depthWrite: false,
      polygonOffset: true,
      polygonOffsetFactor: 0,
      polygonOffsetUnits: -200,
      clippingPlanes: SECTION,
    });
    this.object = new Mesh(new BufferGeometry(), material);
    this.object.renderOrder = 1;
    stage.add(this.object);
  }

  show(mesh: LoadedMesh | null, faces: Iterable<number>): void {
    this.object.geometry.dispose();
    const count = mesh ? mesh.document.faces : 0;
    const corners = [...faces]
      .filter((face) => face < count && mesh?.plane?.keeps(face) !== false)
      .flatMap((face) => mesh!.corners(face));
    const geometry = new BufferGeometry();
    if (mesh && corners.length > 0) {
      geometry.setAttribute("position", mesh.shown.getAttribute("position"));
      geometry.setIndex(new BufferAttribute(Uint32Array.from(corners), 1));
      geometry.boundingSphere = mesh.shown.boundingSphere;
    }
    this.object.geometry = geometry;
    this.object.visible = corners.length > 0;
    this.stage.invalidate();
  }
}
