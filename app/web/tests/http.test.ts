import { beforeEach, describe, expect, test } from "vitest";
import { authorization, call, getJson, isAbort, post, setKey } from "../src/api/http";
import { getMesh, listMeshes, makeSample } from "../src/api/meshes";
import { ProblemError } from "../src/api/problemError";
import { fakeService, json } from "./support/service";

beforeEach(() => setKey(""));

describe("the key", () => {
  test("goes with every request, without the space around it", async () => {
    const requests = fakeService({ "GET /v1": () => json({}), "POST /v1": () => json({}) });
    await call("/v1");
    setKey("  secret\n");
    await getJson("/v1");
    await post("/v1", {}, { Accept: "text/csv" });
    setKey(" ");
    await getJson("/v1");

    const sent = requests.map(({ headers }) => headers.get("Authorization"));
    expect(sent).toEqual([null, "Bearer secret", "Bearer secret", null]);
    expect(requests[2]?.headers.get("Accept")).toBe("text/csv");
  });

  test("is stored for the tab, and removed when it is emptied", () => {
    setKey("secret");
    expect(sessionStorage.getItem("geodesic-key")).toBe("secret");
    expect(authorization()).toEqual({ Authorization: "Bearer secret" });
    setKey("");
    expect(sessionStorage.getItem("geodesic-key")).toBeNull();
    expect(authorization()).toEqual({});
  });
});

describe("requests", () => {
  test("a post sends JSON", async () => {
    const requests = fakeService({ "POST /v1/x": () => json({}) });
    await post("/v1/x", { sources: [{ vertex: 0 }], note: "ä" });

    const [sent] = requests;
    expect(sent?.headers.get("Content-Type")).toBe("application/json");
    expect(sent?.body).toEqual({ sources: [{ vertex: 0 }], note: "ä" });
  });

  test("meshes are asked for by their escaped names", async () => {
    const requests = fakeService({
      "GET /v1/meshes": () => json({ meshes: [] }),
      "POST /v1/meshes": () => json({ id: "new" }, 201),
    });
    await listMeshes(null);
    await listMeshes("a b&c");
    await getMesh("../jobs?x");
    expect(await makeSample("knot", 5000)).toEqual({ id: "new" });

    expect(requests.map(({ method, path }) => `${method} ${path}`)).toEqual([
      "GET /v1/meshes?limit=100",
      "GET /v1/meshes?limit=100&cursor=a+b%26c",
      "GET /v1/meshes/..%2Fjobs%3Fx",
      "POST /v1/meshes?sample=knot&faces=5000",
    ]);
  });

  test("an aborted request is told from a failed one", async () => {
    fakeService({ "GET /": () => json({}) });
    const stop = new AbortController();
    stop.abort();
    const aborted = await getJson("/v1", stop.signal).catch((error: unknown) => error);

    expect(isAbort(aborted)).toBe(true);
    for (const other of [new Error("AbortError"), new DOMException("", "TimeoutError"), null]) {
      expect(isAbort(other)).toBe(false);
    }
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
    const error = await call("/v1/meshes/0123").catch((error: unknown) => error);

    expect(error).toBeInstanceOf(ProblemError);
    expect((error as ProblemError).problem).toEqual(problem);
    expect((error as ProblemError).message).toBe(problem.detail);
  });

  test.each([
    ["a proxy's page", "<html><h1>Bad gateway</h1></html>"],
    ["an empty body", ""],
    ["half a document", JSON.stringify(problem).slice(0, 50)],
  ])("%s is described by its status", async (_, text) => {
    const headers = { "X-Request-ID": "r2" };
    fakeService({ "GET /v1": () => new Response(text, { status: 502, headers }) });
    const error = await call("/v1").catch((error: unknown) => error);

    expect(error).toBeInstanceOf(ProblemError);
    expect((error as ProblemError).problem).toEqual({
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
    await expect(call("/v1")).rejects.toThrow(TypeError);
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
  const members = { title: "", code: "invalid_point", status: 422, request_id: "" };
  const detail = `${pointer}: ${message}`;
  const error = new ProblemError({ ...members, detail, errors: [{ pointer, message }] });
  expect(error.message).toBe(words);
  expect(error.problem.detail).toBe(detail);
});
