// The mesh on the stage, with points, path, barriers and faults on it.

import type {
  Border,
  Boundary,
  Isoline,
  IsolinesAnswer,
  LogMap,
  MeshDocument,
  PathAnswer,
  StraightLine,
} from "geodesic-client";
import { Plane as CuttingPlane, Mesh, PlaneGeometry, Vector3 } from "three";
import { MeshBVH } from "three-mesh-bvh";
import { written } from "../dom";
import { frontOf, type Up } from "../mesh/frame";
import { type LoadedMesh, loadMesh } from "../mesh/loader";
import { drawnAt, type FacePoint, type IsHidden, isSeen, pick } from "../mesh/picking";
import { Plane } from "../mesh/plane";
import { blockedFaces } from "../state/barriers";
import { nameOf } from "../state/places";
import type { Section, State } from "../state/state";
import { type Rgb, territory } from "./colours";
import { IsolineLayer } from "./isolines";
import { Labels } from "./labels";
import { Markers } from "./markers";
import { Patch } from "./patch";
import { RouteLine } from "./route";
import { showScaleBar } from "./scalebar";
import type { Stage } from "./scene";
import type { Triple } from "./simplified";
import { Surface, surfacePaint } from "./surface";
import { Territories } from "./territories";

const START: Rgb = [0.09, 0.13, 0.24];
const END: Rgb = [0.9, 0, 0.36];
const STOP: Rgb = [0.96, 0.62, 0.04];
const FAULT: Rgb = [0.85, 0.1, 0.1];
const WALK: Rgb = [0.15, 0.39, 0.92];
const SPOT: Rgb = [1, 0.8, 0.1];
const BOUNDARY = 0xffa11f;
const ROUTE_LINE = 0xe6005c;
const WALK_LINE = 0x2563eb;

export class SceneView {
  readonly barriers: Patch;
  readonly region: Patch;
  readonly faults: Patch;
  mesh: LoadedMesh | null = null;
  surface: Surface | null = null;
  /** The colour of each territory; one without is coloured by its number. */
  hues: number[] = [];
  private readonly paint = surfacePaint();
  private tree: MeshBVH | null = null;
  private isHidden: IsHidden = () => false;
  private readonly points: Markers;
  private readonly faultPoints: Markers;
  private readonly isolines: IsolineLayer;
  private readonly rays: IsolineLayer;
  private readonly boundary: IsolineLayer;
  private readonly spot: Markers;
  private readonly route: RouteLine;
  private readonly walk: RouteLine;
  private readonly walkEnd: Markers;
  private readonly territories: Territories;
  private readonly labels: Labels;
  private readonly levels: Labels;
  private shownLevels: IsolinesAnswer["isolines"] = [];

  constructor(readonly stage: Stage) {
    this.barriers = new Patch(stage, 0x15181f, 0.82);
    this.region = new Patch(stage, 0xff8a1f, 0.6);
    this.faults = new Patch(stage, 0xd9121f, 0.9);
    this.isolines = new IsolineLayer(stage);
    this.rays = new IsolineLayer(stage);
    this.boundary = new IsolineLayer(stage, BOUNDARY, 2.6);
    this.route = new RouteLine(stage, ROUTE_LINE);
    this.walk = new RouteLine(stage, WALK_LINE);
    this.walkEnd = new Markers(stage);
    this.territories = new Territories(stage, this.paint);
    this.points = new Markers(stage);
    this.faultPoints = new Markers(stage);
    this.spot = new Markers(stage);
    this.warmUp();
    const isSeenNow = (position: Triple): boolean => this.isSeen(position);
    this.labels = new Labels(stage, "point-labels", isSeenNow);
    this.levels = new Labels(stage, "level-labels", isSeenNow);
    stage.onFrame = () => {
      showScaleBar(stage, (this.mesh?.plane ?? this.mesh?.frame)?.radius ?? null);
      this.labels.follow();
      this.levels.follow();
    };
  }

