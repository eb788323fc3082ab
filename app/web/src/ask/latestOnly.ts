// A queue of one: only the latest request is worth an answer.
import { isAbort } from "../service";

const PATIENCE_MS = 100;
/** A pointer that is dragged moves several times meanwhile. */
const REST_MS = 60;

/**
 * Runs one request at a time. The latest one waits for the one that runs, and replaces any other
 * that waits. A request that has been superseded is aborted when it takes longer than the patience.
 * Each abort doubles the patience, so that a slow service still answers some requests. A request
 * that only refines an answer is aborted at once.
 */
export class LatestOnly<Q> {
  private running: AbortController | undefined;
  private waiting: Q | undefined;
  private isRefining = false;
  private patience = PATIENCE_MS;

  constructor(
    private readonly answer: (request: Q, stop: AbortController) => Promise<void>,
    private readonly fail: (error: unknown) => void,
  ) {}

  ask(request: Q): void {
    if (!this.running) {
      void this.run(request);
      return;
    }
    if (this.isRefining) this.running.abort();
    else if (this.waiting === undefined) this.abortWhenOverdue(this.running);
    this.waiting = request;
  }

  /**
   * Wait until no request has come for a moment: then it is time to refine the answer just given.
   * Return false if another request waits already; one that comes meanwhile aborts this one.
   */
  async rests(): Promise<boolean> {
    const { running } = this;
    if (!running || this.waiting !== undefined) return false;
    this.isRefining = true;
    await new Promise<void>((resolve, reject) => {
      setTimeout(resolve, REST_MS);
      running.signal.addEventListener("abort", () => reject(running.signal.reason), { once: true });
    });
    return true;
  }

  /** Abort the request that runs, and drop the one that waits. */
  cancel(): void {
    this.waiting = undefined;
    this.running?.abort();
  }

  private abortWhenOverdue(superseded: AbortController): void {
    setTimeout(() => {
      if (this.running === superseded && this.waiting !== undefined) {
        this.patience *= 2;
        superseded.abort();
      }
    }, this.patience);
  }

  private async run(request: Q): Promise<void> {
    const running = new AbortController();
    this.running = running;
    this.isRefining = false;
    try {
      await this.answer(request, running);
      this.patience = PATIENCE_MS;
    } catch (error) {
      if (!isAbort(error)) this.fail(error);
    }
    this.running = undefined;
    const next = this.waiting;
    this.waiting = undefined;
    if (next !== undefined) void this.run(next);
  }
}
