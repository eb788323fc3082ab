// Lines that the service draws: requested when the question changes, then shown.
import type { OnProgress, Status } from "../status";

type Draw = (onProgress: OnProgress, signal: AbortSignal) => Promise<() => void>;

/** Shows the lines of the latest question, and nothing while they are drawn. */
export class Drawing {
  private question = "";
  private stop = new AbortController();

  constructor(
    private readonly status: Status,
    private readonly message: string,
    private readonly hide: () => void,
  ) {}

  /** Draw, unless the question is the one before; `draw` returns a function that shows the lines. */
  follow(question: string, draw: Draw): void {
    if (question === this.question) return;
    this.forget();
    this.hide();
    this.question = question;
    const stop = new AbortController();
    this.stop = stop;
    this.status.run("busy", this.message, stop, async (onProgress) => {
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

  /** Draw anew next time: the mesh has been opened anew. */
  forget(): void {
    this.stop.abort();
    this.question = "";
  }
}
