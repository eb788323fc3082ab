// The page's parts and their wiring: users change the state, and every part follows it.
import type { About, MeshDocument, PathAnswer } from "geodesic-client";
import { Borders } from "./ask/borders";
import { Boundaries } from "./ask/boundaries";
import { Fields } from "./ask/fields";
import { Isolines } from "./ask/isolines";
import { PathProofs } from "./ask/proofs";
import { Rays } from "./ask/rays";
import { Routes } from "./ask/routes";
import { Walks } from "./ask/walks";
import { byId, written } from "./dom";
import { Player } from "./film/player";
import { positionOf } from "./mesh/picking";
import { foldOnPhone, isDark, setFolded, setUpAppearance } from "./panel/appearance";
import { Controls, located } from "./panel/controls";
import { Cutting } from "./panel/cutting";
import { ExportPanel } from "./panel/exportPanel";
import { listenToKeys } from "./panel/keys";
import { Meshes } from "./panel/meshes";
import { Notes } from "./panel/notes";
import { Numbers } from "./panel/numbers";
import { PlaceList } from "./panel/placeList";
import { Pointer } from "./panel/pointer";
import { ProfileChart } from "./panel/profile";
import { Regions } from "./panel/regions";
import { showReport } from "./panel/report";
import { service } from "./service";
import { blockedFaces } from "./state/barriers";
import { readSample, readState, writeState } from "./state/permalink";
import { type State, Store, unitOf, withMesh } from "./state/state";
import { Status } from "./status";
import type { Rgb } from "./view/colours";
import { drawRamp } from "./view/legend";
import { Stage } from "./view/scene";
import { SceneView } from "./view/sceneView";

const ADDRESS_DELAY_MS = 250; // browsers limit changes of the address to a hundred in half a minute

/** Colours of lines in files. */
const ROUTE: Rgb = [0.9, 0, 0.36];
const ISOLINE: Rgb = [0.1, 0.12, 0.16];

const stage = new Stage(byId("canvas", HTMLCanvasElement));
const sceneView = new SceneView(stage);
const status = new Status(() => stage.drawn());
const store = new Store();
const notes = new Notes();
const fields = new Fields(status, sceneView, notes);
const isolines = new Isolines(status, sceneView, fields, notes);
const borders = new Borders(status, sceneView, fields, notes);
const rays = new Rays(status, sceneView, fields, notes);
const boundaries = new Boundaries(status, sceneView, notes);
const walks = new Walks(status, sceneView, notes);
const routes = new Routes(status, sceneView, notes);
const meshes = new Meshes(store, status);
const controls = new Controls(store, status, sceneView, notes);
const placeList = new PlaceList(store);
const proofs = new PathProofs(store, status, () => sceneView.mesh);
const profile = new ProfileChart((position) => sceneView.showSpot(position));
const numbers = new Numbers(store, status, () => sceneView.mesh?.document ?? null);
const cutting = new Cutting(
  store,
  status,
  notes,
  () => ({
    path: routes.outline,
    walk: walks.line,
    largest: fields.of(store.state)?.largest ?? 0,
    up: sceneView.mesh?.frame.up ?? null,
    view: stage.view,
  }),
  () => meshes.list(),
);
new Regions(store, status, notes);
const exportPanel = new ExportPanel(store, status, sceneView);
const player = new Player(store, status, sceneView, () => {
  fields.paint(store.state);
  void showWires(store.state);
});
const pointer = new Pointer(sceneView, store, () => controls.tool);
pointer.onHover = (point) => {
  fields.tell(point, store.state);
  tellWhere(sceneView.mesh && point && positionOf(sceneView.mesh, point));
};
isolines.onDraw = () => sceneView.showLevels(store.state);
listenToKeys(store, status, sceneView, pointer);
drawRamp(store.state.palette);
exportPanel.largest = () => fields.of(store.state)?.largest ?? 0;
exportPanel.nearest = () => routes.source;
exportPanel.drawn = () => {
  const { mesh } = sceneView;
  const path = routes.outline?.points ?? [];
  return (
    mesh && {
      ...{ mesh, palette: store.state.palette, field: fields.scale(store.state) },
      lines: [
        ...(path.length > 1 ? [{ name: "path", points: path, colour: ROUTE }] : []),
        ...isolines.lines.map(({ points, closed }) => ({
          ...{ name: "isoline", colour: ISOLINE },
          points: closed ? [...(points ?? []), ...(points ?? []).slice(0, 1)] : (points ?? []),
        })),
      ],
    }
  );
};
controls.usualSpacing = () => Number(((exportPanel.largest() || 1) / 20).toPrecision(1));
meshes.onNumbers = (file) => numbers.take(file);
routes.onDraw = (outline) => {
  proofs.follow(outline);
  showProfile(outline);
  cutting.show();
};
stage.onMove = (view) => store.replace({ view, up: sceneView.mesh?.frame.up ?? null });
fields.onPaint = (state) => {
  isolines.follow(state);
  borders.follow(state);
  rays.follow(state);
  cutting.show();
  player.redraw();
  pointer.rehover();
};
setUpAppearance(() => void showWires(store.state));

