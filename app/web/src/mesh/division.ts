// Faces that borders cross, divided into triangles that lie in one territory each.
import { ShapeUtils, Vector2 } from "three";

/** A point of a face by the weights of its second and third corner. */
type Place = readonly [number, number];

/** A piece of a border in one face, and the two sources that it separates. */
export interface Piece {
  places: Place[];
  sources: readonly [number, number];
}

/** A triangle of a face: the weights of its corners, and the source that is nearest to it. */
export interface Part {
  places: [Place, Place, Place];
  source: number;
}

const CORNERS: Place[] = [
  [0, 0],
  [1, 0],
  [0, 1],
];

/** Weights within which a point is on a side or at a corner. */
const NEAR = 1e-7;

/**
 * Return the triangles into which ``pieces`` divide a face; none where they leave a part of it
 * without a source. ``sources`` are the nearest ones of its corners.
 */
export function divide(sources: readonly number[], pieces: Piece[]): Part[] {
  const graph = new Graph();
  const onSides: number[][] = [[], [], []];
  for (const { places, sources: pair } of pieces) {
    const nodes = places.map((place) => graph.node(snapped(place)));
    for (const end of [nodes[0]!, nodes.at(-1)!]) {
      sidesOf(graph.places[end]!).forEach((side) => {
        onSides[side]!.push(end);
      });
    }
    nodes.slice(1).forEach((node, i) => {
      graph.join(nodes[i]!, node, pair);
    });
  }
  const corners = CORNERS.map((place) => graph.node(place));
  onSides.forEach((nodes, side) => {
    const [from, to] = [corners[side]!, corners[(side + 1) % 3]!];
    const along = [...new Set([from, ...nodes, to])].sort(
      (a, b) => graph.away(from, a) - graph.away(from, b),
    );
    along.slice(1).forEach((node, i) => {
      graph.join(along[i]!, node, null);
    });
  });
  const cycles = graph.cycles();
  const points = ({ nodes }: Cycle): Vector2[] =>
    nodes.map((node) => new Vector2(...graph.places[node]!));
  const parts: FacePart[] = cycles
    .filter(({ area }) => area > 0)
    .map((rim) => ({ rim, holes: [] }));
  // A border that is closed within the face leaves a hole in the part around it.
  for (const hole of cycles) {
    if (hole.area > 0 || hole.nodes.includes(corners[0]!)) continue;
    const isAround = ({ rim }: FacePart): boolean =>
      !rim.nodes.includes(hole.nodes[0]!) && contains(points(rim), points(hole));
    parts.find(isAround)?.holes.push(hole);
  }
  const found = sourcesOf(parts, corners, sources);
  if (found.some((source) => source === undefined)) return [];
  return parts.flatMap(({ rim, holes }, i) => {
    const all = [rim, ...holes].flatMap(({ nodes }) => nodes);
    return ShapeUtils.triangulateShape(points(rim), holes.map(points)).map((triangle) => ({
      places: triangle.map((k) => graph.places[all[k]!]!) as Part["places"],
      source: found[i]!,
    }));
  });
}

interface FacePart {
  rim: Cycle;
  holes: Cycle[];
}

interface Cycle {
  nodes: number[];
  /** The sources on both sides of the edge behind each node; null along a side of the face. */
  pairs: (readonly [number, number] | null)[];
  /** The twin of each of those edges, as a text. */
  twins: string[];
  edges: string[];
  /** Twice the area: above 0 of a part, below 0 of what surrounds one. */
  area: number;
}

/** Points and edges in a face, from which the parts between them follow. */
class Graph {
  readonly places: Place[] = [];
  private readonly numbers = new Map<string, number>();
  private readonly edges: Map<number, readonly [number, number] | null>[] = [];

  node(place: Place): number {
    const key = place.map((x) => Math.round(x / 1e-9)).join();
    const known = this.numbers.get(key);
    if (known !== undefined) return known;
    this.numbers.set(key, this.places.length);
    this.edges.push(new Map());
    return this.places.push(place) - 1;
  }

  join(a: number, b: number, pair: readonly [number, number] | null): void {
    if (a === b || this.edges[a]!.has(b)) return;
    this.edges[a]!.set(b, pair);
    this.edges[b]!.set(a, pair);
  }

