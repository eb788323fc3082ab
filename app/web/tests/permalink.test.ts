import { describe, expect, test } from "vitest";
import { readState, type WrittenState, writeBarriers, writeState } from "../src/state/permalink";
import { backTo, CURVES, INITIAL, PALETTES, type State, withCut } from "../src/state/state";
import { placesAt, randomPoint } from "./support/points";
import { Random } from "./support/random";

const MESH_M: State = { ...INITIAL, mesh: "m" };

function searchOf(state: State): string {
  return new URL(writeState(state), "http://host").search;
}

function randomState(random: Random, most = 2): State {
  const round = (x: number) => Number(x.toFixed(4));
  const view = random.pick([null, Array.from({ length: 6 }, () => round(6 * random.next() - 3))]);
  const name = () => random.pick(["", "Hut", "2 * 3", "a&b=c %2A é"]);
  const places = random.list(5, () => ({ point: randomPoint(random), name: name() }));
  const barriers = random.list(3, () => {
    const faces = new Set([random.below(60), ...random.list(40, () => random.below(60))]);
    return [...faces].sort((a, b) => a - b);
  });
  return {
    mesh: random.pick([null, "0123456789abcdef", "f46a3f2a"]),
    cut: random.pick([null, randomCut(random, most)]),
    places: places.length > 0 ? places : [],
    starts: places.length > 0 ? 1 + random.below(places.length) : 1,
    walk: random.pick([null, [random.size(), -random.size(), 0] as [number, number, number]]),
    barriers,
    method: random.pick(["exact", "approximate", "fast"] as const),
    error: random.pick([INITIAL.error, random.size()]),
    effort: random.pick([1, 2, 4, 8] as const),
    maxDistance: random.pick([null, random.size()]),
    slope: random.pick([null, { rule: "tobler", up: "z" }, { rule: "naismith", up: "y" }] as const),
    faceCosts: null,
    values: null,
    isReadable: true,
    unit: random.pick(["", "mm", "µm & more"]),
    distances: random.pick([true, false]),
    shade: random.pick(["distance", "territories", "difference", "proof"] as const),
    versus: random.pick([null, "exact", "approximate", "fast"] as const),
    lines: random.pick([null, { count: 1 + random.below(99) }, { spacing: random.size() }]),
    polar: random.pick([true, false]),
    boundary: random.pick([true, false]),
    palette: random.pick(PALETTES),
    least: random.pick([null, -random.size()]),
    range: random.pick([null, random.size()]),
    labels: random.pick([true, false]),
    wireframe: random.pick([true, false]),
    flat: random.pick([true, false]),
    unroll: random.pick([true, false]),
    section: random.pick([null, { axis: "y", share: 0.25 }] as const),
    up: random.pick(view ? (["y", "z"] as const) : ([null, "y", "z"] as const)),
    view,
  };
}

/** Return a cut of a mesh that was cut a few times, at most. */
function randomCut(random: Random, most: number): State["cut"] {
  if (most === 0) return null;
  const along = CURVES.slice(random.below(CURVES.length));
  return { along, back: backTo({ ...randomState(random, most - 1), mesh: "f46a3f2a" }) };
}

describe("a round trip", () => {
  test("reads back what was written", () => {
    const random = new Random(3);
    for (let i = 0; i < 1000; i++) {
      const state = randomState(random);
      expect(readState(searchOf(state)), writeState(state)).toEqual(state);
    }
  });

  test("of an address leads to the same address", () => {
    const random = new Random(4);
    for (let i = 0; i < 500; i++) {
      const search = searchOf(randomState(random));
      expect(searchOf(readState(search) as State)).toBe(search);
    }
  });
});

describe("writing", () => {
  test("the initial state has the shortest address", () => {
    expect(writeState(INITIAL)).toBe(".");
  });

  test("points can be read in the address", () => {
    const state: State = {
      ...INITIAL,
      mesh: "m",
      places: [
        ...placesAt({ vertex: 0 }, { face: 7, barycentric: [0.2, 0.3, 0.5] }, { vertex: 5 }),
        { point: { edge: [1, 2], t: 0.5 }, name: "Old mill" },
      ],
      starts: 2,
      barriers: [[40, 3, 42, 41], [5]],
    };
    expect(writeState(state)).toBe(
      "?mesh=m&source=v0;f7:.2,.3&via=v5&target=e1-2:0.5*Old+mill&barriers=3,40-42;5",
    );
  });

  test.each(["source", "via"])("ten points take fewer than 400 characters (%s)", (kind) => {
    const weights = [0.1234, 0.2345, 0.6421] as [number, number, number];
    const point = (i: number) => ({ face: 1_234_560 + i, barycentric: weights });
    const state: State = {
      ...INITIAL,
      mesh: "3cc29413895dedad8aff0f06a28cd3fa",
      places: placesAt(...Array.from({ length: 10 }, (_, i) => point(i))),
      starts: kind === "source" ? 10 : 1,
      shade: "territories",
      up: "z",
      view: [-1.23456, 1.23456, 2.34567, -0.12345, -0.12345, -0.12345],
    };
    expect(new URL(writeState(state), "http://127.0.0.1:8000").href.length).toBeLessThan(400);
    expect(readState(searchOf(state)).places).toEqual(state.places);
  });

  test("a cut is written with what was cut", () => {
    const whole: State = { ...INITIAL, mesh: "m", places: placesAt({ vertex: 0 }, { vertex: 5 }) };
    const cut = { ...INITIAL, ...withCut("n", ["path"], whole) };
    expect(writeState(cut)).toBe(
      "?mesh=n&cut=path&cut_from=mesh%3Dm%26source%3Dv0%26target%3Dv5&boundary=1",
    );
  });

  test("a mesh with odd characters does not become other parameters", () => {
    const state = { ...INITIAL, mesh: "a&b=c#d e+f%2C" };
    expect(readState(searchOf(state))).toEqual(state);
  });
});