controls.show(store.state);
placeList.show(store.state, null);

let opening = new AbortController();
const stories = byId("stories", HTMLDetailsElement);
/** The mesh that is shown. */
let report: MeshDocument | null = null;

store.listen((state, before) => {
  if (
    state.mesh !== null &&
    (state.mesh !== before.mesh || isTurned(state) || isUnrolled(state, before))
  )
    open(state.mesh);
  if (state.mesh !== before.mesh || pointer.wasExample(before)) makeRoom();
  if (state.places !== before.places) notes.tell("points", []);
  controls.show(state);
  placeList.show(state, before);
  exportPanel.show(state);
  fields.follow(state);
  routes.follow(state);
  walks.follow(state);
  boundaries.follow(state);
  numbers.show(state);
  cutting.show();
  player.follow(state);
  if (state.unit !== before.unit) nameUnit(state);
  const paints = ["range", "least", "values"] as const;
  if (paints.some((each) => state[each] !== before[each])) fields.paint(state);
  if (state.palette !== before.palette) showPalette(state);
  if (state.lines !== before.lines) isolines.follow(state);
  if (state.polar !== before.polar) rays.follow(state);
  if (state.labels !== before.labels) sceneView.showLevels(state);
  if (state.flat !== before.flat || state.section !== before.section) sceneView.showLook(state);
  if (state.wireframe !== before.wireframe) void showWires(state);
  if (sceneView.mesh) sceneView.showPoints(state);
  if (state.barriers !== before.barriers || state.isReadable !== before.isReadable)
    sceneView.showBarriers(state);
  pointer.follow();
  writeAddress();
});

/** Fold what is not used now: there is a mesh, or a question. */
function makeRoom(): void {
  if (pointer.isExample) return;
  stories.open = false;
  foldOnPhone();
}

function nameUnit(state: State): void {
  fields.paint(state);
  if (report) showReport(report, sceneView, unitOf(state), meshes.joiningOf(report.id));
}

/** Tell the coordinates of the position under the pointer; null: none. */
function tellWhere(position: readonly number[] | null): void {
  byId("where").hidden = position === null;
  const named = position?.map((x, axis) => `${"xyz"[axis]} ${written(x, 4)}`);
  byId("where").textContent = named?.join("  ") ?? "";
}

function showProfile(outline: PathAnswer | null): void {
  profile.show(outline, sceneView.mesh?.frame.up ?? "y", unitOf(store.state));
}

function showPalette({ palette }: State): void {
  drawRamp(palette);
  sceneView.surface?.setPalette(palette);
  stage.invalidate();
}

/** Whether another axis is to point upwards than is drawn. */
function isTurned({ up }: State): boolean {
  const drawn = sceneView.mesh?.frame.up;
  return drawn !== undefined && up !== null && up !== drawn;
}

/** Whether the surface is to be unrolled, or rolled up, otherwise than before. */
function isUnrolled(state: State, before: State): boolean {
  const asked = (each: State): string => JSON.stringify(each.unroll && unrollingOf(each));
  return asked(state) !== asked(before);
}

function unrollingOf(state: State) {
  const { places, maxDistance } = state;
  const [first] = places;
  if (!first) return null;
  return { source: first.point, barriers: blockedFaces(state), maxDistance };
}

