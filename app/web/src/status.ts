// The page's state of work, as users, screen readers and tests see it: loading, busy, ready, error.
import { ProblemError } from "geodesic-client";
import { byId } from "./dom";
import { InputError } from "./inputError";
import { inWords } from "./problemWords";
import { isAbort, setKey } from "./service";

/** Work on a question, on the mesh itself, or on lines: these follow an answer, and no question. */
type Kind = "loading" | "busy" | "drawing";
type Work<T> = (onProgress: OnProgress) => Promise<T>;

/** Report the share of the work that is done; null where it is unknown. */
export type OnProgress = (share: number | null) => void;

/** What is answered within this time shows no bar (see style.css), and no blank before. */
export const PATIENCE_MS = 300;

interface Task {
  kind: Kind;
  words: string;
  share: number | null;
  stop: AbortController;
}

export class Status {
  private readonly tasks = new Set<Task>();
  private hasFailed = false;
  /** Called when a key has been entered. */
  onKey: () => void = () => undefined;

  constructor(private readonly drawn: () => Promise<void>) {
    byId("cancel").addEventListener("click", () => this.cancel());
    byId("error-close").addEventListener("click", () => this.clearError());
    byId("key-form").addEventListener("submit", (event) => {
      event.preventDefault();
      setKey(byId("key", HTMLInputElement).value);
      this.clearError();
      this.onKey();
    });
  }

  /** Do ``work``, and show that it runs; its errors are thrown on. */
  async during<T>(kind: Kind, words: string, stop: AbortController, work: Work<T>): Promise<T> {
    const task: Task = { kind, words, share: null, stop };
    this.tasks.add(task);
    if (kind !== "drawing") this.hasFailed = false;
    this.show();
    try {
      return await work((share) => {
        task.share = share;
        this.show();
      });
    } finally {
      this.tasks.delete(task);
      this.show();
    }
  }

  /** Do ``work`` in the background; its errors are shown. */
  run(kind: Kind, words: string, stop: AbortController, work: Work<void>): void {
    this.during(kind, words, stop, work).catch((error: unknown) => this.fail(error));
  }

  cancel(): void {
    for (const task of this.tasks) task.stop.abort();
  }

  fail(error: unknown): void {
    if (isAbort(error)) return;
    this.hasFailed = true;
    this.describe(error);
    this.show();
    if (byId("key-form").hidden) return;
    const field = byId("key", HTMLInputElement);
    field.focus();
    field.select();
  }

  private clearError(): void {
    this.hasFailed = false;
    this.show();
  }

  private describe(error: unknown): void {
    const problem = error instanceof ProblemError ? error : null;
    const input = error instanceof InputError ? error : null;
    const isOffline = error instanceof TypeError && /fetch/i.test(error.message);
    byId("error-title").textContent =
      problem?.document.title ??
      input?.title ??
      (isOffline ? "The service does not answer" : "Something went wrong");
    byId("error-detail").textContent = isOffline
      ? "It may have stopped, or the network may be down."
      : problem
        ? inWords(problem)
        : error instanceof Error
          ? error.message
          : String(error);
    byId("error-hint").textContent = problem?.hint ?? input?.hint ?? "";
    byId("error-request").textContent = problem?.requestId ? `Request ${problem.requestId}` : "";
    byId("key-form").hidden = problem?.status !== 401;
    if (!isOffline && !problem && !input) console.error(error);
  }

  private show(): void {
    byId("error").hidden = !this.hasFailed;
    const task = [...this.tasks].at(-1);
    const isLoading = [...this.tasks].some(({ kind }) => kind === "loading");
    if (task) {
      byId("waiting-for").textContent = task.words;
      const progress = byId("progress", HTMLProgressElement);
      if (task.share === null) progress.removeAttribute("value");
      else progress.value = task.share;
      this.state = isLoading ? "loading" : "busy";
    } else if (this.hasFailed) {
      this.state = "error";
    } else {
      void this.drawn().then(() => {
        if (this.tasks.size === 0 && !this.hasFailed) this.state = "ready";
      });
    }
  }

  private set state(state: "loading" | "busy" | "ready" | "error") {
    const { dataset } = document.documentElement;
    if (dataset.state !== state) dataset.state = state;
  }
}
