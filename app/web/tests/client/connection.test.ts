import { GeodesicClient, ProblemError } from "geodesic-client";
import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { inWords } from "../../src/problemWords";
import { isAbort, service, setKey } from "../../src/service";
import { fakeService, json } from "../support/service";

beforeEach(() => setKey(""));

describe("the key", () => {
  test("goes with every request, without the space around it", async () => {
    const requests = fakeService({ "GET /v1": () => json({}), "POST /v1": () => json({}) });
    await service.about();
    setKey("  secret\n");
    await service.about();
    await service.sample("knot");
    setKey(" ");
    await service.about();

    const sent = requests.map(({ headers }) => headers.get("Authorization"));
    expect(sent).toEqual([null, "Bearer secret", "Bearer secret", null]);
  });

  test("is stored for the tab, and removed when it is emptied", () => {
    setKey("secret");
    expect(sessionStorage.getItem("geodesic-key")).toBe("secret");
    expect(service.apiKey).toBe("secret");
    setKey("");
    expect(sessionStorage.getItem("geodesic-key")).toBeNull();
    expect(service.apiKey).toBeNull();
  });
});

describe("requests", () => {
  test("a question is sent in the service's names", async () => {
    const requests = fakeService({ "POST /v1/meshes/x/nearest": () => json({ nearest: [] }) });
    await service.nearest("x", 0, [{ vertex: 1 }], { maxDistance: 2, signal: undefined });

    const [sent] = requests;
    expect(sent?.headers.get("Content-Type")).toBe("application/json");
    expect(sent?.body).toEqual({ source: 0, candidates: [{ vertex: 1 }], max_distance: 2 });
  });

  test("go below the address, which may have a path", async () => {
    const requests = fakeService({ "GET /": () => json({}) });
    for (const address of ["http://x", "http://x/geo", "http://x/geo/"]) {
      await new GeodesicClient(address).about();
    }
    expect(requests.map(({ path }) => path)).toEqual(["/v1", "/geo/v1", "/geo/v1"]);
  });

  test("meshes and jobs are asked for by their escaped names", async () => {
    const requests = fakeService({
      "GET /v1/meshes": () => json({ meshes: [] }),
      "POST /v1/meshes": () => json({ id: "new" }, 201),
      "DELETE /v1/jobs": () => json({}),
    });
    await service.meshes();
    await service.meshes({ limit: 100, cursor: "a b&c" });
    await service.mesh("../jobs?x");
    await service.deleteJob("a/b");
    expect(await service.sample("knot", 5000)).toEqual({ id: "new" });

    expect(requests.map(({ method, path }) => `${method} ${path}`)).toEqual([
      "GET /v1/meshes",
      "GET /v1/meshes?limit=100&cursor=a+b%26c",
      "GET /v1/meshes/..%2Fjobs%3Fx",
      "DELETE /v1/jobs/a%2Fb",
      "POST /v1/meshes?sample=knot&faces=5000",
    ]);
  });

  test("an aborted request is told from a failed one", async () => {
    fakeService({ "GET /": () => json({}) });
    const stop = new AbortController();
    stop.abort();
    const aborted = await service.about({ signal: stop.signal }).catch((error: unknown) => error);

    expect(isAbort(aborted)).toBe(true);
    for (const other of [new Error("AbortError"), new DOMException("", "TimeoutError"), null]) {
      expect(isAbort(other)).toBe(false);
    }
  });
});

