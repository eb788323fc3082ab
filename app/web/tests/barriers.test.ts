import { expect, test } from "vitest";
import { repainted } from "../src/state/barriers";
import { Random } from "./support/random";

test.each([
  [[], [], []],
  [[], [5, 3], [[5, 3]]],
  [[[1, 2]], [1, 2], [[1, 2]]],
  [[[1, 2]], [1, 2, 7], [[1, 2], [7]]],
  [[[1, 2], [3]], [2], [[2]]],
  [
    [[1, 2], [3]],
    [3, 9],
    [[3], [9]],
  ],
])("%j painted to %j", (before, painted, after) => {
  expect(repainted(before, new Set(painted))).toEqual(after);
});

test("the painted faces are blocked, each by one barrier, and barriers keep their order", () => {
  const random = new Random(6);
  let barriers: readonly (readonly number[])[] = [];
  for (let i = 0; i < 300; i++) {
    const painted = new Set(random.list(20, () => random.below(30)));
    const after = repainted(barriers, painted);
    expect(after.flat().toSorted((a, b) => a - b)).toEqual([...painted].sort((a, b) => a - b));
    for (const [k, faces] of after.slice(0, -1).entries()) {
      const from = barriers.findIndex((each) => each.includes(faces[0] as number));
      expect(from, "an old one, in its place").toBeGreaterThanOrEqual(k);
    }
    barriers = after;
  }
});
