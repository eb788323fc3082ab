// The page's parts and their wiring: users change the state, and every part follows it.
import { getMesh, makeSample } from "./api/meshes";
import { getAbout } from "./api/queries";
import type { MeshDocument } from "./api/types";
import { Borders } from "./ask/borders";
import { Fields } from "./ask/fields";
import { Isolines } from "./ask/isolines";
import { Rays } from "./ask/rays";
import { Routes } from "./ask/routes";
import { Walks } from "./ask/walks";
import { byId } from "./dom";
import { Player } from "./film/player";
import {
  dismissHint,
  foldOnPhone,
  isDark,
  setUpAppearance,
  showHint,
  tell,
} from "./panel/appearance";
import { Controls, located } from "./panel/controls";
import { ExportPanel } from "./panel/exportPanel";
import { listenToKeys } from "./panel/keys";
import { Meshes } from "./panel/meshes";
import { Notes } from "./panel/notes";
import { Pointer } from "./panel/pointer";
import { showReport } from "./panel/report";
import { readState, writeState } from "./state/permalink";
import { type State, Store, unitOf, withMesh } from "./state/state";
import { Status } from "./status";
import { drawRamp } from "./view/legend";
import { Stage } from "./view/scene";
import { SceneView } from "./view/sceneView";

const ADDRESS_DELAY_MS = 250; // browsers limit changes of the address to a hundred in half a minute

const stage = new Stage(byId("canvas", HTMLCanvasElement));
const sceneView = new SceneView(stage);
const status = new Status(() => stage.drawn());
const store = new Store();
const notes = new Notes();
const fields = new Fields(status, sceneView, notes);
const isolines = new Isolines(status, sceneView, fields, notes);
const borders = new Borders(status, sceneView, fields, notes);
const rays = new Rays(status, sceneView, fields, notes);
const walks = new Walks(status, sceneView, notes);
const routes = new Routes(status, sceneView, notes);
const meshes = new Meshes(store, status);
const controls = new Controls(store, status, sceneView, notes);
const exportPanel = new ExportPanel(store, status, stage);
const player = new Player(store, status, sceneView, () => {
  fields.paint(store.state);
  void showWires(store.state);
});
const pointer = new Pointer(sceneView, store, () => controls.tool);
pointer.onHover = (point) => fields.tell(point, store.state);
listenToKeys(store, status, sceneView, pointer);
drawRamp(store.state.palette);
exportPanel.largest = () => fields.of(store.state)?.largest ?? 0;
exportPanel.nearest = () => routes.source;
controls.usualSpacing = () => Number(((exportPanel.largest() || 1) / 20).toPrecision(1));
stage.onMove = (view) => store.update({ view, up: sceneView.mesh?.frame.up ?? null });
fields.onPaint = (state) => {
  isolines.follow(state);
  borders.follow(state);
  rays.follow(state);
  player.redraw();
};
setUpAppearance(() => void showWires(store.state));

controls.show(store.state);

let opening = new AbortController();
/** The mesh that is shown. */
let report: MeshDocument | null = null;

store.listen((state, before) => {
  if (state.mesh !== null && (state.mesh !== before.mesh || isTurned(state))) open(state.mesh);
  if (before.mesh !== null && state.mesh !== before.mesh) pointer.follows = false;
  if (state.mesh !== before.mesh) foldOnPhone();
  tell("");
  if (arePointsOther(state, before)) notes.tell("points", []);
  controls.show(state);
  exportPanel.show(state);
  fields.follow(state);
  routes.follow(state);
  walks.follow(state);
  player.follow(state);
  if (state.unit !== before.unit) nameUnit(state);
  if (state.range !== before.range) fields.paint(state);
  if (state.palette !== before.palette) showPalette(state);
  if (state.lines !== before.lines) isolines.follow(state);
  if (state.polar !== before.polar) rays.follow(state);
  if (state.wireframe !== before.wireframe) void showWires(state);
  if (state.sources.length > 0 && !pointer.follows) dismissHint();
  if (sceneView.mesh) sceneView.showPoints(state);
  if (state.barriers !== before.barriers || state.isReadable !== before.isReadable)
    sceneView.showBarriers(state);
  writeAddress();
});

function arePointsOther(now: State, before: State): boolean {
  return (["sources", "target", "waypoints"] as const).some((each) => now[each] !== before[each]);
}

function nameUnit(state: State): void {
  fields.paint(state);
  if (report) showReport(report, sceneView, unitOf(state), meshes.joiningOf(report.id));
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

/** Load a mesh, and draw on it the answers that have arrived by then. */
function open(mesh: string): void {
  opening.abort();
  meshes.showChosen();
  byId("welcome").hidden = true;
  sceneView.close();
  isolines.forget();
  borders.forget();
  rays.forget();
  report = null;
  notes.begin(report);
  showReport(report, sceneView, "", null);
  const stop = new AbortController();
  opening = stop;
  status.run("loading", "Loading the mesh…", stop, async () => {
    const document = await getMesh(mesh);
    await sceneView.open(document, store.state.up, stop.signal);
    stop.signal.throwIfAborted();
    controls.showUp(sceneView.mesh?.frame.up ?? "y");
    const now = store.state;
    stage.look(now.view ?? sceneView.viewOf(now));
    report = document;
    notes.begin(report);
    showReport(report, sceneView, unitOf(now), meshes.joiningOf(mesh));
    if (now.sources.length === 0 || pointer.follows) showHint();
    sceneView.showPoints(now);
    sceneView.showBarriers(now);
    fields.paint(now);
    routes.draw();
    walks.draw();
    showPalette(now);
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
    const about = await getAbout();
    meshes.offer(about);
    exportPanel.offer(about);
    void meshes.list().catch((error: unknown) => status.fail(error));
    const mesh = new URLSearchParams(location.search).get("mesh");
    const isEmpty = mesh === null && store.state.mesh === null;
    byId("welcome").hidden = !isEmpty;
    if (isEmpty && about.samples.includes("knot")) await showExample();
    if (mesh === null) return;
    const isOpen = mesh === store.state.mesh;
    try {
      const asked = await located(mesh, readState(location.search));
      store.update(asked.change);
      notes.tell("points", asked.notes);
    } catch (error) {
      store.update(withMesh(mesh, store.state)); // without the question that cannot be read
      throw error;
    } finally {
      if (isOpen) open(mesh); // without a valid key it was not loaded the first time
    }
  });
}

/** Show a sample that is coloured already; until the first click its path follows the pointer. */
async function showExample(): Promise<void> {
  const { id } = await makeSample("knot", 30_000);
  await meshes.list();
  if (store.state.mesh !== null) return; // another was chosen meanwhile
  pointer.follows = true;
  store.update({ mesh: id, sources: [{ vertex: 0 }], target: { vertex: 9000 } });
}

status.onKey = () => {
  if (dataset.addressDue) setAddress();
  begin();
};
begin();
