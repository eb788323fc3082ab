import { expect, test } from "vitest";
import { profileOf } from "../src/panel/profile";

test("a profile has height over length, and tells climb and fall", () => {
  const points: [number, number, number][] = [
    [0, 0, 1],
    [3, 0, 5],
    [3, 5, 5],
    [3, 5, 2],
  ];
  expect(profileOf(points, "z")).toEqual({
    along: [0, 5, 10, 13],
    heights: [1, 5, 5, 2],
    climb: 4,
    fall: 3,
  });
  expect(profileOf(points, "y").climb).toBe(5);
});
