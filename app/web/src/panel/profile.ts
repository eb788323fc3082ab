// The height of a path over its length, as a small chart.
import type { PathAnswer } from "geodesic-client";
import { byId, written } from "../dom";
import { differences, type Triple, type Up } from "../mesh/frame";

/** Size of the drawing, in its own units. */
const [WIDTH, HEIGHT] = [300, 90];

/** A path's points by how far along it they are, and how high. */
export interface Profile {
  along: number[];
  heights: number[];
  climb: number;
  fall: number;
}

export function profileOf(points: readonly Triple[], up: Up): Profile {
  const axis = up === "y" ? 1 : 2;
  const heights = points.map((point) => point[axis]);
  const along = [0];
  let [climb, fall] = [0, 0];
  for (let i = 1; i < points.length; i++) {
    const from: Triple = points[i - 1] ?? [0, 0, 0];
    const to: Triple = points[i] ?? from;
    along.push((along[i - 1] ?? 0) + Math.hypot(...differences(to, from)));
    const rise = to[axis] - from[axis];
    if (rise > 0) climb += rise;
    else fall -= rise;
  }
  return { along, heights, climb, fall };
}

export class ProfileChart {
  private points: readonly Triple[] = [];
  private profile: Profile | null = null;
  private unit = "";
  private readonly chart = byId("profile-chart");

  /** ``mark`` shows a position on the mesh, or none. */
  constructor(private readonly mark: (position: Triple | null) => void) {
    this.chart.addEventListener("pointermove", (event) => this.follow(event));
    this.chart.addEventListener("pointerleave", () => {
      this.mark(null);
      this.tell(null);
    });
  }

  /** Show the profile of a path, or none. */
  show(outline: PathAnswer | null, up: Up, unit: string): void {
    this.points = (outline?.points ?? []) as Triple[];
    this.unit = unit;
    this.mark(null);
    const isShown = this.points.length > 1;
    byId("profile").hidden = !isShown;
    this.profile = isShown ? profileOf(this.points, up) : null;
    this.draw();
    this.tell(null);
  }

  private draw(): void {
    const { profile } = this;
    if (!profile) return;
    const { along, heights } = profile;
    const length = along.at(-1) || 1;
    const low = Math.min(...heights);
    const extent = Math.max(...heights) - low || 1;
    const line = along
      .map((x, i) => {
        const share = ((heights[i] ?? low) - low) / extent;
        return `${((x / length) * WIDTH).toFixed(1)},${((1 - share) * HEIGHT).toFixed(1)}`;
      })
      .join(" ");
    byId("profile-low").textContent = written(low, 4);
    byId("profile-high").textContent = written(low + extent, 4);
    byId("profile-end").textContent = `${written(length, 4)} ${this.unit}`;
    const set = (selector: string, points: string): void =>
      this.chart.querySelector(selector)?.setAttribute("points", points);
    set("polyline", line);
    set("polygon", `0,${HEIGHT} ${line} ${WIDTH},${HEIGHT}`);
    this.chart.setAttribute("aria-label", `Height along the path. ${this.words}`);
  }

  private get words(): string {
    if (!this.profile) return "";
    const { climb, fall } = this.profile;
    return `Climbs ${written(climb, 4)} and falls ${written(fall, 4)} ${this.unit}.`;
  }

  /** Tell where the pointer is on the path, and mark it on the mesh. */
  private follow({ clientX }: PointerEvent): void {
    const { profile } = this;
    if (!profile) return;
    const { left, width } = this.chart.getBoundingClientRect();
    const share = Math.min(Math.max((clientX - left) / width, 0), 1);
    const at = share * (profile.along.at(-1) ?? 0);
    const next = Math.max(
      1,
      profile.along.findIndex((x) => x >= at),
    );
    const [x0 = 0, x1 = 0] = profile.along.slice(next - 1, next + 1);
    const t = x1 > x0 ? (at - x0) / (x1 - x0) : 0;
    const [from, to] = this.points.slice(next - 1, next + 1);
    if (!from || !to) return;
    this.mark(from.map((x, axis) => x + t * ((to[axis] ?? x) - x)) as Triple);
    const [low = 0, high = low] = profile.heights.slice(next - 1, next + 1);
    this.tell(`After ${written(at, 4)}: at ${written(low + t * (high - low), 4)} ${this.unit}.`);
  }

  private tell(words: string | null): void {
    byId("profile-words").textContent = words ?? this.words;
  }
}
