import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { Connection } from "../../../../client/typescript/src/connection";
import { events } from "../../../../client/typescript/src/events";
import { answerOf } from "../../../../client/typescript/src/jobs";
import { ProblemError } from "../../../../client/typescript/src/problemError";
import { Random } from "../support/random";
import { fakeService, inParts, json, type Sent } from "../support/service";

const CONNECTION = new Connection(new URL("http://localhost/"), null, (...request) =>
  fetch(...request),
);

const LINKS = { self: "/v1/jobs/j", results: "/v1/jobs/j/results", events: "/v1/jobs/j/events" };

function eventOf(id: number, status: string, progress = 0): string {
  return `id: ${id}\nevent: job\ndata: ${JSON.stringify({ id: "j", status, progress })}\n\n`;
}

async function allOf(response: Response): Promise<{ id: string; data: string }[]> {
  fakeService({ "GET /events": () => response });
  const all = [];
  for await (const event of events(CONNECTION, "events", "")) all.push(event);
  return all;
}

describe("events", () => {
  test("are read wherever the stream is cut, even within a character", async () => {
    const expected = [
      { id: "1", data: '{"words":"füreinander ½ 🙂"}' },
      { id: "22", data: "second" },
      { id: "", data: "without an id" },
    ];
    const text =
      `: a comment\n\nid: 1\ndata: ${expected[0]?.data}\n\n` +
      "event: job\nid:22\ndata:second\n\n: still here\n\ndata: without an id\n\n";
    const bytes = new TextEncoder().encode(text);
    const random = new Random(7);
    for (let i = 0; i < 200; i++) {
      const cuts = [0, ...random.list(12, () => random.below(bytes.length)), bytes.length];
      cuts.sort((a, b) => a - b);
      const parts = cuts.slice(1).map((end, k) => bytes.slice(cuts[k], end));
      expect(await allOf(inParts(parts.filter(({ length }) => length > 0)))).toEqual(expected);
    }
  });

  test("of several lines are joined, and lines may end as on Windows", async () => {
    const text = "id: 1\r\ndata: first\r\ndata:  second\r\n\r\n";
    expect(await allOf(inParts([text]))).toEqual([{ id: "1", data: "first second" }]);
  });

  test("that are not complete are left out", async () => {
    expect(await allOf(inParts(["data: whole\n\ndata: half\n"]))).toEqual([
      { id: "", data: "whole" },
    ]);
    expect(await allOf(inParts([]))).toEqual([]);
  });
});

