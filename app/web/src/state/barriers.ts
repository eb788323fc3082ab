// Barriers: sets of faces that nothing passes, each as it was drawn.

export type Barriers = readonly (readonly number[])[];

/** Return the faces that nothing passes. */
export function blockedFaces({ barriers }: { barriers: Barriers }): number[] {
  return barriers.flat();
}

/** Return barriers once the painted faces are the blocked ones; new faces are one more barrier. */
export function repainted(barriers: Barriers, painted: ReadonlySet<number>): Barriers {
  const kept = barriers.map((faces) => faces.filter((face) => painted.has(face)));
  const known = new Set(barriers.flat());
  const added = [...painted].filter((face) => !known.has(face));
  return [...kept, added].filter(({ length }) => length > 0);
}
