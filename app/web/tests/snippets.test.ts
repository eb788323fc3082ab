import { expect, test } from "vitest";
import { curlOf, pythonOf } from "../src/panel/snippets";
import { INITIAL, type State } from "../src/state/state";
import { placesAt } from "./support/points";

const HOST = "https://host:8000/geodesic/";
const SOURCE = { vertex: 1 };
const STATE: State = {
  ...INITIAL,
  mesh: "m",
  places: placesAt(SOURCE, { vertex: 2 }),
  starts: 2,
};

/** Return the body within a command. */
function bodyOf(text: string): unknown {
  return JSON.parse(/'(\{.*\})'/.exec(text)?.[1] ?? "null");
}

test("without a target the distances from all sources are asked for", () => {
  const state: State = { ...STATE, method: "approximate", error: 0.05, maxDistance: 2 };
  const curl = curlOf(state, SOURCE, HOST, false);

  expect(curl).toContain(`curl '${HOST}v1/meshes/m/distances'`);
  expect(bodyOf(curl)).toEqual({
    sources: [SOURCE, { vertex: 2 }],
    method: "approximate",
    relative_error: 0.05,
    max_distance: 2,
  });
  expect(pythonOf(state, SOURCE, HOST, false).split("\n")).toEqual([
    "from geodesic_client import Client",
    "",
    `client = Client("${HOST}")`,
    'found = client.distances("m", sources=[{"vertex":1},{"vertex":2}], method="approximate", ' +
      "relative_error=0.05, max_distance=2)",
    "print(found.distances)",
    "",
  ]);
});

test("with a target the path from the source in question is asked for", () => {
  const state: State = {
    ...STATE,
    places: placesAt(SOURCE, { vertex: 5 }, { vertex: 9 }),
    starts: 1,
    barriers: [[7]],
  };
  const body = { source: SOURCE, target: { vertex: 9 }, waypoints: [{ vertex: 5 }], barriers: [7] };
  const curl = curlOf(state, SOURCE, HOST, false);

  expect(curl).toContain(`curl '${HOST}v1/meshes/m/path'`);
  expect(bodyOf(curl)).toEqual(body);
  expect(pythonOf(state, SOURCE, HOST, false)).toContain(
    'client.path("m", source={"vertex":1}, target={"vertex":9}, waypoints=[{"vertex":5}], barriers=[7])',
  );
});

test("a key is named, and never written", () => {
  expect(curlOf(STATE, SOURCE, HOST, false)).not.toContain("Authorization");
  expect(pythonOf(STATE, SOURCE, HOST, false)).not.toContain("os.environ");
  expect(curlOf(STATE, SOURCE, HOST, true)).toContain('"Authorization: Bearer $GEODESIC_KEY"');
  const python = pythonOf(STATE, SOURCE, HOST, true);
  expect(python).toContain(
    'Client("https://host:8000/geodesic/", api_key=os.environ["GEODESIC_KEY"])',
  );
  expect(python.split("\n")).toContain("import os");
});
