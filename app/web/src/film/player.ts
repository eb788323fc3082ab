// The film of the search: asked for, played, paused, scrubbed, and saved as a video.
import { byId } from "../dom";
import { InputError } from "../inputError";
import { foldOnPhone } from "../panel/appearance";
import { service } from "../service";
import { blockedFaces } from "../state/barriers";
import { startsOf } from "../state/places";
import { type State, type Store, unitOf } from "../state/state";
import type { Status } from "../status";
import { type Rgb, territory } from "../view/colours";
import { Markers } from "../view/markers";
import type { SceneView } from "../view/sceneView";
import { WindowLayer } from "../view/windows";
import { Film } from "./film";
import { record } from "./recording";

/** What the service follows at most; it refuses more. */
const MOST_FACES = 5000;
const STEPS = 240;
/** Faces up to which pseudosources are drawn as long as their windows wait. */
const FEW_FACES = 1000;
/** Steps in which a new pseudosource is drawn larger. */
const GLOW = 6;
const KEY =
  "Yellow waits in the queue, violet is propagated now, dark blue is done and comes from the source, " +
  "other colours come from pseudosources, red is trimmed.";
const SOURCE: Rgb = [0.09, 0.22, 0.38];
/** Of pseudosources, in turn: none that is like the front, or like what is trimmed. */
const COLOURS = [1, 2, 6, 4].map(territory);
const POPPED: Rgb = [1, 0.8, 0.1];

export class Player {
  private film: Film | null = null;
  private asked = "";
  private stop = new AbortController();
  private playing = 0;
  private readonly windows: WindowLayer;
  private readonly marks: Markers;
  private readonly slider = byId("film-step", HTMLInputElement);

  constructor(
    private readonly store: Store,
    private readonly status: Status,
    private readonly sceneView: SceneView,
    private readonly onEnd: () => void,
  ) {
    this.windows = new WindowLayer(sceneView.stage);
    this.marks = new Markers(sceneView.stage);
    byId("film-start").addEventListener("click", () => this.begin());
    byId("film-stop").addEventListener("click", () => this.end());
    byId("film-play").addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    byId("film-save").addEventListener("click", () => this.save());
    this.slider.addEventListener("input", () => {
      this.pause();
      this.show();
    });
  }

  /** Offer the film where there is a question for it; end one whose question has changed. */
  follow(state: State): void {
    if (this.asked !== "" && this.asked !== question(state)) this.end();
    this.offer(state);
  }

  private offer(state: State): void {
    const { mesh, isReadable } = state;
    const faces = this.sceneView.mesh?.document.faces ?? 0;
    const isSmall = faces <= MOST_FACES;
    const isAsked = mesh !== null && faces > 0 && startsOf(state).length > 0 && isReadable;
    byId("film-start", HTMLButtonElement).disabled = !isAsked || !isSmall;
    byId("film-note").textContent =
      faces > 0 && !isSmall
        ? `For meshes of at most ${MOST_FACES.toLocaleString("en")} faces; this one has ${faces.toLocaleString("en")}.`
        : isAsked
          ? "Every window of the exact sweep, as section 3 of the paper has it."
          : "Set a point to start from.";
  }

  /** Draw the film over what has just been painted. */
  redraw(): void {
    if (this.film) this.show();
    else this.offer(this.store.state);
  }

  private begin(): void {
    const { state } = this.store;
    const { mesh } = state;
    const sources = startsOf(state);
    if (mesh === null) return;
    this.stop.abort();
    this.stop = new AbortController();
    const { signal } = this.stop;
    this.asked = question(state);
    this.status.run("busy", "Following the sweep…", this.stop, async (onProgress) => {
      const call = { barriers: blockedFaces(state), steps: STEPS, onProgress, signal };
      const sweep = await service.sweepSteps(mesh, sources, call);
      signal.throwIfAborted();
      this.film = new Film(sweep);
      this.sceneView.stage.showsLines = false;
      void this.sceneView.surface?.setWireframe(true, [1, 1, 1]);
      this.windows.take(this.sceneView.mesh, sweep.windows, (v) => this.colourOf(v));
      this.slider.max = String(this.film.last);
      this.slider.value = "0";
      this.setOpen(true);
      byId("film-play").focus();
      this.play();
    });
  }

  private end(): void {
    this.stop.abort();
    this.asked = "";
    if (!this.film) return;
    this.pause();
    this.film = null;
    this.setOpen(false);
    this.windows.take(null, null, () => SOURCE);
    this.marks.show([]);
    this.sceneView.stage.showsLines = true;
    this.onEnd();
  }

