// Fields and switches: they show the state and change it.
import type { Effort, Method } from "geodesic-client";
import { hasCost } from "../ask/costs";
import { versusOf } from "../ask/fields";
import { byId, query, written } from "../dom";
import type { Up } from "../mesh/frame";
import { service } from "../service";
import { LONGEST_UNIT, readState, type WrittenState, writeBarriers } from "../state/permalink";
import { nameOf, type Place, type Tool } from "../state/places";
import type { Point } from "../state/point";
import { parsePlaces, pointOf, type WrittenPoint, writePlaces } from "../state/point";
import {
  INITIAL,
  type Lines,
  NO_QUESTION,
  type Palette,
  RULES,
  type Shade,
  type State,
  type Store,
} from "../state/state";
import type { Status } from "../status";
import type { SceneView } from "../view/sceneView";
import type { Notes } from "./notes";

/** Positions that are this many edges from the surface, at most, are on it: they were rounded. */
const FAR = 0.1;

/** Azimuth and polar angle of the usual views. */
const LOOKS = [
  ["front", 0, Math.PI / 2],
  ["top", 0, 0.001],
  ["iso", Math.PI / 4, Math.acos(1 / Math.sqrt(3))],
] as const;

type Question = Pick<WrittenState, "places" | "starts" | "walk" | "barriers" | "maxDistance">;

export class Controls {
  private reading = new AbortController();

  constructor(
    private readonly store: Store,
    private readonly status: Status,
    sceneView: SceneView,
    private readonly notes: Notes,
  ) {
    byId("question").addEventListener("submit", (event) => {
      event.preventDefault();
      this.readQuestion();
    });
    byId("question").addEventListener("change", () => this.readQuestion());
    byId("clear").addEventListener("click", () => store.update(NO_QUESTION));
    byId("undo").addEventListener("click", () => store.undo());
    byId("redo").addEventListener("click", () => store.redo());
    byId("distances").addEventListener("change", () =>
      store.update({ distances: byId("distances", HTMLInputElement).checked }),
    );
    onChoice("methods", (method) => store.update({ method: method as Method }));
    onChoice("ups", (up) => store.update({ up: up as Up, view: null }));
    onChoice("shades", (shade) => store.update({ shade: shade as Shade }));
    const slider = byId("error-slider", HTMLInputElement);
    slider.addEventListener("input", () => showError(errorOf(slider)));
    slider.addEventListener("change", () =>
      store.update({ error: errorOf(slider), method: "approximate" }),
    );
    byId("effort").addEventListener("change", () => {
      const effort = Number(byId("effort", HTMLSelectElement).value) as Effort;
      store.update({ effort, method: "fast" });
    });
    byId("lines").addEventListener("change", () => this.readLines(true));
    byId("lines-value").addEventListener("change", () => this.readLines(false));
    byId("boundary").addEventListener("change", () =>
      store.update({ boundary: byId("boundary", HTMLInputElement).checked }),
    );
    byId("versus").addEventListener("change", () => {
      const versus = byId("versus", HTMLSelectElement).value as Method;
      store.update({ versus, shade: "difference" });
    });
    byId("slope").addEventListener("change", () => {
      const rule = RULES.find((each) => each === byId("slope", HTMLSelectElement).value);
      const up = sceneView.mesh?.frame.up ?? "z";
      store.update({ slope: rule ? { rule, up } : null });
    });
    byId("polar").addEventListener("change", () => {
      const polar = byId("polar", HTMLInputElement).checked;
      store.update({ polar, lines: store.state.lines ?? (polar ? INITIAL.lines : null) });
    });
    byId("palette").addEventListener("change", () =>
      store.update({ palette: byId("palette", HTMLSelectElement).value as Palette }),
    );
    for (const end of ["least", "range"] as const) {
      byId(end).addEventListener("change", () => {
        const value = byId(end, HTMLInputElement).valueAsNumber;
        store.update({ [end]: Number.isFinite(value) ? value : null });
      });
    }
    const unit = byId("unit", HTMLInputElement);
    unit.maxLength = LONGEST_UNIT;
    unit.addEventListener("change", () => store.update({ unit: unit.value.trim() }));
    byId("wireframe").addEventListener("change", () =>
      store.update({ wireframe: byId("wireframe", HTMLInputElement).checked }),
    );
    byId("unroll").addEventListener("change", () =>
      store.update({ unroll: byId("unroll", HTMLInputElement).checked, view: null, section: null }),
    );
    byId("flat").addEventListener("change", () =>
      store.update({ flat: byId("flat", HTMLInputElement).checked }),
    );
    byId("label-lines").addEventListener("change", () =>
      store.update({ labels: byId("label-lines", HTMLInputElement).checked }),
    );
    const [section, share] = [
      byId("section", HTMLSelectElement),
      byId("section-share", HTMLInputElement),
    ];
    const sectionNow = (): State["section"] => {
      const axis = (["x", "y", "z"] as const).find((each) => each === section.value);
      return axis ? { axis, share: share.valueAsNumber } : null;
    };
    section.addEventListener("change", () => store.update({ section: sectionNow() }));
    share.addEventListener("input", () =>
      sceneView.showLook({ ...store.state, section: sectionNow() }),
    );
    share.addEventListener("change", () => store.update({ section: sectionNow() }));
    for (const [id, theta, phi] of LOOKS)
      byId(`look-${id}`).addEventListener("click", () => sceneView.stage.lookFrom(theta, phi));
    byId("fit").addEventListener("click", () => {
      sceneView.stage.lookAtAll();
      store.replace({ view: null });
    });
  }

