import { describe, expect, test, vi } from "vitest";
import type { Question, RouteQuestion } from "../src/api/queries";
import {
  askDistances,
  askIsolines,
  askProof,
  askRoute,
  askSteps,
  askTerritories,
  locate,
  pointOf,
} from "../src/api/queries";
import type { Outline } from "../src/api/types";
import { questionOf } from "../src/ask/fields";
import { isolinesOf } from "../src/ask/isolines";
import { INITIAL, type State } from "../src/state/state";
import { npyOf } from "./support/npy";
import { placesAt } from "./support/points";
import { fakeService, inParts, json } from "./support/service";

const { signal } = new AbortController();
const QUESTION: Question = { sources: [{ vertex: 0, start_distance: 0 }] };
const BOUND = { type: "relative", value: 0.01, kind: "guaranteed" };
const UNREACHABLE = { disconnected: 1, beyond_max_distance: 0 };

function distances(values: number[], timing = "queue;dur=0.1, compute;dur=12.5"): Response {
  const body = npyOf(Float64Array.from(values), "<f8", [values.length]);
  const headers = {
    "Server-Timing": timing,
    "Geodesic-Error-Bound": JSON.stringify(BOUND),
    "Geodesic-Unreachable": JSON.stringify(UNREACHABLE),
    "Geodesic-Warnings": '["careful"]',
  };
  return new Response(body, { headers });
}

describe("isolines", () => {
  const state: State = { ...INITIAL, mesh: "m", places: placesAt({ vertex: 0 }) };

  test("are asked for by number or by distance, up to the largest one", () => {
    expect(isolinesOf(state, { count: 7 }, 3)).toMatchObject({ count: 7, method: "exact" });
    expect(isolinesOf(state, { spacing: 0.5 }, 1.75)).toMatchObject({ levels: [0.5, 1, 1.5] });
    expect(isolinesOf(state, { spacing: 2 }, 1.75)).toMatchObject({ levels: [] });
  });

  test("of a fast field are approximate", () => {
    const question = isolinesOf({ ...state, method: "fast" }, { count: 7 }, 3);
    expect(question).toMatchObject({ method: "approximate", relative_error: state.error });
    expect(question).not.toHaveProperty("effort");
  });

  test("come with all that the service says of them", async () => {
    const lines = [{ points: [[0, 0, 0]], closed: true }];
    const answer = { isolines: [{ level: 1, lines }], error_bound: BOUND, warnings: ["careful"] };
    const requests = fakeService({ "POST /v1/meshes/m/isolines": () => json(answer) });
    const question = { ...QUESTION, count: 3 };
    expect(await askIsolines("m", question, () => undefined, signal)).toEqual(answer);
    expect(requests[0]?.body).toEqual(question);
  });
});

test("a proof is asked for with what each face contributes", async () => {
  const certificate = { holds: true, relative_gap: 1e-10, worst_face: 1, worst_violation: 2e-12 };
  const answer = { certificate, violations: [0, 2e-12] };
  const requests = fakeService({ "POST /v1/meshes/m/distances": () => json(answer) });
  expect(await askProof("m", QUESTION, () => undefined, signal)).toEqual(answer);
  expect(requests[0]?.body).toEqual({ ...QUESTION, certify: true, include: ["violations"] });
});

describe("distances", () => {
  test("of a short query are asked for at once", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => distances([0, 2, Infinity, 1]),
    });
    const onProgress = vi.fn();
    const field = await askDistances("m", QUESTION, onProgress, signal);

    expect(field).toEqual({
      distances: new Float64Array([0, 2, Infinity, 1]),
      largest: 2,
      bound: BOUND,
      unreachable: UNREACHABLE,
      warnings: ["careful"],
      seconds: 0.0125,
    });
    expect(requests).toHaveLength(1);
    expect(requests[0]?.body).toEqual(QUESTION);
    expect(requests[0]?.headers.get("Accept")).toBe("application/x-npy");
    expect(onProgress).not.toHaveBeenCalled();
  });

  test("of a long query come from a job", async () => {
    const links = {
      self: "/v1/jobs/j",
      results: "/v1/jobs/j/results",
      events: "/v1/jobs/j/events",
    };
    const event = (id: number, status: string, progress: number) =>
      `id: ${id}\ndata: ${JSON.stringify({ status, progress, links })}\n\n`;
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ status: "accepted", links }, 202),
      "GET /v1/jobs/j/events": () =>
        inParts([event(1, "running", 0.25) + event(2, "running", 0.5), event(3, "successful", 1)]),
      "GET /v1/jobs/j/results": () => distances([0, 3]),
      "DELETE /v1/jobs/j": () => json({ status: "successful" }),
    });
    const onProgress = vi.fn();
    const field = await askDistances("m", QUESTION, onProgress, signal);

    expect(field.largest).toBe(3);
    expect(onProgress.mock.calls).toEqual([[0.25], [0.5], [1]]);
    expect(requests.map(({ method }) => method)).toEqual(["POST", "GET", "GET", "DELETE"]);
  });

  test("from the cache took no time of computing", async () => {
    fakeService({
      "POST /v1/meshes/m/distances": () => distances([0, Infinity], "kept"),
    });
    const field = await askDistances("m", QUESTION, () => undefined, signal);

    expect(field.seconds).toBeNull();
    expect(field.largest).toBe(0);
  });

  test("territories have -1 where no source is near", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ nearest_source: [1, null, 0] }),
    });
    expect(await askTerritories("m", QUESTION, signal)).toEqual(new Int32Array([1, -1, 0]));
    expect(requests[0]?.body).toEqual({ ...QUESTION, include: ["nearest_source"] });
  });
});