  private setOpen(isOpen: boolean): void {
    byId("player").hidden = !isOpen;
    byId("film-save", HTMLButtonElement).disabled = !isOpen;
    if (isOpen) foldOnPhone();
  }

  private play(): void {
    const { film } = this;
    if (!film) return;
    if (this.slider.valueAsNumber >= film.last) this.slider.value = "0";
    byId("film-play").textContent = "Pause";
    this.show();
    this.playing = setTimeout(() => this.next(), this.pause_ms);
  }

  private next(): void {
    const { film } = this;
    if (!film) return;
    this.slider.value = String(this.slider.valueAsNumber + 1);
    this.show();
    if (this.slider.valueAsNumber >= film.last) this.pause();
    else this.playing = setTimeout(() => this.next(), this.pause_ms);
  }

  private pause(): void {
    clearTimeout(this.playing);
    this.playing = 0;
    byId("film-play").textContent = "Play";
  }

  private get pause_ms(): number {
    return 1000 / Number(byId("film-speed", HTMLSelectElement).value);
  }

  /** Draw the step that the slider is at, and tell what it does. */
  private show(): void {
    const { film, sceneView, store } = this;
    const { mesh, surface } = sceneView;
    if (!film || !mesh || !surface) return;
    const step = this.slider.valueAsNumber;
    const { settled, distances } = film.sweep;
    const isReached = (v: number): boolean => (settled[v] ?? Infinity) <= step;
    surface.setReached(
      distances.map((distance, v) => (isReached(v) ? (distance ?? Infinity) : Infinity)),
      film.largest,
    );
    this.windows.show(step);
    this.showMarks(step);
    const unit = unitOf(store.state);
    const words = `${step} of ${film.last}. ${film.words(step, unit)}`;
    byId("film-words").textContent = words;
    byId("film-counts").textContent = film.counts(step, unit);
    this.slider.setAttribute("aria-valuetext", words);
  }

  private showMarks(step: number): void {
    const { film, sceneView } = this;
    const { mesh } = sceneView;
    if (!film || !mesh) return;
    const at = (vertex: number) => mesh.drawn(mesh.vertex(vertex));
    const isSmall = mesh.document.faces <= FEW_FACES;
    const stays = (vertex: number) => isSmall && (film.active.get(vertex) ?? 0) >= step;
    const lit = film.deeds.slice(0, step + 1).flatMap(({ lit }, then) =>
      lit
        .filter((vertex) => step - then < GLOW || stays(vertex))
        .map((vertex) => ({
          position: at(vertex),
          fill: this.colourOf(vertex),
          size: Math.max(19 - 1.5 * (step - then), 10),
        })),
    );
    const { settled } = film.deeds[step] ?? { settled: [] };
    const popped = settled.length === 1 ? settled : [];
    const marks = popped.map((vertex) => ({ position: at(vertex), fill: POPPED, size: 12 }));
    this.marks.show([...lit, ...marks]);
  }

  /** The source has a colour of its own, and pseudosources have colours in turn. */
  private colourOf(vertex: number | null): Rgb {
    const { film } = this;
    const isSource = film?.sweep.sources.some((source) => source.vertex === vertex) ?? true;
    return vertex === null || isSource
      ? SOURCE
      : (COLOURS[(film?.emitters.get(vertex) ?? 0) % COLOURS.length] ?? SOURCE);
  }

  private save(): void {
    const { film } = this;
    if (!film) return;
    this.pause();
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("drawing", "Recording the film…", stop, async (onProgress) => {
      const until = film.last;
      const frame = (step: number): string[] => {
        this.slider.value = String(step);
        this.show();
        onProgress(step / until);
        const unit = unitOf(this.store.state);
        return [film.words(step, unit), film.counts(step, unit), KEY];
      };
      await record(this.sceneView.stage, until, this.pause_ms, frame, stop.signal).catch(
        (error: unknown) => {
          throw error instanceof DOMException && error.name === "NotSupportedError"
            ? new InputError(
                "This browser cannot record a video",
                error.message,
                "Use another one.",
              )
            : error;
        },
      );
    });
  }
}

/** What a film is about, and what is painted under it. */
function question(state: State): string {
  const { view: _, up: __, unit: ___, wireframe: ____, palette: _____, ...rest } = state;
  return JSON.stringify(rest);
}
