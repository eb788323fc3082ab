// A long query as a job: asked for, watched, and its answer fetched; stopped when it is aborted.
import { events } from "./events";
import { call, isAbort, post } from "./http";
import type { Job } from "./types";

const RETRY_MS = 1000;

export async function answerOfJob(
  path: string,
  body: unknown,
  accept: string,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<Response> {
  const headers = { Accept: accept, Prefer: "respond-async" };
  const job = (await (await post(path, body, headers)).json()) as Job;
  const { self, results, events: stream } = job.links as Record<string, string>;
  const stop = (): void => void call(self!, { method: "DELETE" }).catch(() => undefined);
  if (signal.aborted) stop();
  signal.addEventListener("abort", stop, { once: true });
  try {
    await finished(stream!, onProgress, signal);
    return await call(results!, { signal });
  } finally {
    signal.removeEventListener("abort", stop);
  }
}

/** Watch a job to its end, across connections that break. */
async function finished(
  path: string,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<void> {
  let lastId = "";
  for (;;) {
    try {
      for await (const { id, data } of events(path, lastId, signal)) {
        lastId = id;
        const job = JSON.parse(data) as Job;
        onProgress(job.progress);
        if (job.status !== "accepted" && job.status !== "running") return;
      }
    } catch (error) {
      if (isAbort(error) || !(error instanceof TypeError)) throw error;
    }
    await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    signal.throwIfAborted();
  }
}