describe("reading", () => {
  const initial: WrittenState = INITIAL;

  test.each(["", "?", "?nonsense", "?mesh", "?MESH=m"])("“%s” asks for nothing", (search) => {
    expect({ ...readState(search), mesh: null }).toEqual(initial);
  });

  test("positions are read as they are written by hand", () => {
    const { places, starts } = readState("?source=p1,2,3&target=12");
    expect(places.map(({ point }) => point)).toEqual([{ position: [1, 2, 3] }, { vertex: 12 }]);
    expect(starts).toBe(1);
  });

  test("a point that is none is refused by name", () => {
    expect(() => readState("?source=v0&source=oops")).toThrow("“oops” is not a point");
    expect(() => readState("?target=")).toThrow("“” is not a point");
    expect(() => readState("?via=v0,v1")).toThrow("“v0,v1” is not a point");
  });

  test.each(["x", "-4", "5-", "7-6", "1.5", "0-99999999999", "3:4"])(
    "“%s” as barriers is refused by name",
    (part) => {
      expect(() => readState(`?barriers=1,${part}`)).toThrow(`“${part}” is neither the number`);
    },
  );

  test.each(["1,2", "1,2,3,4", "1,two,3", "1,2,Infinity"])("“%s” as a walk is refused", (text) => {
    expect(() => readState(`?walk=${text}`)).toThrow(`“${text}” is not a direction`);
  });

  test.each([
    ["method=fastest", {}],
    ["method=", {}],
    ["method=approximate", { method: "approximate" }],
    ["shade=rainbow", {}],
    ["method=fast&effort=8", { method: "fast", effort: 8 }],
    ["effort=3", {}],
    ["effort=", {}],
    ["error=0", {}],
    ["error=-0.1", {}],
    ["error=NaN", {}],
    ["error=Infinity", {}],
    ["error=1e-3", { error: 0.001 }],
    ["max_distance=0", {}],
    ["max_distance=-1", {}],
    ["max_distance=much", {}],
    ["max_distance=2.5", { maxDistance: 2.5 }],
    ["lines=", {}],
    ["lines=count", {}],
    ["lines=count:0", {}],
    ["lines=count:-3", {}],
    ["lines=count:2.6", { lines: { count: 3 } }],
    ["lines=spacing:x", {}],
    ["lines=spacing:0.5", { lines: { spacing: 0.5 } }],
    ["lines=stripes:3", {}],
    ["lines=none", { lines: null }],
    ["wireframe=yes", {}],
    ["wireframe=1", { wireframe: true }],
    ["view=1,2,3", {}],
    ["view=1,2,3,4,5,x", {}],
    ["view=1,2,3,4,5,Infinity", {}],
    ["view=1,2,3,4,5,6,7", {}],
    ["view=1,2,3,4,5,6", { view: [1, 2, 3, 4, 5, 6], up: "y" as const }],
    ["barriers=", {}],
    ["barriers=3, 4,,5", { barriers: [[3, 4, 5]] }],
    ["barriers=8-10,2", { barriers: [[8, 9, 10, 2]] }],
    ["barriers=;8;;2,1;", { barriers: [[8], [2, 1]] }],
    ["cut=path", {}],
    ["cut=path&cut_from=", {}],
    ["cut=bread&cut_from=mesh=m", {}],
    ["cut=path&cut_from=mesh%3Dm%26source%3Dp1,2,3", {}],
    ["cut=path&cut_from=mesh%3Dm", { cut: { along: ["path"], back: backTo(MESH_M) } }],
  ])("%s", (search, change) => {
    expect(readState(`?${search}`)).toEqual({ ...initial, ...change });
  });
});

describe("barriers", () => {
  test.each([
    [[], ""],
    [[5], "5"],
    [[1, 2], "1-2"],
    [[3, 7, 40, 41, 42], "3,7,40-42"],
    [[42, 3, 41, 7, 40], "3,7,40-42"],
    [[2, 2, 3, 3], "2-3"],
    [[10, 9], "9-10"],
  ])("%j", (numbers, text) => {
    expect(writeBarriers([numbers])).toBe(text);
  });

  test("hold the same numbers, and never two where one would do", () => {
    const random = new Random(5);
    for (let i = 0; i < 500; i++) {
      const numbers = [random.below(80), ...random.list(60, () => random.below(80))];
      const text = writeBarriers([numbers]);
      const expected = [...new Set(numbers)].sort((a, b) => a - b);
      expect(readState(`?barriers=${text}`).barriers).toEqual([expected]);
      const gaps = expected.filter((x, k) => k > 0 && x - (expected[k - 1] ?? x) > 1).length;
      expect(text.split(",").length).toBe(gaps + 1);
    }
  });
});
