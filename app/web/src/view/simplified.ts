// Polylines with fewer points that look the same.
export type Triple = [number, number, number];

/** How far points may be from a line that leaves them out, in radii of the unit ball. */
const TOLERANCE = 5e-5;
/** Points that one segment replaces, at most: each is looked at again for each point after it. */
const MOST = 64;

/** Return a line of some points of another one: its ends, and those that others need. */
export function simplified(line: Triple[]): Triple[] {
  const kept = line.slice(0, 1);
  let first = 0;
  for (let last = 2; last < line.length; last++) {
    if (last - first <= MOST && isStraight(line, first, last)) continue;
    first = last - 1;
    kept.push(line[first]!);
  }
  if (line.length > 1) kept.push(line[line.length - 1]!);
  return kept;
}

/** Tell whether all points between two of a line are near the segment of these. */
function isStraight(line: Triple[], first: number, last: number): boolean {
  const [start, end] = [line[first]!, line[last]!];
  for (let i = first + 1; i < last; i++) {
    if (squareFrom(line[i]!, start, end) > TOLERANCE ** 2) return false;
  }
  return true;
}

/** Return the squared distance of a point from a segment. */
function squareFrom([x, y, z]: Triple, start: Triple, end: Triple): number {
  const [px, py, pz] = [x - start[0], y - start[1], z - start[2]];
  const [dx, dy, dz] = [end[0] - start[0], end[1] - start[1], end[2] - start[2]];
  const length = dx * dx + dy * dy + dz * dz;
  const share = length > 0 ? (px * dx + py * dy + pz * dz) / length : 0;
  const t = Math.min(Math.max(share, 0), 1);
  return (px - t * dx) ** 2 + (py - t * dy) ** 2 + (pz - t * dz) ** 2;
}
