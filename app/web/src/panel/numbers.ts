// Files of numbers: values of vertices to draw, and costs of faces.
import { byId, count } from "../dom";
import { InputError } from "../inputError";
import { extremesOf, readNumbers } from "../mesh/values";
import type { State, Store, Values } from "../state/state";
import type { Status } from "../status";

export class Numbers {
  constructor(
    private readonly store: Store,
    private readonly status: Status,
    /** The numbers of vertices and faces of the mesh that is open, or null. */
    private readonly size: () => { vertices: number; faces: number } | null,
  ) {
    const file = byId("numbers", HTMLInputElement);
    for (const id of ["values-pick", "face-costs-pick"])
      byId(id).addEventListener("click", () => file.click());
    file.addEventListener("change", () => {
      if (file.files?.[0]) this.take(file.files[0]);
      file.value = "";
    });
    byId("values-remove").addEventListener("click", () =>
      store.update({ values: null, least: null, range: null }),
    );
    byId("face-costs-remove").addEventListener("click", () => store.update({ faceCosts: null }));
  }

  /** Take the numbers of a file for what there are as many of on the mesh. */
  take(file: File): void {
    this.status.run("busy", `Reading ${file.name}…`, new AbortController(), async () => {
      const size = this.size();
      if (!size)
        throw new InputError("No mesh is open", "Numbers belong to a mesh.", "Open it first.");
      const read = await readNumbers(file);
      const { length } = read.numbers;
      if (length === size.vertices) {
        this.store.update({ values: read, least: null, range: null });
      } else if (length === size.faces) {
        this.store.update({ faceCosts: costs(read) });
      } else {
        const here = `${count(size.vertices, "vertex", "vertices")} and ${count(size.faces, "face")}`;
        throw new InputError(
          "Numbers of another mesh",
          `${file.name} has ${count(length, "number")}, and this mesh ${here}.`,
          "Give one number for each vertex, to draw its values, or for each face, as its cost.",
        );
      }
    });
  }

  show({ values, faceCosts }: State): void {
    for (const [id, read] of [
      ["values", values],
      ["face-costs", faceCosts],
    ] as const) {
      byId(`${id}-row`).hidden = read === null;
      byId(`${id}-pick`).hidden = read !== null;
      byId(`${id}-name`).textContent = read?.name ?? "";
      byId(`${id}-remove`).setAttribute("aria-label", `Remove ${read?.name ?? ""}`);
    }
  }
}

/** Return costs of faces as they are, all above 0. */
function costs(read: Values): Values {
  const [least] = extremesOf(read.numbers);
  if (least > 0) return read;
  const face = read.numbers.findIndex((cost) => cost <= 0);
  throw new InputError(
    "Not costs of faces",
    `Face ${face} would cost ${read.numbers[face]}.`,
    "Costs are above 0; write nan where no path goes.",
  );
}
