import { GeodesicClient, toWire } from "geodesic-client";
import { describe, expect, test, vi } from "vitest";
import { npyOf } from "../support/npy";
import { fakeService, inParts, json } from "../support/service";

const client = new GeodesicClient();
const SOURCE = { vertex: 0, start_distance: 0 };
const BOUND = { type: "relative", value: 0.01, kind: "guaranteed" };
const UNREACHABLE = { disconnected: 1, beyond_max_distance: 0 };

function distances(values: number[], timing = "queue;dur=0.1, compute;dur=12.5"): Response {
  const body = npyOf(Float64Array.from(values), "<f8", [values.length]);
  const headers = {
    "Server-Timing": timing,
    "Geodesic-Mesh-Id": "m",
    "Geodesic-Method": "exact",
    "Geodesic-Error-Bound": JSON.stringify(BOUND),
    "Geodesic-Unreachable": JSON.stringify(UNREACHABLE),
    "Geodesic-Warnings": '["careful"]',
  };
  return new Response(body, { headers });
}

describe("distances", () => {
  test("of a short query are asked for at once, as an array", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => distances([0, 2, Infinity, 1]),
    });
    const onProgress = vi.fn();

    expect(await client.distances("m", SOURCE, { maxDistance: 3, onProgress })).toEqual({
      distances: new Float64Array([0, 2, Infinity, 1]),
      mesh_id: "m",
      method: "exact",
      error_bound: BOUND,
      unreachable: UNREACHABLE,
      warnings: ["careful"],
      seconds: 0.0125,
    });
    expect(requests).toHaveLength(1);
    expect(requests[0]?.body).toEqual({ sources: [SOURCE], max_distance: 3 });
    expect(requests[0]?.headers.get("Accept")).toBe("application/x-npy");
    expect(onProgress).not.toHaveBeenCalled();
  });

  test("of a long query come from a job", async () => {
    const event = (id: number, status: string, progress: number) =>
      `id: ${id}\ndata: ${JSON.stringify({ status, progress })}\n\n`;
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () => json({ status: "accepted", id: "j" }, 202),
      "GET /v1/jobs/j/events": () =>
        inParts([event(1, "running", 0.25) + event(2, "running", 0.5), event(3, "successful", 1)]),
      "GET /v1/jobs/j/results": () => distances([0, 3], "kept"),
      "DELETE /v1/jobs/j": () => json({ status: "successful" }),
    });
    const onProgress = vi.fn();
    const found = await client.distances({ id: "m" }, [0, SOURCE], { onProgress });

    expect(found.distances).toEqual(new Float64Array([0, 3]));
    expect(found.seconds).toBeNull();
    expect(onProgress.mock.calls).toEqual([[0.25], [0.5], [1]]);
    expect(requests.map(({ method }) => method)).toEqual(["POST", "GET", "GET", "DELETE"]);
  });

  test("with more about each point have arrays of it, with -1 or infinity for none", async () => {
    const requests = fakeService({
      "POST /v1/meshes/m/distances": () =>
        json({ distances: [0, null], nearest_source: [1, null], upper: [0, null], stats: {} }),
    });
    const include = ["nearest_source" as const, "upper" as const];
    expect(await client.distances("m", 0, { include, certify: true })).toMatchObject({
      distances: new Float64Array([0, Infinity]),
      nearest_source: new Int32Array([1, -1]),
      upper: new Float64Array([0, Infinity]),
    });
    expect(requests[0]?.body).toEqual({ sources: [0], include, certify: true });
    expect(requests[0]?.headers.get("Accept")).toBe("application/json");
  });
});

test("values are sent as an array", async () => {
  const answer = { isolines: [], error_bound: BOUND, warnings: [] };
  let form = new FormData();
  const send = async (_: unknown, init?: RequestInit) => {
    form = init?.body as FormData;
    return json(answer);
  };
  const values = new Float64Array([0.5, Number.NaN]);
  const other = new GeodesicClient("http://x", { fetch: send as typeof fetch });
  expect(await other.isolines("m", values, { levels: [0.25] })).toEqual(answer);

  expect(await (form.get("request") as Blob).text()).toBe('{"levels":[0.25]}');
  const sent = await (form.get("values") as Blob).arrayBuffer();
  expect(new Uint8Array(sent)).toEqual(new Uint8Array(npyOf(values, "<f8", [2])));
});

test("a question has the service's names, and what is within it stays", () => {
  const { signal } = new AbortController();
  const cost = { slope: "tobler" };
  const question = { maxDistance: 1, relativeError: 2, k: 3, cost };
  expect(toWire({ ...question, signal, onProgress: () => undefined })).toEqual({
    max_distance: 1,
    relative_error: 2,
    k: 3,
    cost,
  });
});