  get tool(): Tool {
    return query("#tools input:checked", HTMLInputElement).value as Tool;
  }

  /** Show which axis points upwards as drawn. */
  showUp(up: Up): void {
    choose("ups", up);
  }

  /** Show ``state`` in all fields. */
  show(state: State): void {
    if (state.isReadable) this.showQuestion(state);
    byId("undo", HTMLButtonElement).disabled = !this.store.canUndo;
    byId("redo", HTMLButtonElement).disabled = !this.store.canRedo;
    byId("distances", HTMLInputElement).checked = state.distances;
    const names = state.places.slice(0, state.starts).map((_, i) => nameOf(state, i));
    byId("distances-from").textContent =
      names.length > 2 ? `the nearest of ${names.length} starts` : names.join(" and ") || "A";
    byId("shown-distances").hidden = !state.distances;
    if (state.maxDistance !== null) byId("more-points", HTMLDetailsElement).open = true;
    choose("methods", state.method);
    byId("method-now").textContent = state.method;
    byId("epsilon").hidden = state.method !== "approximate";
    byId("efforts").hidden = state.method !== "fast";
    choose("shades", state.shade);
    byId("shades").hidden = byId("more-method").hidden = hasCost(state);
    byId("versus", HTMLSelectElement).value = versusOf(state);
    for (const option of byId("versus", HTMLSelectElement).options)
      option.disabled = option.value === state.method;
    byId("slope", HTMLSelectElement).value = state.slope?.rule ?? "";
    byId("cost-now").textContent = !hasCost(state)
      ? "length"
      : [state.slope?.rule, state.faceCosts?.name].filter(Boolean).join(" × ");
    byId("boundary", HTMLInputElement).checked = state.boundary;
    setValue("error-slider", String(Math.log10(state.error)));
    showError(state.error);
    byId("effort", HTMLSelectElement).value = String(state.effort);
    const { lines } = state;
    byId("lines", HTMLSelectElement).value =
      lines === null ? "none" : "count" in lines ? "count" : "spacing";
    byId("lines-value").hidden = lines === null;
    setValue(
      "lines-value",
      lines === null ? "" : String("count" in lines ? lines.count : lines.spacing),
    );
    byId("polar", HTMLInputElement).checked = state.polar;
    setValue("unit", state.unit);
    byId("palette", HTMLSelectElement).value = state.palette;
    setValue("least", state.least === null ? "" : String(state.least));
    setValue("range", state.range === null ? "" : String(state.range));
    byId("wireframe", HTMLInputElement).checked = state.wireframe;
    byId("flat", HTMLInputElement).checked = state.flat;
    byId("unroll", HTMLInputElement).checked = state.unroll;
    byId("label-lines", HTMLInputElement).checked = state.labels;
    byId("section", HTMLSelectElement).value = state.section?.axis ?? "";
    byId("section-share").hidden = state.section === null;
    setValue("section-share", String(state.section?.share ?? 0.5));
  }

