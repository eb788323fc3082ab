// The frame of a mesh: where its positions are drawn, and which way is up.
export type Up = "y" | "z";

export type Triple = [number, number, number];

/** The transform of drawn positions: moved to the origin, scaled into the unit ball, turned upright. */
export interface Frame {
  centre: Triple;
  radius: number;
  up: Up;
}

/** The share of the height that counts as the foot of a mesh. */
const FOOT = 0.03;
/** Below this share of its width and depth, a mesh is flat. */
const FLAT = 0.4;

/** Return the frame of a mesh; which way is up is guessed where it is not given. */
export function frameOf(points: ArrayLike<number>, up: Up | null): Frame {
  const { low, high } = boxOf(points, () => true);
  const centre = low.map((x, i) => (x + high[i]!) / 2) as Triple;
  const radius = Math.hypot(...low.map((x, i) => (high[i]! - x) / 2)) || 1;
  return { centre, radius, up: up ?? guessUp(points, low, high) };
}

/** Return the drawn position of one in mesh units. */
export function drawnIn({ centre, radius, up }: Frame, position: readonly number[]): Triple {
  const [x, y, z] = position.map((value, i) => (value - centre[i]!) / radius) as Triple;
  return up === "y" ? [x, y, z] : [x, z, -y];
}

/** Return the vector from a position to another one. */
export function differences(to: readonly number[], from: readonly number[]): Triple {
  return to.map((x, axis) => x - (from[axis] ?? 0)) as Triple;
}

/** Return the axis along which a mesh lies if it is flat, or else stands on the wider foot; or y. */
function guessUp(points: ArrayLike<number>, low: Triple, high: Triple): Up {
  const [x, y, z] = low.map((least, axis) => high[axis]! - least) as Triple;
  if (z < FLAT * Math.min(x, y)) return "z";
  if (y < FLAT * Math.min(x, z)) return "y";
  const widths = [0, 2].map((axis) => footOf(points, low, high, 1, axis));
  const depths = [0, 1].map((axis) => footOf(points, low, high, 2, axis));
  return depths[0]! * depths[1]! > 1.1 * widths[0]! * widths[1]! ? "z" : "y";
}

/** Return how wide the foot is along an axis, as a share of the whole. */
function footOf(
  points: ArrayLike<number>,
  low: Triple,
  high: Triple,
  up: number,
  axis: number,
): number {
  const top = low[up]! + FOOT * (high[up]! - low[up]!);
  const foot = boxOf(points, (i) => points[i + up]! <= top);
  const whole = high[axis]! - low[axis]!;
  return whole > 0 ? (foot.high[axis]! - foot.low[axis]!) / whole : 0;
}

/** Return the box around the points that are chosen by the index of their first coordinate. */
function boxOf(
  points: ArrayLike<number>,
  isChosen: (index: number) => boolean,
): { low: Triple; high: Triple } {
  const low: Triple = [Infinity, Infinity, Infinity];
  const high: Triple = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < points.length; i += 3) {
    if (!isChosen(i)) continue;
    for (let axis = 0; axis < 3; axis++) {
      low[axis] = Math.min(low[axis]!, points[i + axis]!);
      high[axis] = Math.max(high[axis]!, points[i + axis]!);
    }
  }
  return { low, high };
}