describe("a job", () => {
  beforeEach(() => void vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] }));
  afterEach(() => void vi.useRealTimers());

  /** Serve a job whose stream of events is another one at each connection. */
  function serve(
    streams: (() => Response)[],
    results = () => new Response("answer"),
    removed = () => json({ status: "successful" }),
  ): Sent[] {
    let connections = 0;
    return fakeService({
      "POST /v1/x": () => json({ id: "j", status: "accepted" }, 202),
      "GET /v1/jobs/j/events": () => (streams[connections++] as () => Response)(),
      "GET /v1/jobs/j/results": results,
      "DELETE /v1/jobs/j": removed,
    });
  }

  const stopped = () => json({ status: "dismissed" });

  function removals(requests: Sent[]): string[] {
    return requests.filter(({ method }) => method === "DELETE").map(({ path }) => path);
  }

  function ask(stop = new AbortController()) {
    const onProgress = vi.fn();
    const init = { body: '{"a":1}', headers: { Accept: "text/csv" } };
    const answer = answerOf(CONNECTION, "v1/x", init, { onProgress, signal: stop.signal });
    answer.catch(() => undefined); // looked at later
    return { answer, onProgress };
  }

  test("is started, watched, its answer fetched, and removed", async () => {
    const requests = serve([
      () =>
        inParts([eventOf(1, "accepted"), eventOf(2, "running", 0.5), eventOf(3, "successful", 1)]),
    ]);
    const { answer, onProgress } = ask();

    expect(await (await answer).text()).toBe("answer");
    expect(onProgress.mock.calls).toEqual([[0], [0.5], [1]]);
    expect(requests.map(({ method, path }) => `${method} ${path}`)).toEqual([
      "POST /v1/x",
      `GET ${LINKS.events}`,
      `GET ${LINKS.results}`,
      `DELETE ${LINKS.self}`,
    ]);
    const [start, watch] = requests;
    expect(start?.body).toEqual({ a: 1 });
    expect(start?.headers.get("Prefer")).toBe("respond-async, wait=1");
    expect(start?.headers.get("Accept")).toBe("text/csv");
    expect(watch?.headers.get("Accept")).toBe("text/event-stream");
    expect(watch?.headers.has("Last-Event-ID")).toBe(false);
  });

  test("is watched across connections that break or end", async () => {
    const broken = new TypeError("network error");
    const requests = serve([
      () => inParts([eventOf(1, "running", 0.1)], broken),
      () => {
        throw new TypeError("Failed to fetch");
      },
      () => inParts([eventOf(2, "running", 0.2)]),
      () => inParts([eventOf(3, "successful", 1)]),
    ]);
    const { answer, onProgress } = ask();
    await vi.advanceTimersByTimeAsync(10_000);

    expect(await (await answer).text()).toBe("answer");
    expect(onProgress.mock.calls).toEqual([[0.1], [0.2], [1]]);
    const watched = requests.filter(({ path }) => path === LINKS.events);
    const lastIds = watched.map(({ headers }) => headers.get("Last-Event-ID"));
    expect(lastIds).toEqual([null, "1", "1", "2"]);
  });

  test("that fails answers with its problem, and is removed", async () => {
    const problem = {
      detail: "Too long.",
      code: "deadline_exceeded",
      status: 504,
      request_id: "r",
    };
    const requests = serve([() => inParts([eventOf(1, "failed")])], () => json(problem, 504));
    const { answer } = ask();

    await expect(answer).rejects.toThrow(ProblemError);
    await expect(answer).rejects.toThrow("Too long.");
    expect(removals(requests)).toEqual([LINKS.self]);
  });

  test("whose events are refused is not asked for again", async () => {
    const problem = { detail: "No such job.", code: "job_not_found", status: 404, request_id: "r" };
    const requests = serve([() => json(problem, 404)]);
    const { answer } = ask();

    await expect(answer).rejects.toThrow("No such job.");
    await vi.advanceTimersByTimeAsync(10_000);
    expect(requests.filter(({ path }) => path === LINKS.events)).toHaveLength(1);
  });

  test("that cannot be removed has its answer all the same", async () => {
    const refuse = () => json({ detail: "No.", code: "draining", status: 503 }, 503);
    serve([() => inParts([eventOf(1, "successful", 1)])], undefined, refuse);

    expect(await (await ask().answer).text()).toBe("answer");
  });

  test("is stopped and removed when its caller aborts", async () => {
    const stop = new AbortController();
    const requests = serve([() => inParts([eventOf(1, "running", 0.1)])], undefined, stopped);
    const { answer, onProgress } = ask(stop);
    await vi.waitFor(() => expect(onProgress).toHaveBeenCalled());
    stop.abort();
    await vi.advanceTimersByTimeAsync(10_000);

    await expect(answer).rejects.toMatchObject({ name: "AbortError" });
    await vi.waitFor(() => expect(removals(requests)).toEqual([LINKS.self]));
    expect(requests.some(({ path }) => path === LINKS.results)).toBe(false);
  });

  test("is stopped and removed when its caller aborts before it has begun", async () => {
    const stop = new AbortController();
    const requests = serve([], undefined, stopped);
    const { answer } = ask(stop);
    stop.abort();

    await expect(answer).rejects.toMatchObject({ name: "AbortError" });
    await vi.waitFor(() => expect(removals(requests)).toEqual([LINKS.self]));
  });

  test("is left alone when its caller aborts after the answer", async () => {
    const stop = new AbortController();
    const requests = serve([() => inParts([eventOf(1, "successful", 1)])]);
    const { answer } = ask(stop);
    await answer;
    const before = requests.length;
    stop.abort();

    expect(requests).toHaveLength(before);
  });
});
