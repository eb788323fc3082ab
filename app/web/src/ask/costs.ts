// The cost of paths, as the service takes it.
import type { SurfaceCost } from "geodesic-client";
import { type State, unitOf } from "../state/state";

/** Return the cost of paths, or null where only their length counts. */
export function costOf({ slope, faceCosts, maxDistance }: State): SurfaceCost | null {
  if (!slope && !faceCosts) return null;
  return {
    ...(slope && { slope: slope.rule, up: `+${slope.up}` as const }),
    ...(faceCosts && {
      faces: Array.from(faceCosts.numbers, (x) => (Number.isFinite(x) ? x : null)),
    }),
    ...(maxDistance !== null && { max_cost: maxDistance }),
  };
}

/** Whether costs take the place of distances. */
export function hasCost({ slope, faceCosts }: State): boolean {
  return slope !== null || faceCosts !== null;
}

/** Return a key by which the costs of two questions are compared. */
export function costKey({ slope, faceCosts }: State): unknown {
  return [slope, faceCosts?.key];
}

/** Return the unit of distances or costs. */
export function measureOf(state: State): string {
  if (state.slope) return "s";
  return state.faceCosts ? "units of the faces" : unitOf(state);
}
