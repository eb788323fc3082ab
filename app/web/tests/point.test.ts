import { describe, expect, test } from "vitest";
import type { Point } from "../src/state/point";
import {
  parsePlaces,
  parsePoint,
  rounded,
  sayPoint,
  writePlaces,
  writePoint,
} from "../src/state/point";
import { randomPoint } from "./support/points";
import { Random } from "./support/random";

describe("parsing", () => {
  test.each([
    ["v12", { vertex: 12 }],
    ["12", { vertex: 12 }],
    ["v0", { vertex: 0 }],
    ["e12-13:0.3", { edge: [12, 13], t: 0.3 }],
    ["e0-1:1e-3", { edge: [0, 1], t: 0.001 }],
    ["f7:0.2,0.3,0.5", { face: 7, barycentric: [0.2, 0.3, 0.5] }],
    ["f7:1,0,0", { face: 7, barycentric: [1, 0, 0] }],
    ["f7:.2,.3", { face: 7, barycentric: [0.2, 0.3, 0.5] }],
    ["p1,2,3", { position: [1, 2, 3] }],
    ["p-1.5,+.25,3E2", { position: [-1.5, 0.25, 300] }],
  ])("%s", (text, point) => {
    expect(parsePoint(text)).toEqual(point);
  });

  test.each([
    "",
    "v",
    "v-1",
    "v1.5",
    " v1",
    "v1 ",
    "w1",
    "e1:0.5",
    "e1-2",
    "e1-2:",
    "e1-2:x",
    "e1-2-3:0.5",
    "f7",
    "f7:0.5",
    "f7:0.2,0.3,0.5,0",
    "f7:0.2,0.3,",
    "f7:0.2;0.3;0.5",
    "p1,2",
    "p1,2,NaN",
    "p1,2,Infinity",
    "p.,.,.",
    "1e3",
    "nonsense",
  ])("“%s” is refused by name", (text) => {
    expect(() => parsePoint(text)).toThrow(`“${text}” is not a point`);
  });

  const none = { places: [], starts: 1 };
  const pointsIn = (text: string) => parsePlaces(text, none).places.map(({ point }) => point);

  test("several points are divided by any white space, and a comma may be before it", () => {
    expect(pointsIn(" v0\tp0,0,2 \n f0:0.5,0.5,0 ")).toEqual([
      { vertex: 0 },
      { position: [0, 0, 2] },
      { face: 0, barycentric: [0.5, 0.5, 0] },
    ]);
    expect(pointsIn("v0, v1 , v2,")).toEqual([{ vertex: 0 }, { vertex: 1 }, { vertex: 2 }]);
    expect(parsePlaces("  ", none)).toEqual(none);
    expect(() => pointsIn("v0,v1")).toThrow("“v0,v1” is not a point");
  });

  test("a path goes on behind a >", () => {
    expect(parsePlaces("v0 v1 > v2 > v3", none)).toMatchObject({ starts: 2 });
    expect(parsePlaces("v0>v9", none)).toMatchObject({ starts: 1 });
    expect(pointsIn("v0>v9")).toEqual([{ vertex: 0 }, { vertex: 9 }]);
    expect(parsePlaces("v0 v1", none)).toMatchObject({ starts: 2 });
  });

  test("names stay with their points, and what is written is read", () => {
    const named = {
      places: [0, 1, 2].map((vertex) => ({ point: { vertex }, name: `V${vertex}` })),
      starts: 1,
    };
    expect(writePlaces(named)).toBe("v0 > v1 > v2");
    expect(parsePlaces(writePlaces(named), named)).toEqual(named);
    expect(parsePlaces("v2 > v7", named).places.map(({ name }) => name)).toEqual(["V2", ""]);
  });
});

describe("writing", () => {
  test("what is written is parsed as the same point", () => {
    const random = new Random(1);
    for (let i = 0; i < 2000; i++) {
      const point = randomPoint(random);
      const text = writePoint(point);
      expect(parsePoint(text), text).toEqual(point);
      expect(text).not.toMatch(/\s/);
    }
  });

  test("weights are written to six digits", () => {
    const point: Point = { face: 7, barycentric: [1 / 3, 1 / 3, 1 / 3] };
    expect(writePoint(point)).toBe("f7:.333333,.333333");
  });
});

describe("rounding", () => {
  test("weights keep their sum, and move by less than two ten thousandths", () => {
    const random = new Random(2);
    for (let i = 0; i < 2000; i++) {
      const [a, b] = [random.next(), random.next()].sort();
      const exact = [a as number, (b as number) - (a as number), 1 - (b as number)] as const;
      const point = rounded({ face: 3, barycentric: [...exact] });
      if (!("barycentric" in point)) throw new Error("a point in a face became another kind");
      const { barycentric } = point;
      expect(barycentric[0] + barycentric[1] + barycentric[2]).toBeCloseTo(1, 12);
      for (const [corner, weight] of barycentric.entries()) {
        expect(weight).toBeGreaterThanOrEqual(0);
        expect(Math.abs(weight - (exact[corner] ?? Number.NaN))).toBeLessThan(2e-4);
      }
      expect(rounded(point)).toEqual(point);
    }
  });

  test("other points stay as they are", () => {
    const points: Point[] = [{ vertex: 5 }, { edge: [1, 2], t: 1 / 3 }];
    expect(points.map(rounded)).toEqual(points);
  });
});

test.each([
  [{ vertex: 12 }, "vertex 12"],
  [{ edge: [3, 4], t: 0.5 }, "on edge 3–4"],
  [{ face: 7, barycentric: [0.2, 0.3, 0.5] }, "on face 7"],
] as [Point, string][])("%j in words", (point, words) => {
  expect(sayPoint(point)).toBe(words);
});
