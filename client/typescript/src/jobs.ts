// Queries whose answer takes long: they become jobs, which are watched to their end.
import { type Connection, pause } from "./connection.js";
import { events } from "./events.js";
import type { Call, Job } from "./types.js";

const ACCEPTED = 202;
const JOB_AFTER_S = 1;
const RETRY_S = 1;

/**
 * Return the answer to a query; where it takes long, report progress. An abort stops the work.
 *
 * No job remains: its answer would take up space and quota of the service for a day.
 */
export async function answerOf(
  connection: Connection,
  path: string,
  init: RequestInit,
  { signal, onProgress }: Call,
): Promise<Response> {
  const headers = {
    ...(init.headers as Record<string, string>),
    Prefer: `respond-async, wait=${JOB_AFTER_S}`,
  };
  const stop = signal ? { signal } : {};
  const response = await connection.call(path, { method: "POST", ...init, headers, ...stop });
  if (response.status !== ACCEPTED) return response;
  const { id } = (await response.json()) as Job;
  try {
    await finished(connection, id, { signal, onProgress });
    return await connection.call(`v1/jobs/${id}/results`, stop);
  } finally {
    void remove(connection, id);
  }
}

/** Remove a job, if the service can do so now; that stops it as well. */
async function remove(connection: Connection, id: string): Promise<void> {
  try {
    await connection.call(`v1/jobs/${id}`, { method: "DELETE" });
  } catch {
    // The service removes it later.
  }
}

/** Watch a job to its end; a connection that breaks is opened again. */
async function finished(
  connection: Connection,
  id: string,
  { signal, onProgress }: Call,
): Promise<void> {
  let lastId = "";
  for (;;) {
    try {
      for await (const event of events(connection, `v1/jobs/${id}/events`, lastId, signal)) {
        lastId = event.id;
        const job = JSON.parse(event.data) as Job;
        onProgress?.(job.progress);
        if (job.status !== "accepted" && job.status !== "running") return;
      }
    } catch (error) {
      if (!(error instanceof TypeError)) throw error;
    }
    await pause(RETRY_S, signal);
  }
}
