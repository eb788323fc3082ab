// Queries whose answer takes long: they become jobs, which are watched to their end.
import { events } from "./events";
import { call, isAbort, post } from "./http";
import type { Job } from "./types";

const ACCEPTED = 202;
const JOB_AFTER_S = 1;
const RETRY_MS = 1000;

/** Return the answer to a query; where it takes long, report progress. An abort stops the work. */
export async function answerOf(
  path: string,
  body: unknown,
  accept: string,
  onProgress: (share: number) => void,
  signal: AbortSignal,
): Promise<Response> {
  const headers = { Accept: accept, Prefer: `respond-async, wait=${JOB_AFTER_S}` };
  const response = await post(path, body, headers, signal);
  if (response.status !== ACCEPTED) return response;
  const job = (await response.json()) as Job;
  const links = job.links as { self: string; results: string; events: string };
  const dismiss = (): void => void call(links.self, { method: "DELETE" }).catch(() => undefined);
  if (signal.aborted) dismiss();
  signal.addEventListener("abort", dismiss, { once: true });
  try {
    await finished(links.events, onProgress, signal);
    return await call(links.results, { signal });
  } finally {
    signal.removeEventListener("abort", dismiss);
  }
}

/** Watch a job to its end; a connection that breaks is opened again. */
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
