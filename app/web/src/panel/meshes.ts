// Choosing a mesh: from a file, from a sample or from the store.
import type { About, ListedMesh, MeshDocument } from "geodesic-client";
import { byId, count } from "../dom";
import { InputError } from "../inputError";
import { NUMBERS } from "../mesh/values";
import { service } from "../service";
import { type Store, withMesh } from "../state/state";
import type { OnProgress, Status } from "../status";

/** Samples, with as many faces as are drawn smoothly. */
const SAMPLES: Record<string, number> = {
  knot: 30_000,
  sphere: 20_000,
  terrain: 40_000,
  cortex: 40_000,
  obstacles: 20_000,
};

/** What a file is that is no mesh, by its media type. The service tells what is wrong with others. */
const NO_MESHES: [RegExp, string][] = [
  [/^image\//, "an image"],
  [/^(audio|video)\//, "a recording"],
  [/^application\/(pdf|msword|vnd\.(ms-|oasis|openxml).*)$/, "a document"],
];
/** Texts by their names: the media type of a mesh may be that of a text. */
const TEXT = /\.(txt|md|csv|html?|log)$/i;

/** The value of the option that lists more of the store, and the start of those that make samples. */
const MORE = "more";
const SAMPLE = "sample:";

export class Meshes {
  /** Files of this visit by the id of their mesh, to send again with its vertices joined. */
  private readonly files = new Map<string, File>();
  private formats = "";
  /** Called with a file of numbers, while a mesh is open. */
  onNumbers: (file: File) => void = () => undefined;
  private readonly select = byId("meshes", HTMLSelectElement);
  private readonly samples = document.createElement("optgroup");

  constructor(
    private readonly store: Store,
    private readonly status: Status,
  ) {
    this.samples.label = "Samples";
    const file = byId("file", HTMLInputElement);
    for (const id of ["pick", "welcome-pick"])
      byId(id).addEventListener("click", () => file.click());
    file.addEventListener("change", () => {
      if (file.files?.[0]) this.take(file.files[0]);
      file.value = "";
    });
    this.select.addEventListener("change", () => {
      const id = this.select.value;
      if (id === MORE) this.listMore();
      else if (id.startsWith(SAMPLE)) this.make(id.slice(SAMPLE.length));
      else if (id) store.update(withMesh(id, store.state));
    });
    this.acceptDrops();
  }

  /** Name the formats that this service reads, and the samples that it makes. */
  offer({ samples, mesh_formats }: Pick<About, "samples" | "mesh_formats">): void {
    this.formats = mesh_formats.map((format) => format.toUpperCase()).join(", ");
    byId("welcome-formats").textContent = this.formats;
    const made = Object.keys(SAMPLES).filter((name) => (samples as string[]).includes(name));
    this.samples.replaceChildren(...made.map((name) => new Option(titleOf(name), SAMPLE + name)));
  }

  /** List the meshes of the store, and select the one that is open. */
  async list(): Promise<void> {
    const options = await this.listed(null);
    const title = options.length > 0 ? "In the store…" : "The store is empty";
    this.select.replaceChildren(new Option(title, ""), ...options, this.samples);
    this.showChosen();
  }

  showChosen(): void {
    this.select.value = this.store.state.mesh ?? "";
    if (this.select.selectedIndex < 0) this.select.value = ""; // the mesh is not listed yet
  }

  /** Replace the option that lists more by the meshes that come next. */
  private listMore(): void {
    const [last] = this.select.selectedOptions;
    this.showChosen();
    this.listed(last?.dataset.cursor ?? null).then(
      (options) => last?.replaceWith(...options),
      (error: unknown) => this.status.fail(error),
    );
  }

  private async listed(cursor: string | null): Promise<HTMLOptionElement[]> {
    const { meshes, next_cursor } = await service.meshes({
      limit: 100,
      ...(cursor !== null && { cursor }),
    });
    const options = meshes.map((mesh) => new Option(nameOf(mesh), mesh.id));
    if (next_cursor) {
      const more = new Option("More…", MORE);
      more.dataset.cursor = next_cursor;
      options.push(more);
    }
    return options;
  }

  /** Return what uploads the file of a mesh again, with its vertices joined; null without a file. */
  joiningOf(id: string): (() => void) | null {
    const file = this.files.get(id);
    return file ? () => this.upload(file, "exact") : null;
  }

  private upload(file: File, merge: "none" | "exact" = "none"): void {
    const refusal = refusalOf(file, this.formats);
    if (refusal) {
      this.status.fail(refusal);
      return;
    }
    this.create(`Uploading ${file.name}…`, async (onProgress, signal) => {
      const mesh = await service.upload(file, {
        merge,
        onProgress: (share) => onProgress(share < 1 ? share : null),
        signal,
      });
      this.files.set(mesh.id, file);
      return mesh;
    });
  }

  private make(name: string): void {
    this.showChosen();
    this.create(`Making ${titleOf(name)}…`, () => service.sample(name, SAMPLES[name]));
  }

  private create(
    words: string,
    make: (onProgress: OnProgress, signal: AbortSignal) => Promise<MeshDocument>,
  ): void {
    const stop = new AbortController();
    this.status.run("loading", words, stop, async (onProgress) => {
      const mesh = await make(onProgress, stop.signal);
      this.store.update(withMesh(mesh.id, this.store.state));
      await this.list();
    });
  }

  private acceptDrops(): void {
    const { classList } = document.body;
    document.addEventListener("dragover", (event) => {
      event.preventDefault();
      classList.add("dropping");
    });
    document.addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) classList.remove("dropping");
    });
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      classList.remove("dropping");
      const file = event.dataTransfer?.files[0];
      if (file) this.take(file);
    });
  }

  private take(file: File): void {
    if (this.store.state.mesh !== null && NUMBERS.test(file.name)) this.onNumbers(file);
    else this.upload(file);
  }
}

function titleOf(sample: string): string {
  return sample.slice(0, 1).toUpperCase() + sample.slice(1);
}

function nameOf({ id, name, faces }: ListedMesh): string {
  return `${name ?? id.slice(0, 8)}, ${count(faces, "face")}`;
}

/** Return why a file cannot be a mesh, judged by its name and type; null if it may be one. */
export function refusalOf(
  { name, type }: Pick<File, "name" | "type">,
  formats: string,
): InputError | null {
  const what = TEXT.test(name) ? "a text file" : NO_MESHES.find(([kind]) => kind.test(type))?.[1];
  if (!what) return null;
  return new InputError(
    "Not a mesh",
    `${name} is ${what}.`,
    formats && `This service reads ${formats}.`,
  );
}
