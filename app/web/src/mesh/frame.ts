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

/** What a view from the side shows of the end of a mesh, of its height and of its side. */
const ASIDE = { end: 0.5, height: 0.35, side: 0.8 };
/** A mesh is seen from its side if it is longer than wide by this factor. */
const LONG = 1.2;

/** The mean of the normals is this long at least where one side has more detail. */
const TELLING = 0.015;
/** The share of the height that is the top of a mesh. */
const TOP = 0.15;

/**
 * Return the direction from which a mesh is looked at first, in drawn positions.
 *
 * What is long is seen from the side, and turned towards its front: the end with more detail, which
 * has more vertices, so that the mean of their normals points there as it does out of an open
 * surface; otherwise the end that rises higher, as heads do.
 */
export function frontOf(positions: ArrayLike<number>, normals: ArrayLike<number>): Triple {
  const { low, high } = boxOf(positions, () => true);
  const [width, tall, depth] = differences(high, low) as Triple;
  const detail = meanOf(normals, () => true);
  const floor = high[1] - TOP * tall;
  const top = meanOf(positions, (i) => positions[i + 1]! >= floor);
  const signOf = (axis: 0 | 2): number => {
    const telling = Math.abs(detail[axis]) > TELLING ? detail[axis] : top[axis];
    return telling < -TELLING ? -1 : 1;
  };
  const { end, height, side } = ASIDE;
  const [x, z] = depth > LONG * width ? [side, end] : [end, side];
  return [signOf(0) * x, height, signOf(2) * z];
}

function meanOf(points: ArrayLike<number>, isChosen: (index: number) => boolean): Triple {
  const sum: Triple = [0, 0, 0];
  let count = 0;
  for (let i = 0; i < points.length; i += 3) {
    if (!isChosen(i)) continue;
    count += 1;
    for (let axis = 0; axis < 3; axis++) sum[axis]! += points[i + axis]!;
  }
  return sum.map((x) => x / (count || 1)) as Triple;
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
