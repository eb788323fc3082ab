import { describe, expect, test } from "vitest";
import { ribbons } from "../src/view/ribbon";
import type { Triple } from "../src/view/simplified";

const CORNER: Triple[] = [
  [0, 0, 0],
  [1, 0, 0],
  [1, 1, 0],
];

describe("ribbons", () => {
  test("a point has two vertices that know the points beside it, a segment two triangles", () => {
    const geometry = ribbons([CORNER]);
    expect(geometry.getAttribute("position").count).toBe(6);
    expect(geometry.getIndex()?.count).toBe(12);
    expect(points(geometry, "previous")).toEqual(["0,0,0", "0,0,0", "1,0,0"]);
    expect(points(geometry, "position")).toEqual(["0,0,0", "1,0,0", "1,1,0"]);
    expect(points(geometry, "next")).toEqual(["1,0,0", "1,1,0", "1,1,0"]);
  });

  test("where a line ends at its start, the end knows what comes after the start", () => {
    const geometry = ribbons([[...CORNER, [0, 0, 0]]]);
    expect(points(geometry, "previous")).toEqual(["1,1,0", "0,0,0", "1,0,0", "1,1,0"]);
    expect(points(geometry, "next")).toEqual(["1,0,0", "1,1,0", "0,0,0", "1,0,0"]);
  });

  test("no line, no point and a single point are drawn by nothing", () => {
    for (const lines of [[], [[]], [CORNER.slice(0, 1), []]]) {
      expect(ribbons(lines).getIndex()?.count).toBe(0);
    }
  });
});

/** The points of an attribute, each of which two vertices share. */
function points(geometry: ReturnType<typeof ribbons>, name: string): string[] {
  const attribute = geometry.getAttribute(name);
  return Array.from({ length: attribute.count / 2 }, (_, i) => {
    const [here, other] = [2 * i, 2 * i + 1].map((vertex) =>
      [0, 1, 2].map((axis) => attribute.getComponent(vertex, axis)).join(),
    );
    expect(other).toBe(here);
    return here ?? "";
  });
}
