import type { PathAnswer } from "geodesic-client";
import { describe, expect, test } from "vitest";
import { askProof, fieldOf, questionOf } from "../src/ask/fields";
import { isolinesOf } from "../src/ask/isolines";
import { askRoute, type RouteQuestion } from "../src/ask/routes";
import { located } from "../src/panel/controls";
import { pointOf } from "../src/state/point";
import { INITIAL, type State } from "../src/state/state";
import { placesAt } from "./support/points";
import { fakeService, json } from "./support/service";

const { signal } = new AbortController();

describe("isolines", () => {
  const state: State = { ...INITIAL, mesh: "m", places: placesAt({ vertex: 0 }) };

  test("are asked for by number or by distance, up to the largest one", () => {
    expect(isolinesOf(state, { count: 7 }, 3)).toMatchObject({ count: 7, method: "exact" });
    expect(isolinesOf(state, { spacing: 0.5 }, 1.75)).toMatchObject({ levels: [0.5, 1, 1.5] });
    expect(isolinesOf(state, { spacing: 2 }, 1.75)).toMatchObject({ levels: [] });
  });

  test("of a fast field are approximate", () => {
    const question = isolinesOf({ ...state, method: "fast" }, { count: 7 }, 3);
    expect(question).toMatchObject({ method: "approximate", relativeError: state.error });
    expect(question).not.toHaveProperty("effort");
  });
});

test("a proof is asked for with what each face contributes", async () => {
  const certificate = { holds: true, relative_gap: 1e-10, worst_face: 1, worst_violation: 2e-12 };
  const answer = { distances: [0, 1], certificate, violations: [0, 2e-12] };
  const requests = fakeService({ "POST /v1/meshes/m/distances": () => json(answer) });
  const proof = await askProof("m", { sources: [{ vertex: 0 }] }, { signal });
  expect(proof).toEqual({ certificate, violations: new Float64Array([0, 2e-12]) });
  expect(requests[0]?.body).toEqual({
    sources: [{ vertex: 0 }],
    certify: true,
    include: ["violations"],
  });
});

test.each([
  [[0, 2, Infinity, 1], 2],
  [[0, Infinity], 0],
])("the largest of the distances %j is %d", (distances, largest) => {
  const answer = { distances: new Float64Array(distances) };
  expect(fieldOf(answer as Parameters<typeof fieldOf>[0]).largest).toBe(largest);
});

describe("paths", () => {
  const route: RouteQuestion = {
    sources: [{ vertex: 4 }, { vertex: 5 }],
    target: { vertex: 9 },
    waypoints: [],
    barriers: [7],
  };

  async function outlinesOf(
    question: RouteQuestion,
    rests = async () => true,
  ): Promise<PathAnswer[]> {
    const outlines = [];
    for await (const outline of askRoute("m", question, signal, rests)) outlines.push(outline);
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

    expect(await outlinesOf(question, async () => false)).toEqual([{ length: 3 }]);
  });

  test.each([
    ["target", [], { vertex: 9 }],
    ["first waypoint", [{ vertex: 6 }, { vertex: 8 }], { vertex: 6 }],
  ])("of several sources start at the one nearest to the %s", async (_, waypoints, first) => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ distances: [1], nearest_source: [1] }),
      "POST /v1/meshes/m/path": () => json({ length: 2 }),
    });
    const { sources, ...rest } = { ...route, waypoints };
    const [outline] = await outlinesOf({ sources, ...rest }, async () => false);
    expect(outline).toEqual({ length: 2 });

    expect(requests.map(({ body }) => body)).toEqual([
      { sources, targets: [first], barriers: [7], include: ["nearest_source"] },
      { source: { vertex: 5 }, method: "fast", ...rest },
    ]);
  });

  test("without a way to any source start at the first one", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ distances: [null], nearest_source: [null] }),
      "POST /v1/meshes/m/path": () => json({ length: null, reason: "disconnected" }),
    });
    await outlinesOf(route);

    expect(requests[1]?.body).toMatchObject({ source: { vertex: 4 } });
  });
});

describe("points", () => {
  test("positions are located, and it is told how far from the surface they are", async () => {
    const found = { face: 3, barycentric: [0.5, 0.25, 0.25], position: [1, 2, 3], distance: 4 };
    const requests = fakeService({
      "POST /v1/meshes/m/locate": () => json({ points: [found] }),
      "GET /v1/meshes/m": () => json({ mean_edge_length: 1 }),
    });
    const places = [{ point: { position: [1, 2, 3] as [number, number, number] }, name: "P" }];
    const { change, notes } = await located("m", { places });

    const point = { face: 3, barycentric: [0.5, 0.25, 0.25] };
    expect(change).toEqual({ places: [{ point, name: "P" }] });
    expect(notes.join()).toContain("4 away from the surface");
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
    fakeService({
      "POST /v1/meshes/m/locate": () => json({ points: [null] }),
      "GET /v1/meshes/m": () => json({ mean_edge_length: 1 }),
    });
    const places = [{ point: { position: [1, 2, 3] as [number, number, number] }, name: "" }];
    await expect(located("m", { places })).rejects.toThrow("no point of the surface");
    expect(() => pointOf({})).toThrow("neither at a vertex nor in a face");
  });
});

describe("the question of a state", () => {
  const state: State = { ...INITIAL, mesh: "m", places: placesAt({ vertex: 1 }), error: 0.05 };

  test("has what differs from the service's defaults", () => {
    expect(questionOf(state, "exact")).toEqual({ sources: [{ vertex: 1 }], method: "exact" });
    expect(questionOf(state, "approximate")).toMatchObject({ relativeError: 0.05 });
    expect(questionOf({ ...state, effort: 4 }, "fast")).toEqual({
      sources: [{ vertex: 1 }],
      method: "fast",
      effort: 4,
    });
    expect(questionOf({ ...state, maxDistance: 2, barriers: [[3]] }, "exact")).toEqual({
      sources: [{ vertex: 1 }],
      method: "exact",
      maxDistance: 2,
      barriers: [3],
    });
  });
});
