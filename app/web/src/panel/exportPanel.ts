// Exports: links, commands, files and a picture.
import type { About } from "geodesic-client";
import { bordersOf } from "../ask/borders";
import { questionOf } from "../ask/fields";
import { isolinesOf } from "../ask/isolines";
import { button, byId, download } from "../dom";
import { objOf } from "../mesh/obj";
import { service } from "../service";
import { writeState } from "../state/permalink";
import { endOf, startsOf } from "../state/places";
import type { Point } from "../state/point";
import type { State, Store } from "../state/state";
import type { Status } from "../status";
import { type Drawn, glbOf } from "../view/glb";
import type { SceneView } from "../view/sceneView";
import { svgOf } from "../view/svg";
import { curlOf, pathOf, pythonOf } from "./snippets";

type Product = "distances" | "path" | "isolines" | "borders";

const FORMATS: Record<Product, string[]> = {
  distances: ["npy", "csv", "ply"],
  path: ["obj", "csv"],
  isolines: ["obj", "csv"],
  borders: ["obj", "csv"],
};

export class ExportPanel {
  private formats: string[] = [];

  constructor(
    private readonly store: Store,
    private readonly status: Status,
    view: SceneView,
  ) {
    const { stage } = view;
    const hasKey = (): boolean => service.apiKey !== null;
    onCopy(
      "copy-link",
      "The link",
      () => new URL(writeState({ ...store.state, view: stage.view }), service.address).href,
    );
    onCopy("copy-curl", "The command", () =>
      curlOf(store.state, this.source(), service.address, hasKey()),
    );
    onCopy("copy-python", "The program", () =>
      pythonOf(store.state, this.source(), service.address, hasKey()),
    );
    byId("picture").addEventListener("click", () => {
      stage.picture().toBlob((blob) => blob && download(blob, "geodesic.png"), "image/png");
    });
    byId("svg").addEventListener("click", () => {
      const svg = svgOf(stage, (position) => view.isSeen(position));
      download(svg, "geodesic.svg");
    });
    byId("glb").addEventListener("click", () => {
      status.run("busy", "Writing what is drawn…", new AbortController(), async () => {
        const drawn = this.drawn();
        if (drawn) download(await glbOf(drawn), "geodesic.glb");
      });
    });
    byId("obj").addEventListener("click", () => {
      const mesh = this.drawn()?.mesh;
      if (mesh) download(objOf(mesh), "mesh.obj");
    });
    byId("geojson").addEventListener("click", () => {
      const lines = this.drawn()?.lines ?? [];
      const features = lines.map(({ name, points }) => ({
        type: "Feature",
        properties: { name },
        geometry: { type: "LineString", coordinates: points },
      }));
      const text = JSON.stringify({ type: "FeatureCollection", features });
      download(new Blob([text], { type: "application/geo+json" }), "geodesic.geojson");
    });
  }

  /** Offer the formats that the service writes, and name the others. */
  offer({ answer_formats }: Pick<About, "answer_formats">): void {
    this.formats = Object.keys(answer_formats);
    const lacking = new Set<string>();
    for (const what of ["distances", "path", "isolines", "borders"] as const) {
      const offered = FORMATS[what].filter((format) => this.formats.includes(format));
      for (const format of FORMATS[what]) {
        if (!offered.includes(format)) lacking.add(format);
      }
      byId(`download-${what}`).replaceChildren(
        ...offered.map((format) => {
          const choice = button(format.toUpperCase(), () => this.save(what, format));
          choice.setAttribute("aria-label", `Download ${what} as ${format.toUpperCase()}`);
          return choice;
        }),
      );
    }
    if (lacking.size > 0) {
      note(`This service does not offer ${[...lacking].join(", ").toUpperCase()}.`);
    }
    this.show(this.store.state);
  }

  /** Enable the exports that ``state`` has answers for. */
  show(state: State): void {
    const hasField = state.mesh !== null && state.places.length > 0 && state.isReadable;
    const has = {
      distances: hasField,
      path: hasField && endOf(state) !== null,
      isolines: hasField && state.lines !== null,
      borders: hasField && state.starts > 1,
    };
    for (const [what, isThere] of Object.entries(has)) {
      for (const choice of byId(`download-${what}`).querySelectorAll("button"))
        choice.disabled = !isThere;
    }
    for (const id of ["copy-curl", "copy-python"]) byId(id, HTMLButtonElement).disabled = !hasField;
    for (const id of ["picture", "svg", "glb", "geojson", "obj"]) {
      byId(id, HTMLButtonElement).disabled = state.mesh === null;
    }
  }

  private save(what: Product, format: string): void {
    const stop = new AbortController();
    this.status.run("busy", `Fetching ${what}…`, stop, async () => {
      const { mesh } = this.store.state;
      if (mesh === null) return;
      download(await this.fileOf(mesh, what, format, stop.signal), `${what}.${format}`);
    });
  }

  private fileOf(mesh: string, what: Product, format: string, signal: AbortSignal): Promise<Blob> {
    const { state } = this.store;
    const [target, lines] = [endOf(state), state.lines];
    if (what === "path" && target) {
      return service.file(mesh, what, { ...pathOf(state, this.source(), target), signal }, format);
    }
    if (what === "borders") {
      return service.file(mesh, what, { ...bordersOf(state), signal }, format);
    }
    if (what === "isolines" && lines) {
      const question = isolinesOf(state, lines, this.largest());
      return service.file(mesh, what, { ...question, signal }, format);
    }
    const question = questionOf(state, state.method);
    return service.file(mesh, "distances", { ...question, signal }, format);
  }

  /** Return what is drawn, in mesh units. */
  drawn: () => Drawn | null = () => null;

  /** Return the largest distance that is drawn. */
  largest: () => number = () => 0;

  /** Return the start of the path that is drawn, or null. */
  nearest: () => Point | null = () => null;

  private source(): Point {
    const source = this.nearest() ?? startsOf(this.store.state)[0];
    if (!source) throw new Error("There is no source yet.");
    return source;
  }
}

function onCopy(id: string, what: string, text: () => string): void {
  byId(id).addEventListener("click", () => {
    navigator.clipboard.writeText(text()).then(
      () => note(`${what} is on the clipboard.`),
      () => note("The browser did not let this page write to the clipboard."),
    );
  });
}

function note(words: string): void {
  byId("export-note").textContent = words;
}
