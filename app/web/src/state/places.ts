// The points of the question in one list: where a path may start, its stops, and its end.

import { differences, type Triple } from "../mesh/frame";
import type { Point } from "./point";
import type { State } from "./state";

/** A point, and the name that the user gave it; without one, its place in the list names it. */
export interface Place<P = Point> {
  point: P;
  name: string;
}

export type Places<P = Point> = { places: readonly Place<P>[]; starts: number };

/** Return the points from which distances count; a path starts at the nearest of them. */
export function startsOf<P>({ places, starts }: Places<P>): P[] {
  return places.slice(0, starts).map(({ point }) => point);
}

/** Return where the path ends, or null. */
export function endOf<P>({ places, starts }: Places<P>): P | null {
  return places.length > starts ? (places.at(-1)?.point ?? null) : null;
}

/** Return the points that the path passes on its way. */
export function stopsOf<P>({ places, starts }: Places<P>): P[] {
  return places.slice(starts, -1).map(({ point }) => point);
}

/** Return the name of a place: A, A2, A3 for starts, 1, 2, 3 for stops, and B for the end. */
export function nameOf({ places, starts }: Places<unknown>, index: number): string {
  const name = places[index]?.name;
  if (name) return name;
  if (index < starts) return index === 0 ? "A" : `A${index + 1}`;
  return index === places.length - 1 ? "B" : String(index - starts + 1);
}

/** Return the list without one of its places; without the only start, the next place is one. */
export function without({ places, starts }: Places, index: number): Places {
  const isStart = index < starts && starts > 1;
  return { places: places.toSpliced(index, 1), starts: isStart ? starts - 1 : starts };
}

/** Return the list with one of its places moved to where another is. */
export function reordered({ places }: Places, from: number, to: number): Pick<Places, "places"> {
  return { places: places.toSpliced(from, 1).toSpliced(to, 0, ...places.slice(from, from + 1)) };
}

/** What a click does: set the ends of the path, add a stop or a start, walk straight on, block faces. */
export type Tool = "ends" | "stop" | "start" | "walk" | "barrier";

/** What is done with a point: in words, as "sets A", and as the change that does it. */
export interface Act {
  words: string;
  change: Partial<State>;
}

/** Return what a tool does with a point; ``positionOf`` tells where points are in space. */
export function actOf(
  state: Places,
  tool: Tool,
  point: Point,
  positionOf: (point: Point) => Triple,
): Act {
  const { places, starts } = state;
  const place = { point, name: "" };
  const last = places.length - 1;
  const hasEnd = last >= starts;
  const naming = (verb: string, index: number, change: Places): Act => ({
    words: `${verb} ${nameOf(change, index)}`,
    change,
  });
  const [first] = places;
  if (!first) return naming("sets", 0, { places: [place], starts: 1 });
  if (tool === "walk") return walkTo(first.point, point, positionOf);
  if (tool === "start") {
    const added = { places: places.toSpliced(starts, 0, place), starts: starts + 1 };
    return naming("adds start", starts, added);
  }
  if (!hasEnd) return naming("sets", last + 1, { places: [...places, place], starts });
  if (tool === "stop") {
    return naming("adds stop", last, { places: places.toSpliced(last, 0, place), starts });
  }
  const away = (index: number): number => {
    const end = places[index];
    return end ? Math.hypot(...differences(positionOf(end.point), positionOf(point))) : Infinity;
  };
  const ends = [...Array(starts).keys(), last];
  const nearest = ends.reduce((best, end) => (away(end) < away(best) ? end : best));
  return naming("moves", nearest, { places: placedAt(places, nearest, point), starts });
}

/** Return the places with one of them at another point. */
export function placedAt(places: readonly Place[], index: number, point: Point): Place[] {
  return places.map((place, i) => (i === index ? { ...place, point } : place));
}

/** Walk from the first start in the direction of a point, as far as it is away in space. */
function walkTo(start: Point, point: Point, positionOf: (point: Point) => Triple): Act {
  const way = differences(positionOf(point), positionOf(start));
  const walk = way.map((x) => Number(x.toPrecision(6))) as Triple;
  const change = Math.hypot(...walk) > 0 ? { walk } : {};
  return { words: "walks straight on from A in this direction", change };
}
