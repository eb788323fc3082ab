import { Line3, Vector3 } from "three";
import { describe, expect, test } from "vitest";
import { simplified, type Triple } from "../src/view/simplified";
import { Random } from "./support/random";

/** How far a point may be from the simplified line, in radii of the unit ball. */
const NEAR = 5e-5;

describe("simplified lines", () => {
  test("of a straight line its ends are left, but no more than 64 points become one segment", () => {
    const line = Array.from({ length: 65 }, (_, i): Triple => [i / 64, 0, 1]);
    expect(simplified(line)).toEqual([line[0], line[64]]);
    const long = Array.from({ length: 1000 }, (_, i): Triple => [i / 999, 0, 1]);
    expect(simplified(long).length).toBe(17);
  });

  test("of a circle enough is left to look round", () => {
    const circle = Array.from({ length: 5001 }, (_, i): Triple => {
      const angle = (2 * Math.PI * (i % 5000)) / 5000;
      return [Math.cos(angle), Math.sin(angle), 0];
    });
    const drawn = simplified(circle);
    expect(drawn.length).toBeLessThan(350);
    expect(drawn[0]).toEqual(drawn[drawn.length - 1]);
    for (const point of circle) expect(distanceTo(drawn, point)).toBeLessThan(NEAR);
  });

  test("what is left are points of the line, in their order, and no point is far from it", () => {
    const random = new Random(1);
    for (let run = 0; run < 200; run++) {
      const here = new Vector3();
      const line = Array.from({ length: 60 }, (): Triple => {
        const step = new Vector3();
        step.setFromSphericalCoords(
          10 ** (-6 * random.next()),
          3 * random.next(),
          6 * random.next(),
        );
        return here.add(step).toArray();
      });
      const drawn = simplified(line);
      const places = drawn.map((point) => line.indexOf(point));
      expect(places).toEqual([...places].sort((a, b) => a - b));
      expect([places[0], places[places.length - 1]]).toEqual([0, line.length - 1]);
      for (const point of line) expect(distanceTo(drawn, point)).toBeLessThanOrEqual(NEAR * 1.001);
    }
  });

  test("lines of no point, of one and of two stay", () => {
    const two: Triple[] = [
      [0, 0, 0],
      [0, 0, 1e-9],
    ];
    expect(simplified([])).toEqual([]);
    expect(simplified(two.slice(0, 1))).toEqual(two.slice(0, 1));
    expect(simplified(two)).toEqual(two);
  });
});

/** The least distance of a point from a line, as three.js finds it. */
function distanceTo(line: Triple[], point: Triple): number {
  const here = new Vector3(...point);
  const corners = line.map((corner) => new Vector3(...corner));
  const distances = corners
    .slice(1)
    .map((end, i) => new Line3(corners[i], end).closestPointToPoint(here, true, new Vector3()))
    .map((nearest) => nearest.distanceTo(here));
  return Math.min(...distances);
}