describe("paths", () => {
  const route: RouteQuestion = {
    sources: [{ vertex: 4 }, { vertex: 5 }],
    target: { vertex: 9 },
    waypoints: [],
    barriers: [7],
  };

  async function outlinesOf(question: RouteQuestion, isOld = () => false): Promise<Outline[]> {
    const outlines = [];
    for await (const outline of askRoute("m", question, signal, isOld)) outlines.push(outline);
    return outlines;
  }

  test("of one source are asked for directly, fast ones first", async () => {
    const lengths = [3, 1];
    const requests = fakeService({
      "POST /v1/meshes/m/path": () => json({ length: lengths.shift() }),
    });
    const { sources, ...rest } = route;
    const question = { sources: sources.slice(0, 1), ...rest };
    expect(await outlinesOf(question)).toEqual([{ length: 3 }, { length: 1 }]);

    expect(requests.map(({ body }) => body)).toEqual([
      { source: { vertex: 4 }, method: "fast", ...rest },
      { source: { vertex: 4 }, method: "exact", ...rest },
    ]);
  });

  test("that nobody waits for any more are not asked for exactly", async () => {
    fakeService({ "POST /v1/meshes/m/path": () => json({ length: 3 }) });
    const question = { ...route, sources: route.sources.slice(0, 1) };

    expect(await outlinesOf(question, () => true)).toEqual([{ length: 3 }]);
  });

  test.each([
    ["target", [], { vertex: 9 }],
    ["first waypoint", [{ vertex: 6 }, { vertex: 8 }], { vertex: 6 }],
  ])("of several sources start at the one nearest to the %s", async (_, waypoints, first) => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ nearest_source: [1] }),
      "POST /v1/meshes/m/path": () => json({ length: 2 }),
    });
    const { sources, ...rest } = { ...route, waypoints };
    const [outline] = await outlinesOf({ sources, ...rest }, () => true);
    expect(outline).toEqual({ length: 2 });

    expect(requests.map(({ body }) => body)).toEqual([
      { sources, targets: [first], barriers: [7], include: ["nearest_source"] },
      { source: { vertex: 5 }, method: "fast", ...rest },
    ]);
  });

  test("have the steps of their search at an address of their own", async () => {
    const steps = [{ leg: 0, name: "exact", bound: 1, windows: 2, faces: [3] }];
    const requests = fakeService({ "POST /v1/meshes/m/path/steps": () => json({ steps }) });
    const { sources, ...rest } = route;
    expect(await askSteps("m", { sources: sources.slice(0, 1), ...rest }, signal)).toEqual(steps);

    expect(requests.map(({ body }) => body)).toEqual([{ source: { vertex: 4 }, ...rest }]);
  });

  test("without a way to any source start at the first one", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ nearest_source: [null] }),
      "POST /v1/meshes/m/path": () => json({ length: null, reason: "disconnected" }),
    });
    await outlinesOf(route);

    expect(requests[1]?.body).toMatchObject({ source: { vertex: 4 } });
  });
});

describe("points", () => {
  test("positions are located", async () => {
    const located = { face: 3, barycentric: [0.5, 0.25, 0.25], position: [1, 2, 3], distance: 4 };
    const requests = fakeService({ "POST /v1/meshes/m/locate": () => json({ points: [located] }) });

    const point = { face: 3, barycentric: [0.5, 0.25, 0.25] };
    expect(await locate("m", [1, 2, 3])).toEqual({ point, distance: 4 });
    expect(requests[0]?.body).toEqual({ points: [[1, 2, 3]] });
  });

  test("a vertex is a vertex, the first one too", () => {
    expect(pointOf({ vertex: 0, face: null, barycentric: null })).toEqual({ vertex: 0 });
    expect(pointOf({ vertex: null, face: 0, barycentric: [1, 0, 0] })).toEqual({
      face: 0,
      barycentric: [1, 0, 0],
    });
  });

  test("a point that is nowhere is an error", async () => {
    fakeService({ "POST /v1/meshes/m/locate": () => json({ points: [null] }) });

    await expect(locate("m", [1, 2, 3])).rejects.toThrow("no point of the surface");
    expect(() => pointOf({})).toThrow("neither at a vertex nor in a face");
  });
});

describe("the question of a state", () => {
  const state: State = { ...INITIAL, mesh: "m", places: placesAt({ vertex: 1 }), error: 0.05 };

  test("has what differs from the service's defaults", () => {
    expect(questionOf(state, "exact")).toEqual({ sources: [{ vertex: 1 }], method: "exact" });
    expect(questionOf(state, "approximate")).toMatchObject({ relative_error: 0.05 });
    expect(questionOf({ ...state, effort: 4 }, "fast")).toEqual({
      sources: [{ vertex: 1 }],
      method: "fast",
      effort: 4,
    });
    expect(questionOf({ ...state, maxDistance: 2, barriers: [3] }, "exact")).toEqual({
      sources: [{ vertex: 1 }],
      method: "exact",
      max_distance: 2,
      barriers: [3],
    });
  });
});