  async open(document: MeshDocument, up: Up | null, signal: AbortSignal): Promise<void> {
    const mesh = await loadMesh(document, up, signal);
    this.close();
    this.mesh = mesh;
    this.surface = new Surface(mesh, this.paint);
    const { array: positions } = mesh.geometry.getAttribute("position");
    const { array: normals } = mesh.geometry.getAttribute("normal");
    this.stage.shape = positions;
    this.stage.front.set(...frontOf(positions, normals));
    this.stage.fit(document.faces);
    this.stage.compass.isShown = true;
    this.stage.compass.name(mesh.frame.up);
    this.stage.add(this.surface.object);
    await this.stage.drawn();
    this.tree = await mesh.tree;
  }

  /** Unroll the surface into the plane of a log map. */
  unroll(logMap: LogMap): void {
    const { mesh, surface } = this;
    if (!mesh || !surface) return;
    mesh.plane = new Plane(mesh, logMap);
    surface.reshape();
    this.tree = new MeshBVH(mesh.shown, { indirect: true });
    this.stage.shape = mesh.shown.getAttribute("position").array;
    this.stage.front.set(0, 0, 1);
    this.stage.compass.isShown = false;
  }

  /** Draw everything once without extent, so that later nothing waits for its shader. */
  private warmUp(): void {
    const nowhere: Triple[] = [
      [0, 0, 0],
      [0, 0, 0],
    ];
    this.points.show([{ position: [0, 0, 0], fill: START, size: 0 }]);
    this.isolines.show({ drawnLines: () => [nowhere] }, [
      { points: nowhere, closed: false, faces: [] },
    ]);
    this.route.show([nowhere]);
    this.stage.warmUp(new Mesh(new PlaneGeometry(0, 0), this.paint));
    this.points.show([]);
    this.isolines.show(null, []);
    this.route.show([]);
  }

  close(): void {
    if (!this.mesh || !this.surface) return;
    this.stage.remove(this.surface.object);
    this.surface.dispose();
    this.mesh.dispose();
    this.mesh = this.surface = this.tree = null;
    for (const patch of [this.barriers, this.region, this.faults]) patch.show(null, []);
    this.points.show([]);
    this.labels.show([]);
    this.shownLevels = [];
    this.levels.show([]);
    this.stage.compass.isShown = false;
    this.faultPoints.show([]);
    this.isolines.show(null, []);
    this.rays.show(null, []);
    this.boundary.show(null, []);
    this.showSpot(null);
    this.route.show([]);
    this.showWalk(null);
    this.showBorders(new Int32Array(), []);
  }

  get isPickable(): boolean {
    return this.tree !== null;
  }

  /** Return the point of the surface under a place of the canvas, or null where there is none. */
  pick(x: number, y: number): FacePoint | null {
    const { mesh, tree } = this;
    return mesh && tree ? pick(mesh, tree, this.stage.camera, x, y, this.isHidden) : null;
  }

  /** Whether a drawn position of the surface is not hidden by it. */
  isSeen(position: Triple): boolean {
    return !this.tree || isSeen(this.tree, this.stage.camera, position, this.isHidden);
  }

  /** Show the surface in a light or flat, and only what a section leaves of it. */
  showLook({ flat, section }: Pick<State, "flat" | "section">): void {
    const { mesh, surface } = this;
    if (!mesh || !surface) return;
    surface.setLit(!flat);
    const plane = section && planeOf(mesh, section);
    this.stage.setSection(plane);
    this.isHidden = (position) => plane !== null && plane.distanceToPoint(position) < 0;
  }

  /** Show the whole mesh, from where the points can be seen if there are any. */
  lookAtAll({ places }: State): void {
    const mesh = this.mesh;
    const points = places.map(({ point }) => point).filter((point) => mesh?.has(point));
    if (!mesh || mesh.plane || points.length === 0) {
      this.stage.lookAtAll();
      return;
    }
    const normals = mesh.geometry.getAttribute("normal");
    const direction = new Vector3();
    for (const point of points) {
      const corner =
        "vertex" in point
          ? point.vertex
          : "edge" in point
            ? point.edge[0]
            : mesh.corners(point.face)[0];
      direction.add(new Vector3().fromBufferAttribute(normals, corner));
    }
    this.stage.lookAtAll(direction);
  }

