import { describe, expect, test } from "vitest";
import type { Triple } from "../src/mesh/frame";
import {
  actOf,
  endOf,
  nameOf,
  type Places,
  reordered,
  startsOf,
  stopsOf,
  type Tool,
  without,
} from "../src/state/places";
import type { Point } from "../src/state/point";
import { placesAt } from "./support/points";

const at = (vertex: number): Point => ({ vertex });
/** Vertices stand on a line. */
const positionOf = (point: Point): Triple => ["vertex" in point ? point.vertex : Number.NaN, 0, 0];
const listOf = (starts: number, ...vertices: number[]): Places => ({
  places: placesAt(...vertices.map(at)),
  starts,
});

/** Do things with points one after the other, and return what was said and the list in the end. */
function clicked(begin: Places, ...clicks: [Tool, number][]): { words: string[]; list: Places } {
  let list = begin;
  const words = clicks.map(([tool, vertex]) => {
    const act = actOf(list, tool, at(vertex), positionOf);
    list = { ...list, ...(act.change as Partial<Places>) };
    return act.words;
  });
  return { words, list };
}

describe("a click", () => {
  test("sets A, then B, then moves the nearer end", () => {
    const { words, list } = clicked(listOf(1), ["ends", 0], ["ends", 10], ["ends", 8], ["ends", 3]);
    expect(words).toEqual(["sets A", "sets B", "moves B", "moves A"]);
    expect(list).toEqual(listOf(1, 3, 8));
  });

  test("adds starts and stops, and keeps their order", () => {
    const { words, list } = clicked(
      listOf(1),
      ["stop", 0],
      ["stop", 10],
      ["stop", 4],
      ["start", 2],
      ["stop", 6],
    );
    expect(words).toEqual(["sets A", "sets B", "adds stop 1", "adds start A2", "adds stop 2"]);
    expect(list).toEqual(listOf(2, 0, 2, 4, 6, 10));
    expect([startsOf(list), stopsOf(list), endOf(list)]).toEqual([
      [at(0), at(2)],
      [at(4), at(6)],
      at(10),
    ]);
  });

  test("moves the nearest of several starts, and no stop", () => {
    const { words, list } = clicked(
      listOf(2, 0, 20, 5, 50),
      ["ends", 6],
      ["ends", 18],
      ["ends", 40],
    );
    expect(words).toEqual(["moves A", "moves A2", "moves B"]);
    expect(list).toEqual(listOf(2, 6, 18, 5, 40));
  });

  test("walks from A, as far as the point is away", () => {
    const begin = listOf(1, 3);
    expect(actOf(begin, "walk", at(5), positionOf).change).toEqual({ walk: [2, 0, 0] });
    expect(actOf(begin, "walk", at(3), positionOf).change).toEqual({});
    expect(actOf(listOf(1), "walk", at(3), positionOf).words).toBe("sets A");
  });

  test("keeps the name of what it moves", () => {
    const begin = { places: [{ point: at(0), name: "Hut" }, ...placesAt(at(9))], starts: 1 };
    const act = actOf(begin, "ends", at(1), positionOf);
    expect(act.words).toBe("moves Hut");
    expect(act.change.places?.[0]).toEqual({ point: at(1), name: "Hut" });
  });
});

describe("the list", () => {
  test("names places by where they are in it", () => {
    const names = (list: Places) => list.places.map((_, i) => nameOf(list, i));
    expect(names(listOf(1, 0, 1, 2, 3))).toEqual(["A", "1", "2", "B"]);
    expect(names(listOf(3, 0, 1, 2))).toEqual(["A", "A2", "A3"]);
    expect(names(listOf(2, 0, 1, 2))).toEqual(["A", "A2", "B"]);
  });

  test("has one start as long as it has a place", () => {
    expect(without(listOf(1, 0, 5, 9), 0)).toEqual(listOf(1, 5, 9));
    expect(without(listOf(2, 0, 5, 9), 0)).toEqual(listOf(1, 5, 9));
    expect(without(listOf(2, 0, 5, 9), 2)).toEqual(listOf(2, 0, 5));
    expect(without(listOf(1, 0), 0)).toEqual(listOf(1));
    expect(endOf(without(listOf(1, 0, 9), 1))).toBeNull();
  });

  test("is reordered", () => {
    expect(reordered(listOf(1, 0, 1, 2, 3), 3, 0).places).toEqual(
      placesAt(...[3, 0, 1, 2].map(at)),
    );
    expect(reordered(listOf(1, 0, 1, 2, 3), 0, 2).places).toEqual(
      placesAt(...[1, 2, 0, 3].map(at)),
    );
  });
});