describe("a busy service", () => {
  beforeEach(() => void vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] }));
  afterEach(() => void vi.useRealTimers());

  const busy = (status: number, seconds?: number) =>
    json({ detail: "Busy.", code: "busy", status }, status, {
      ...(seconds !== undefined && { "Retry-After": String(seconds) }),
    });

  test("is asked again after the time that it tells", async () => {
    const answers = [busy(503, 3), busy(429, 5), json({ version: "1" })];
    const requests = fakeService({ "GET /v1": () => answers.shift() as Response });
    const answer = service.about();
    for (const [milliseconds, count] of [
      [2999, 1],
      [1, 2],
      [4999, 2],
      [1, 3],
    ] as const) {
      await vi.advanceTimersByTimeAsync(milliseconds);
      expect(requests).toHaveLength(count);
    }
    expect(await answer).toEqual({ version: "1" });
  });

  test.each([
    ["tells no time", () => busy(503)],
    ["tells a long time", () => busy(429, 3600)],
    ["refuses otherwise", () => busy(409, 1)],
  ])("that %s is not asked again", async (_, refuse) => {
    const requests = fakeService({ "GET /v1": refuse });
    await expect(service.about()).rejects.toThrow("busy: Busy.");
    expect(requests).toHaveLength(1);
  });

  test("is not asked for ever", async () => {
    const requests = fakeService({ "GET /v1": () => busy(503, 1) });
    const refused = expect(service.about()).rejects.toMatchObject({ status: 503, retryAfter: 1 });
    await vi.advanceTimersByTimeAsync(100_000);
    await refused;
    expect(requests).toHaveLength(8);
  });

  test("is not asked again after an abort", async () => {
    const requests = fakeService({ "GET /v1": () => busy(503, 10) });
    const stop = new AbortController();
    const answer = service.about({ signal: stop.signal });
    const aborted = expect(answer).rejects.toMatchObject({ name: "AbortError" });
    await vi.advanceTimersByTimeAsync(1000);
    stop.abort();
    await aborted;
    expect(requests).toHaveLength(1);
  });
});

describe("errors", () => {
  const problem = {
    type: "/problems/mesh_not_found",
    title: "Mesh not found",
    status: 404,
    detail: "There is no mesh 0123.",
    code: "mesh_not_found",
    request_id: "r1",
    hint: "List the meshes.",
  };

  test("a problem document becomes an exception with all of its members", async () => {
    fakeService({ "GET /v1": () => json(problem, 404) });
    const error = await service.mesh("0123").catch((error: unknown) => error);

    expect(error).toBeInstanceOf(ProblemError);
    expect(error).toMatchObject({
      document: problem,
      message: "mesh_not_found: There is no mesh 0123. (List the meshes.)",
      code: "mesh_not_found",
      detail: "There is no mesh 0123.",
      hint: "List the meshes.",
      errors: [],
      requestId: "r1",
    });
  });

  test.each([
    ["a proxy's page", "<html><h1>Bad gateway</h1></html>"],
    ["an empty body", ""],
    ["another document", "[]"],
    ["half a document", JSON.stringify(problem).slice(0, 50)],
  ])("%s is described by its status", async (_, text) => {
    const headers = { "X-Request-ID": "r2" };
    fakeService({ "GET /v1": () => new Response(text, { status: 502, headers }) });
    const error = await service.about().catch((error: unknown) => error);

    expect(error).toBeInstanceOf(ProblemError);
    expect((error as ProblemError).document).toEqual({
      detail: "The service answered with status 502 and gave no reason.",
      code: "unknown",
      status: 502,
      request_id: "r2",
    });
  });

  test("a network that is down throws what fetch throws", async () => {
    fakeService({
      "GET /v1": () => {
        throw new TypeError("Failed to fetch");
      },
    });
    await expect(service.about()).rejects.toThrow(TypeError);
  });
});

test.each([
  ["/source/vertex", "Source: it does not exist"],
  ["/sources/3/vertex", "Sources: it does not exist"],
  ["/waypoints/0/edge/1", "Via: it does not exist"],
  ["/barriers/12", "Barriers: it does not exist"],
  ["/points/0", "it does not exist"],
])("a message names a field, and not %s", (pointer, words) => {
  const message = "it does not exist";
  const detail = `${pointer}: ${message}`;
  expect(inWords({ detail, errors: [{ pointer, message }] })).toBe(words);
});
