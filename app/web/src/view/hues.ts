// Colours of territories: neighbours differ, as far as the colours go.
import type { LoadedMesh } from "../mesh/loader";
import { HUES } from "./colours";

/** Return the number of a colour for each source; few sources have the colours in their order. */
export function huesOf(
  sources: number,
  nearest: Int32Array,
  mesh: Pick<LoadedMesh, "corners" | "document">,
): number[] {
  if (sources <= HUES) return Array.from({ length: sources }, (_, i) => i);
  const neighbours = Array.from({ length: sources }, () => new Set<number>());
  for (let face = 0; face < mesh.document.faces; face++) {
    const [a, b, c] = mesh.corners(face).map((corner) => nearest[corner] ?? -1);
    for (const [from, to] of [
      [a, b],
      [b, c],
      [c, a],
    ] as [number, number][]) {
      if (from === to || from < 0 || to < 0) continue;
      neighbours[from]?.add(to);
      neighbours[to]?.add(from);
    }
  }
  return coloured(neighbours);
}

/**
 * Return a colour for each node of a graph: first for those that are left when others, of the fewest
 * neighbours, are taken away one by one. In a plane this takes six colours at most.
 */
export function coloured(neighbours: readonly ReadonlySet<number>[]): number[] {
  const left = new Set(neighbours.keys());
  const degrees = neighbours.map(({ size }) => size);
  const order: number[] = [];
  while (left.size > 0) {
    const next = [...left].reduce((a, b) => ((degrees[b] ?? 0) < (degrees[a] ?? 0) ? b : a));
    left.delete(next);
    order.push(next);
    for (const other of neighbours[next] ?? []) degrees[other] = (degrees[other] ?? 0) - 1;
  }
  const hues: number[] = neighbours.map(() => -1);
  const all = Array<number>(HUES).fill(0);
  for (const node of order.reverse()) {
    const used = Array<number>(HUES).fill(0);
    for (const other of neighbours[node] ?? []) {
      const hue = hues[other] ?? -1;
      if (hue >= 0) used[hue] = (used[hue] ?? 0) + 1;
    }
    // Of the colours that the fewest neighbours have, the one that is rarest so far.
    const rarity = used.map((near, hue) => near * neighbours.length + (all[hue] ?? 0));
    const hue = rarity.indexOf(Math.min(...rarity));
    hues[node] = hue;
    all[hue] = (all[hue] ?? 0) + 1;
  }
  return hues;
}
