// The section of the view.
import type { Plane } from "three";

/** None, or the plane that cuts what is drawn of the mesh: `clippingPlanes` of its materials. */
export const SECTION: Plane[] = [];
