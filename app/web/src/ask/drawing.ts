// Lines that the service draws: requested when the question changes, then shown.
import type { Notes } from "../panel/notes";
import type { OnProgress, Status } from "../status";

type Draw = (onProgress: OnProgress, signal: AbortSignal) => Promise<() => void>;

/** Shows the lines of the latest question, and nothing while they are drawn. */
export class Drawing {
  private question = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly notes: Notes,
    private readonly what: "isolines" | "borders" | "rays" | "boundary",
    private readonly hideLines: () => void,
  ) {}

  /** Draw, unless the question is the one before; `draw` returns a function that shows the lines. */
  follow(question: string, draw: Draw): void {
    if (question === this.question) return;
    this.forget();
    this.hide();
    this.question = question;
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("drawing", `Drawing ${this.what}…`, stop, async (onProgress) => {
      const show = await draw(onProgress, stop.signal);
      if (!stop.signal.aborted) show();
    });
  }

  /** Show no lines, and stop drawing some. */
  clear(): void {
    if (this.question === "") return;
    this.forget();
    this.hide();
  }

  private hide(): void {
    this.hideLines();
    this.notes.tell(this.what, []);
  }

  /** Draw anew next time: the mesh has been opened anew. */
  forget(): void {
    this.stop.abort();
    this.question = "";
  }
}
