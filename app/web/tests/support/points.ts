// Random points of a surface, as the page writes them.

import type { Place } from "../../src/state/places";
import type { Point } from "../../src/state/point";
import { rounded } from "../../src/state/point";
import type { Random } from "./random";

/** Return places without names at points. */
export function placesAt(...points: Point[]): Place[] {
  return points.map((point) => ({ point, name: "" }));
}

export function randomPoint(random: Random): Point {
  const kind = random.pick(["vertex", "edge", "face"] as const);
  if (kind === "vertex") return { vertex: random.below(5e6) };
  if (kind === "edge") {
    return { edge: [random.below(5e6), random.below(5e6)], t: random.next() };
  }
  const [a, b, c] = [random.next(), random.next(), random.next() + 1e-9];
  const sum = a + b + c;
  return rounded({ face: random.below(5e6), barycentric: [a / sum, b / sum, c / sum] });
}