  away(a: number, b: number): number {
    const [p, q] = [this.places[a]!, this.places[b]!];
    return Math.hypot(p[0] - q[0], p[1] - q[1]);
  }

  /** Return the cycles of edges that have a part on their left, and those around all parts. */
  cycles(): Cycle[] {
    const around = this.edges.map((edges, from) => {
      const angle = (to: number): number =>
        Math.atan2(
          this.places[to]![1] - this.places[from]![1],
          this.places[to]![0] - this.places[from]![0],
        );
      return [...edges.keys()].sort((a, b) => angle(a) - angle(b));
    });
    const seen = new Set<string>();
    const cycles: Cycle[] = [];
    for (const [start, others] of around.entries()) {
      for (const first of others) {
        if (seen.has(`${start},${first}`)) continue;
        const cycle: Cycle = { nodes: [], pairs: [], twins: [], edges: [], area: 0 };
        let [from, to] = [start, first];
        while (!seen.has(`${from},${to}`)) {
          seen.add(`${from},${to}`);
          const [p, q] = [this.places[from]!, this.places[to]!];
          cycle.nodes.push(from);
          cycle.pairs.push(this.edges[from]!.get(to) ?? null);
          cycle.edges.push(`${from},${to}`);
          cycle.twins.push(`${to},${from}`);
          cycle.area += p[0] * q[1] - p[1] * q[0];
          const next = around[to]!;
          const back = next.indexOf(from);
          [from, to] = [to, next[(back + next.length - 1) % next.length]!];
        }
        cycles.push(cycle);
      }
    }
    return cycles;
  }
}

/** Return the source of each part: that of a corner, or by the border to a part whose is known. */
function sourcesOf(
  parts: FacePart[],
  corners: number[],
  sources: readonly number[],
): (number | undefined)[] {
  const found: (number | undefined)[] = parts.map(() => undefined);
  // A corner between two borders may belong to none of the parts there: borders go first.
  const pairsOf = parts.map(({ rim }) => rim.pairs.filter((pair) => pair !== null));
  const partOf = new Map(
    parts.flatMap(({ rim, holes }, i) =>
      [rim, ...holes].flatMap(({ edges }) => edges.map((edge) => [edge, i] as const)),
    ),
  );
  parts.forEach(({ rim: { nodes } }, i) => {
    const shared = (source: number): boolean => pairsOf[i]!.every((pair) => pair.includes(source));
    const own = corners.findIndex((node, k) => nodes.includes(node) && shared(sources[k]!));
    const [first] = pairsOf[i]!;
    const common = first?.filter(shared) ?? [];
    if (common.length === 1) found[i] = common[0];
    else if (own >= 0) found[i] = sources[own];
  });
  for (let isChanging = true; isChanging; ) {
    isChanging = false;
    parts.forEach(({ rim: { twins, pairs } }, i) => {
      if (found[i] !== undefined) return;
      for (const [k, pair] of pairs.entries()) {
        const beyond = pair && found[partOf.get(twins[k]!) ?? -1];
        if (pair == null || beyond == null || !pair.includes(beyond)) continue;
        found[i] = pair[0] === beyond ? pair[1] : pair[0];
        isChanging = true;
        return;
      }
    });
  }
  return found;
}

/** Return the place, on a side or at a corner where it is as good as there. */
function snapped([v, w]: Place): Place {
  const weights = [1 - v - w, v, w].map((x) => (Math.abs(x) < NEAR ? 0 : x));
  const sum = weights.reduce((total, x) => total + x, 0);
  return [weights[1]! / sum, weights[2]! / sum];
}

/** Return the sides that a place is on: side i leads from corner i to the next. */
function sidesOf([v, w]: Place): number[] {
  const opposite = [w, 1 - v - w, v];
  return [0, 1, 2].filter((side) => Math.abs(opposite[side]!) < 1e-12);
}

/** Whether a polygon contains the first point of another one. */
function contains(polygon: Vector2[], [point]: Vector2[]): boolean {
  let isInside = false;
  polygon.forEach((a, i) => {
    const b = polygon[(i + 1) % polygon.length]!;
    if (a.y > point!.y !== b.y > point!.y) {
      isInside = isInside !== point!.x < a.x + ((b.x - a.x) * (point!.y - a.y)) / (b.y - a.y);
    }
  });
  return isInside;
}
