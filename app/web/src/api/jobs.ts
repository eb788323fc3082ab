// Queries whose answer takes long: they become jobs, which are watched to their end.
import { events } from "./events";
import { call, isAbort, post } from "./http";
import type { Job } from "./types";

const ACCEPTED = 202;
const JOB_AFTER_S = 1;
const RETRY_MS = 1000;

/**
 * Return the answer to a query; where it takes long, report progress. An abort stops the work.
 *
 * No job remains: its answer would take up space and quota of the service for a day.
 */
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
  try {
    await finished(links.events, onProgress, signal);
    return await call(links.results, { signal });
  } finally {
    void remove(links.self);
  }
}

/** Remove a job, if the service can do so now; that stops it as well. */
async function remove(path: string): Promise<void> {
  try {
    await call(path, { method: "DELETE" });
  } catch {
    // The service removes it later.
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
