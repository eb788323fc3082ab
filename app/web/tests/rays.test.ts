import type { StraightLine } from "geodesic-client";
import { describe, expect, test, vi } from "vitest";
import { shortestParts } from "../src/ask/rays";
import type { Point } from "../src/state/point";
import { Random } from "./support/random";

/** A line along x, a vertex at each unit. */
function line(count: number): Pick<StraightLine, "points" | "locations"> {
  const numbers = Array.from({ length: count }, (_, i) => i);
  const barycentric: [number, number, number] = [1, 0, 0];
  return {
    points: numbers.map((x) => [x, 0, 0]),
    locations: numbers.map((vertex) => ({ vertex, face: vertex, barycentric })),
  };
}

describe("the points of a line to which it is a shortest path", () => {
  test("end at the last one to which there is no shorter way", async () => {
    const random = new Random(7);
    for (let i = 0; i < 300; i++) {
      const count = 1 + random.below(2000);
      const last = random.below(count);
      const ask = vi.fn(async (points: Point[]) =>
        points.map((point) => {
          const at = "vertex" in point ? point.vertex : Number.NaN;
          return at > last ? at - 0.01 : at - 1e-12;
        }),
      );
      expect(await shortestParts([line(count)], 1e-9, ask)).toEqual([last + 1]);
      expect(ask.mock.calls.length).toBeLessThanOrEqual(
        Math.ceil(Math.log(count + 1) / Math.log(17)),
      );
    }
  });

  test("are found for many lines at once", async () => {
    const ask = vi.fn(async (points: Point[]) => points.map(() => 0));
    expect(await shortestParts([line(9), line(1), line(5)], 1e-9, ask)).toEqual([1, 1, 1]);
    expect(ask).toHaveBeenCalledTimes(1);
  });
});