  /** Show the points of the question: those that the mesh has. */
  showPoints(state: State): void {
    const { mesh } = this;
    const { places, starts, distances, shade, isReadable } = state;
    const hasTerritories = distances && shade === "territories";
    const shown = places.flatMap(({ point }, i) => {
      if (!mesh?.has(point) || !isReadable) return [];
      const isStop = i >= starts && i < places.length - 1;
      const fill = i < starts ? (hasTerritories ? this.colourOf(i) : START) : isStop ? STOP : END;
      const position = drawnAt(mesh, point);
      return { position, fill, size: isStop ? 14 : 17, name: nameOf(state, i) };
    });
    this.points.show(shown);
    this.labels.show(shown);
  }

  showBarriers(state: State): void {
    this.barriers.show(this.mesh, state.isReadable ? blockedFaces(state) : []);
  }

  showRoute(outline: PathAnswer | null): void {
    const { points, faces } = outline ?? {};
    this.route.show((this.mesh && points && this.mesh.drawnLines(points, faces ?? [])) || []);
  }

  /** Show a straight line, and a point at its end. */
  showWalk(line: Pick<StraightLine, "points" | "faces"> | null): void {
    const drawn =
      (this.mesh && line?.points && this.mesh.drawnLines(line.points, line.faces)) || [];
    this.walk.show(drawn);
    const end = drawn.at(-1)?.slice(-1) ?? [];
    this.walkEnd.show(end.map((position) => ({ position, fill: WALK, size: 13 })));
  }

  showRays(rays: Pick<Isoline, "points" | "faces">[]): void {
    this.rays.show(
      this.mesh,
      rays.map((ray) => ({ ...ray, closed: false })),
    );
  }

  showBoundary(lines: Boundary[]): void {
    this.boundary.show(this.mesh, lines);
  }

  /** Mark a position on the path; null: none. */
  showSpot(position: Triple | null): void {
    const { mesh } = this;
    this.spot.show(
      mesh && position && !mesh.plane
        ? [{ position: mesh.drawn(position), fill: SPOT, size: 15 }]
        : [],
    );
  }

  /** Label each level in the middle of its longest line, or none. */
  showLevels({ labels }: Pick<State, "labels">): void {
    const { mesh } = this;
    const shown = this.shownLevels.flatMap(({ level, lines }) => {
      const [longest] = lines.toSorted((a, b) => b.length - a.length);
      const [drawn = []] = mesh?.drawnLines(longest?.points ?? [], longest?.faces ?? []) ?? [];
      const position = drawn[Math.floor(drawn.length / 2)];
      return position ? { position, name: written(level, 3) } : [];
    });
    this.levels.show(labels ? shown : []);
    this.stage.invalidateOverlay();
  }

  /** Return the colour of the territory of a source. */
  colourOf(source: number): Rgb {
    return territory(this.hues[source] ?? source);
  }

  showIsolines(levels: IsolinesAnswer["isolines"]): void {
    this.shownLevels = levels;
    this.isolines.show(
      this.mesh,
      levels.flatMap(({ lines }) => lines),
    );
  }

  /** Show the borders of territories; ``nearest`` is the nearest source of each vertex. */
  showBorders(nearest: Int32Array, borders: Border[]): void {
    this.territories.show(this.mesh, nearest, borders, (source) => this.colourOf(source));
  }

  showFaults(faces: number[], points: [number, number, number][]): void {
    this.faults.show(this.mesh, faces);
    const marks = points.map((point) => ({
      position: this.mesh!.drawn(point),
      fill: FAULT,
      size: 13,
    }));
    this.faultPoints.show(marks);
  }
}

/** Return the plane of a section in drawn positions; its positive side is what is left. */
function planeOf(mesh: LoadedMesh, { axis, share }: Section): CuttingPlane {
  const [low, high] = mesh.document.bounds ?? [
    [0, 0, 0],
    [0, 0, 0],
  ];
  const at = "xyz".indexOf(axis);
  const ends = [low, high].map((corner) => new Vector3(...mesh.drawn(corner)));
  const [from = new Vector3(), to = new Vector3()] = ends;
  const along = low.map((x, i) => (i === at ? (high[i] ?? x) : x));
  const inwards = from
    .clone()
    .sub(new Vector3(...mesh.drawn(along)))
    .normalize();
  return new CuttingPlane().setFromNormalAndCoplanarPoint(inwards, from.lerp(to, share));
}
