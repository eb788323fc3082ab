import { describe, expect, test } from "vitest";
import { drawnIn, frameOf, frontOf } from "../src/mesh/frame";

/** A table: a wide top on four legs, the height along an axis. */
function table(height: 1 | 2): number[] {
  const point = (a: number, b: number, c: number) => (height === 2 ? [a, b, c] : [a, c, b]);
  return [-1, 1].flatMap((a) =>
    [-1, 1].flatMap((b) => [...point(a, b, 0), ...point(a, b, 1), ...point(0.5 * a, 0.5 * b, 1.2)]),
  );
}

describe("which way is up", () => {
  test("is guessed by what the mesh stands on", () => {
    expect(frameOf(table(1), null).up).toBe("y");
    expect(frameOf(table(2), null).up).toBe("z");
  });

  test("is z for a plane in x and y", () => {
    expect(frameOf([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0], null).up).toBe("z");
  });

  test("is y where both would do", () => {
    expect(frameOf([-1, -1, -1, 1, 1, 1, 1, -1, 1, -1, 1, -1], null).up).toBe("y");
  });

  test("is taken as given", () => {
    expect(frameOf(table(1), "z").up).toBe("z");
  });
});

test("a mesh is drawn upright in the unit ball, and never mirrored", () => {
  const of = (...position: number[]) =>
    drawnIn({ centre: [1, 2, 3], radius: 2, up: "z" }, position).map((value) => value + 0);
  expect(of(3, 2, 3)).toEqual([1, 0, 0]);
  expect(of(1, 2, 5)).toEqual([0, 1, 0]);
  expect(of(1, 4, 3)).toEqual([0, 0, -1]);
});

describe("where the front is", () => {
  /** An animal along an axis: four feet, a back, and at one end a head that is higher. */
  const animal = (axis: 0 | 2, end: 1 | -1): number[] => {
    const point = (along: number, up: number, aside: number) =>
      axis === 0 ? [end * along, up, aside] : [aside, up, end * along];
    return [-1, 1].flatMap((along) =>
      [-0.3, 0.3].flatMap((aside) => [
        ...point(along, -0.7, aside),
        ...point(along, along > 0 ? 0.9 : 0.1, aside),
      ]),
    );
  };
  const flat = (points: number[]): number[] => points.map(() => 0);

  test.each([
    [0, 1, [1, 1]],
    [0, -1, [-1, 1]],
    [2, 1, [1, 1]],
    [2, -1, [1, -1]],
  ] as const)(
    "an animal along %i with its head at %i is seen from its side and front",
    (axis, end, signs) => {
      const points = animal(axis, end);
      const [x, y, z] = frontOf(points, flat(points));
      expect([Math.sign(x), Math.sign(z)]).toEqual(signs);
      expect(y).toBeGreaterThan(0);
      expect(Math.abs(x) > Math.abs(z)).toBe(axis === 2);
    },
  );

  test("detail tells more than height: the normals of its many vertices point there", () => {
    const points = animal(2, -1);
    const normals = points.map((_, i) => (i % 3 === 2 && i < 12 ? 1 : 0));
    expect(Math.sign(frontOf(points, normals)[2])).toBe(1);
  });
});
