import { expect, test } from "vitest";
import { HUES } from "../src/view/colours";
import { coloured } from "../src/view/hues";
import { Random } from "./support/random";

/** Return the neighbours in a triangulation: each node is put into a triangle of those before. */
function stackedTriangles(size: number, random: Random): Set<number>[] {
  const neighbours = Array.from({ length: size }, () => new Set<number>());
  const triangles = [[0, 1, 2]];
  const join = (a: number, b: number) => neighbours[a]?.add(b) && neighbours[b]?.add(a);
  for (const [a, b] of [
    [0, 1],
    [1, 2],
    [2, 0],
  ] as const)
    join(a, b);
  for (let node = 3; node < size; node++) {
    const [triangle = []] = triangles.splice(random.below(triangles.length), 1);
    triangle.forEach((corner, i) => {
      join(node, corner);
      triangles.push([node, corner, triangle[(i + 1) % 3] ?? 0]);
    });
  }
  return neighbours;
}

test("neighbours in a plane never have the same colour", () => {
  const random = new Random(1);
  for (const size of [3, 8, 50, 300]) {
    const neighbours = stackedTriangles(size, random);
    const hues = coloured(neighbours);
    expect(hues.every((hue) => hue >= 0 && hue < HUES)).toBe(true);
    neighbours.forEach((others, node) => {
      for (const other of others) expect(hues[other]).not.toBe(hues[node]);
    });
  }
});
