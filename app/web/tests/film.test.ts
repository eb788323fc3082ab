import type { SweepAnswer } from "geodesic-client";
import { describe, expect, test } from "vitest";
import { Film } from "../src/film/film";

/** A sweep whose steps are a source, a pop, a crossing that trims, a pseudosource, and the rest. */
const SWEEP: SweepAnswer = {
  kind: "sweep",
  mesh_id: "0",
  sources: [{ vertex: 7, position: [0, 0, 0] }],
  fronts: [0, 0, 1, 1, 2, 3],
  created: [0, 2, 2, 3, 5, 9],
  crossed: [0, 0, 0, 1, 1, 8],
  waiting: [0, 2, 2, 1, 3, 0],
  trimmed: [0, 0, 0, 1, 1, 1],
  distances: [1, 2, 3, 3, null, 3, 3, 0],
  settled: [2, 4, 5, 5, null, 5, 5, 1],
  windows: {
    tails: [0, 0, 0, 1],
    heads: [1, 1, 1, 2],
    faces: [0, 0, 0, 1],
    b0: [0, 0, 0, 0],
    b1: [1, 1, 0.5, 1],
    d0: [1, 1, 1, 1],
    d1: [1, 1, 1, 1],
    sigma: [0, 0, 0, 2],
    pseudosources: [7, 7, 7, 1],
    first: [1, 1, 3, 4],
    crossed: [null, null, 3, 5],
    last: [3, 3, null, null],
  },
  warnings: [],
};
const film = new Film(SWEEP);

describe("a film", () => {
  test("has the emitters in the order in which they light up, as long as their windows wait", () => {
    expect([...film.emitters]).toEqual([
      [7, 0],
      [1, 1],
    ]);
    expect([...film.active]).toEqual([
      [7, 3],
      [1, 5],
    ]);
    expect(film.deeds.map(({ lit }) => lit)).toEqual([[], [7], [], [], [1], []]);
    expect([film.last, film.largest]).toEqual([5, 3]);
  });

  test("tells each operation by the section of the paper", () => {
    const told = film.deeds.map((_, step) => film.words(step, "mm"));
    expect(told[0]).toMatch(/^Start/);
    expect(told[1]).toMatch(/^Initialise \(3\.4\): the source sends out 2 windows/);
    expect(told[2]).toMatch(/^Pop: vertex 0.*distance 1 mm \(3\.4\)/);
    expect(told[3]).toMatch(
      /^Intersect \(3\.3\).*1 trimmed away, 1 made shorter\. Propagate \(3\.2\): 1 w/,
    );
    expect(told[4]).toMatch(/^Pop: vertex 1.*a new pseudosource \(3\.2\) sends 2 windows/);
    expect(told[5]).toMatch(
      /^Pop \(3\.4\): 4 vertices\. Propagate.*7 windows, 4 new.*queue is empty/,
    );
    expect(told[5]).not.toContain("Intersect");
  });

  test("counts the windows of each step", () => {
    expect(film.counts(4, "mm")).toBe(
      "Front at 2 of 3 mm · 3 windows waiting, 1 done, 1 trimmed away",
    );
  });
});
