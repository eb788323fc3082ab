// One question at a time, of which the newest wins.
import { isAbort } from "./http";

const PATIENCE_MS = 100;

/**
 * Answers questions that come faster than they can be answered. The newest waits while another is
 * answered; what it supersedes is aborted when it takes too long. Each abort doubles that time, so
 * that on a slow service answers come late, but come.
 */
export class LatestOnly<Q> {
  private running: AbortController | undefined;
  private waiting: Q | undefined;
  private patience = PATIENCE_MS;

  constructor(
    private readonly answer: (question: Q, stop: AbortController) => Promise<void>,
    private readonly fail: (error: unknown) => void,
  ) {}

  ask(question: Q): void {
    if (!this.running) {
      void this.run(question);
      return;
    }
    if (this.waiting === undefined) {
      const superseded = this.running;
      setTimeout(() => {
        if (this.running === superseded && this.waiting !== undefined) {
          this.patience *= 2;
          superseded.abort();
        }
      }, this.patience);
    }
    this.waiting = question;
  }

  /** Forget what was asked. */
  cancel(): void {
    this.waiting = undefined;
    this.running?.abort();
  }

  private async run(question: Q): Promise<void> {
    const running = new AbortController();
    this.running = running;
    try {
      await this.answer(question, running);
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