  /** Show the question; what cannot be read stays as it was typed. */
  private showQuestion(state: State): void {
    setValue("points", writePlaces(state));
    setValue("walk", state.walk?.join(", ") ?? "");
    setValue("barriers", writeBarriers(state.barriers));
    setValue("max-distance", state.maxDistance === null ? "" : String(state.maxDistance));
  }

  private readQuestion(): void {
    const { mesh } = this.store.state;
    if (mesh === null) return;
    this.reading.abort(); // what was written before could be located later
    const reading = new AbortController();
    this.reading = reading;
    this.status.run("busy", "Locating points…", reading, async () => {
      try {
        const { change, notes } = await located(mesh, this.read());
        reading.signal.throwIfAborted();
        this.store.update(change);
        this.notes.tell("points", notes);
      } catch (error) {
        if (!reading.signal.aborted) this.store.replace({ isReadable: false });
        throw error;
      }
    });
  }

  /** Read the question as it is written; throw where there is something else. */
  private read(): Question {
    const text = (id: string): string => byId(id, HTMLInputElement).value.trim();
    const others = {
      walk: text("walk"),
      barriers: text("barriers"),
      max_distance: text("max-distance"),
    };
    const { walk, barriers, maxDistance } = readState(new URLSearchParams(others).toString());
    const { places, starts } = parsePlaces(text("points"), this.store.state);
    return { places, starts, walk, barriers, maxDistance };
  }

  private readLines(isOtherKind: boolean): void {
    const kind = byId("lines", HTMLSelectElement).value;
    const value = byId("lines-value", HTMLInputElement).valueAsNumber;
    let lines: Lines = null;
    if (kind === "count")
      lines = isOtherKind ? INITIAL.lines : { count: Math.max(1, Math.round(value) || 1) };
    if (kind === "spacing")
      lines = { spacing: isOtherKind || !(value > 0) ? this.usualSpacing() : value };
    this.store.update({ lines });
  }

  /** Return the spacing of isolines to begin with: a round number. */
  usualSpacing: () => number = () => 1;
}

/**
 * Return a question with points of the surface, where it has positions: the service locates these.
 *
 * The notes tell how far from the surface they are, where that is much.
 */
export async function located<Q extends Pick<WrittenState, "places">>(
  mesh: string,
  question: Q,
): Promise<{ change: Omit<Q, "places"> & Pick<State, "places">; notes: string[] }> {
  const notes: string[] = [];
  const locate = async (given: WrittenPoint): Promise<Point> => {
    if (!("position" in given)) return given;
    const [{ points }, { mean_edge_length }] = await Promise.all([
      service.locate(mesh, [given.position]),
      service.mesh(mesh),
    ]);
    const [found] = points;
    if (!found) throw new Error("The service found no point of the surface there.");
    const { distance } = found;
    if (distance > FAR * mean_edge_length) {
      const away = `${written(distance, 4)} away from the surface`;
      notes.push(`The position ${given.position.join(", ")} is ${away}: its nearest point counts.`);
    }
    return pointOf(found);
  };
  const places = await Promise.all(
    question.places.map(async ({ point, name }): Promise<Place> => {
      return { point: await locate(point), name };
    }),
  );
  return { change: { ...question, places }, notes };
}

function errorOf(slider: HTMLInputElement): number {
  return Number((10 ** slider.valueAsNumber).toPrecision(2));
}

function showError(error: number): void {
  const words = `${Number((100 * error).toPrecision(2))} %`;
  byId("error-value").textContent = words;
  byId("error-slider").setAttribute("aria-valuetext", words);
}

function onChoice(id: string, choose: (value: string) => void): void {
  byId(id).addEventListener("change", (event) => choose((event.target as HTMLInputElement).value));
}

function choose(id: string, value: string): void {
  query(`#${id} input[value="${value}"]`, HTMLInputElement).checked = true;
}

function setValue(id: string, value: string): void {
  const field = byId(id, HTMLInputElement);
  if (field !== document.activeElement || field.type !== "text") field.value = value;
}