/** Load a mesh, and draw on it the answers that have arrived by then. */
function open(mesh: string): void {
  opening.abort();
  meshes.showChosen();
  byId("welcome").hidden = true;
  sceneView.close();
  isolines.forget();
  borders.forget();
  rays.forget();
  boundaries.forget();
  report = null;
  notes.begin(report);
  showReport(report, sceneView, "", null);
  const stop = new AbortController();
  opening = stop;
  status.run("loading", "Loading the mesh…", stop, async (onProgress) => {
    const document = await service.mesh(mesh, { signal: stop.signal });
    await sceneView.open(document, store.state.up, stop.signal);
    stop.signal.throwIfAborted();
    const unrolling = store.state.unroll ? unrollingOf(store.state) : null;
    if (unrolling) {
      const { source, ...question } = unrolling;
      const call = { onProgress, signal: stop.signal };
      const logMap = await service.logMap(mesh, source, { ...question, ...call });
      stop.signal.throwIfAborted();
      sceneView.unroll(logMap);
    }
    controls.showUp(sceneView.mesh?.frame.up ?? "y");
    const now = store.state;
    if (now.view) stage.look(now.view);
    else sceneView.lookAtAll(now);
    report = document;
    notes.begin(report);
    showReport(report, sceneView, unitOf(now), meshes.joiningOf(mesh));
    pointer.explain();
    sceneView.showPoints(now);
    sceneView.showBarriers(now);
    fields.paint(now);
    routes.draw();
    walks.draw();
    boundaries.follow(now);
    showPalette(now);
    sceneView.showLook(now);
    await showWires(now);
  });
}

async function showWires({ wireframe }: State): Promise<void> {
  await sceneView.surface?.setWireframe(wireframe, isDark() ? [1, 1, 1] : [0.05, 0.07, 0.12]);
  stage.invalidate();
}

// Whether the address is behind the state: an attribute, so that tests can wait for it as well.
const { dataset } = document.documentElement;
function writeAddress(): void {
  if (dataset.addressDue) return;
  dataset.addressDue = "true";
  setTimeout(setAddress, ADDRESS_DELAY_MS);
}

function setAddress(): void {
  delete dataset.addressDue;
  history.replaceState(null, "", writeState(store.state));
}

/** Read the address, and show what it asks for. */
function begin(): void {
  status.run("loading", "Loading…", new AbortController(), async () => {
    const about = await service.about();
    meshes.offer(about);
    exportPanel.offer(about);
    void meshes.list().catch((error: unknown) => status.fail(error));
    const sample = readSample(location.search);
    const mesh = sample
      ? await makeListed(...sample)
      : new URLSearchParams(location.search).get("mesh");
    if (mesh === null) {
      if (store.state.mesh === null) await greet(about);
      return;
    }
    const isOpen = mesh === store.state.mesh;
    try {
      const asked = await located(mesh, { ...readState(location.search), mesh });
      store.replace(asked.change);
      notes.tell("points", asked.notes);
    } catch (error) {
      store.replace(withMesh(mesh, store.state)); // without the question that cannot be read
      throw error;
    } finally {
      if (isOpen) open(mesh); // without a valid key it was not loaded the first time
    }
  });
}

/** Say what this is, and show an example or, without samples, that there is no mesh yet. */
async function greet({ samples }: About): Promise<void> {
  stories.open = true;
  setFolded(false);
  byId("welcome").hidden = samples.includes("knot");
  if (samples.includes("knot")) await showExample();
}

/** Show a sample that is coloured already; until the first click its path follows the pointer. */
async function showExample(): Promise<void> {
  const mesh = await makeListed("knot", 30_000);
  if (store.state.mesh !== null) return; // another was chosen meanwhile
  const [a, b] = [0, 9000].map((vertex) => ({ point: { vertex }, name: "" }));
  if (a && b) pointer.showExample([a, b], { mesh });
}

/** Make a sample that the list of meshes has, and return its id. */
async function makeListed(name: string, faces: number): Promise<string> {
  const { id } = await service.sample(name, faces);
  await meshes.list();
  return id;
}

status.onKey = () => {
  if (dataset.addressDue) setAddress();
  begin();
};
begin();
