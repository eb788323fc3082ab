// Requests to the service: each carries the key, and waits where the service is busy.
import { type ProblemError, problemOf } from "./problemError.js";

/** Attempts of a request, and the most seconds that it waits for the next. */
const ATTEMPTS = 8;
const PATIENCE_S = 120;

export class Connection {
  constructor(
    readonly address: URL,
    public apiKey: string | null,
    private readonly fetch: typeof globalThis.fetch,
  ) {}

  /** The headers that carry the key. */
  get authorization(): Record<string, string> {
    return this.apiKey ? { Authorization: `Bearer ${this.apiKey}` } : {};
  }

  /** Return the address of a path of the service. */
  to(path: string): string {
    return new URL(path, this.address).href;
  }

  /** Send a request, and return the answer; throw ProblemError for any other response. */
  async call(path: string, init: RequestInit = {}): Promise<Response> {
    const headers = {
      ...this.authorization,
      ...(init.headers as Record<string, string> | undefined),
    };
    for (let attempt = 1; ; attempt++) {
      const response = await this.fetch(this.to(path), { ...init, headers });
      if (response.ok) return response;
      const problem = await problemOf(response);
      const seconds = secondsToWait(problem);
      if (seconds === null || attempt === ATTEMPTS) throw problem;
      await pause(seconds, init.signal);
    }
  }

  async getJson<T>(path: string, signal?: AbortSignal): Promise<T> {
    return (await this.call(path, signal ? { signal } : {})).json() as Promise<T>;
  }
}

/** Return how long the service asks to wait; null where it does not, or for too long. */
function secondsToWait({ status, retryAfter }: ProblemError): number | null {
  const isBusy = status === 429 || status === 503;
  return isBusy && retryAfter !== null && retryAfter <= PATIENCE_S ? retryAfter : null;
}

/** Wait; an abort ends it with its reason. */
export function pause(seconds: number, signal?: AbortSignal | null): Promise<void> {
  return new Promise((resolve, reject) => {
    signal?.throwIfAborted();
    const end = () => {
      clearTimeout(timer);
      reject(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", end);
      resolve();
    }, 1000 * seconds);
    signal?.addEventListener("abort", end);
  });
}
