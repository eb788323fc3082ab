// A service that answers from a list of routes, and records the requests.
import { vi } from "vitest";

export interface Sent {
  method: string;
  path: string;
  headers: Headers;
  body: unknown;
  signal: AbortSignal | null;
}

type Answer = (sent: Sent) => Response | Promise<Response>;

/** Replace ``fetch``: the first route whose name begins the request's method and path answers. */
export function fakeService(routes: Record<string, Answer>): Sent[] {
  const requests: Sent[] = [];
  vi.stubGlobal("fetch", async (address: string, init: RequestInit = {}): Promise<Response> => {
    const { pathname, search } = new URL(address);
    const path = pathname + search;
    const sent = {
      method: init.method ?? "GET",
      path,
      headers: new Headers(init.headers),
      body: typeof init.body === "string" ? (JSON.parse(init.body) as unknown) : null,
      signal: init.signal ?? null,
    };
    requests.push(sent);
    init.signal?.throwIfAborted();
    const name = Object.keys(routes).find((each) => `${sent.method} ${path}`.startsWith(each));
    const answer = name === undefined ? undefined : routes[name];
    if (!answer) throw new Error(`no route for ${sent.method} ${path}`);
    return answer(sent);
  });
  return requests;
}

export function json(body: unknown, status = 200, headers: Record<string, string> = {}): Response {
  return new Response(JSON.stringify(body), {
    status,
    headers: { "Content-Type": "application/json", ...headers },
  });
}

/** Return a response whose body arrives in these parts. */
export function inParts(parts: readonly (string | Uint8Array)[], error?: Error): Response {
  const encoder = new TextEncoder();
  const body = new ReadableStream<Uint8Array>({
    start(controller) {
      for (const part of parts) {
        controller.enqueue(typeof part === "string" ? encoder.encode(part) : part);
      }
      if (!error) controller.close();
    },
    // After all parts have been read, so that none of them is lost.
    pull(controller) {
      if (error) controller.error(error);
    },
  });
  return new Response(body, { headers: { "Content-Type": "text/event-stream" } });
}
