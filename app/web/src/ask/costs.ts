// What ways cost, as the service takes it.
import type { SurfaceCost } from "geodesic-client";
import { type State, unitOf } from "../state/state";

/** Return what ways cost, or null where only their length counts. */
export function costOf({ slope, tolls, maxDistance }: State): SurfaceCost | null {
  if (!slope && !tolls) return null;
  return {
    ...(slope && { slope: slope.rule, up: `+${slope.up}` as const }),
    ...(tolls && { faces: Array.from(tolls.numbers, (x) => (Number.isFinite(x) ? x : null)) }),
    ...(maxDistance !== null && { max_cost: maxDistance }),
  };
}

/** Whether costs take the place of distances. */
export function hasCost({ slope, tolls }: State): boolean {
  return slope !== null || tolls !== null;
}

/** Return what stands for the cost in a comparison of two questions. */
export function costKey({ slope, tolls }: State): unknown {
  return [slope, tolls?.key];
}

/** Return in what distances or costs are counted. */
export function measureOf(state: State): string {
  if (state.slope) return "s";
  return state.tolls ? "units of the faces" : unitOf(state);
}
