// A film of a sweep: what is there after each step, and what the step did, in the paper's words.
import type { SweepAnswer } from "geodesic-client";
import { count, written } from "../dom";

/** What a step did. */
export interface Deed {
  /** Vertices that left the queue. */
  settled: number[];
  /** Vertices that sent out windows for the first time: sources and pseudosources. */
  lit: number[];
  /** Edges whose windows crossed a face. */
  edges: number;
  crossed: number;
  created: number;
  trimmed: number;
  /** Windows that were made shorter. */
  shortened: number;
}

export class Film {
  readonly deeds: Deed[];
  /** Vertices that send out windows, in the order in which they did so first. */
  readonly emitters = new Map<number, number>();
  /** The step in which the last window of each such vertex leaves the queue. */
  readonly active = new Map<number, number>();
  readonly largest: number;

  constructor(readonly sweep: SweepAnswer) {
    const { created, crossed, trimmed } = sweep;
    const change = (column: number[], step: number): number =>
      (column[step] ?? 0) - (column[step - 1] ?? 0);
    this.deeds = sweep.fronts.map((_, step) => ({
      settled: [],
      lit: [],
      edges: 0,
      crossed: change(crossed, step),
      created: change(created, step),
      trimmed: change(trimmed, step),
      shortened: 0,
    }));
    sweep.settled.forEach((step, vertex) => {
      if (step !== null) this.deeds[step]?.settled.push(vertex);
    });
    this.noteWindows();
    this.largest = Math.max(...sweep.fronts);
  }

  /** Number of the last step. */
  get last(): number {
    return this.deeds.length - 1;
  }

  private noteWindows(): void {
    const { first, crossed, last, pseudosources, tails, heads, faces } = this.sweep.windows;
    const edges = this.deeds.map(() => new Set<string>());
    first.forEach((step, i) => {
      const vertex = pseudosources[i];
      if (vertex != null && !this.emitters.has(vertex)) {
        this.emitters.set(vertex, this.emitters.size);
        this.deeds[step]?.lit.push(vertex);
      }
      const passed = crossed[i];
      if (vertex != null) {
        const left = passed ?? last[i] ?? this.last;
        this.active.set(vertex, Math.max(left, this.active.get(vertex) ?? 0));
      }
      if (passed == null) return;
      edges[passed]?.add(`${tails[i]} ${heads[i]} ${faces[i]}`);
      const deed = this.deeds[passed];
      // Where a step is more than one operation, windows that came and crossed in it count as well.
      if (passed === step && deed) deed.shortened += 1;
    });
    for (const [step, deed] of this.deeds.entries()) deed.edges = edges[step]?.size ?? 0;
  }

  /** Tell what a step does. */
  words(step: number, unit: string): string {
    const deed = this.deeds[step];
    if (!deed) return "";
    if (step === 0) return START;
    const { settled, edges } = deed;
    const isLast = step === this.last;
    const told =
      settled.length === 0 && edges === 1
        ? crossing(deed)
        : settled.length === 1 && edges === 0
          ? this.popping(deed, unit)
          : several(deed);
    return isLast ? `${told} ${END}` : told;
  }

  /** Tell where the front is, and how many windows there are. */
  counts(step: number, unit: string): string {
    const { fronts, waiting, crossed, trimmed } = this.sweep;
    const front = `Front at ${written(fronts[step] ?? 0, 3)} of ${written(this.largest, 3)} ${unit}`;
    const windows = [
      `${count(waiting[step] ?? 0, "window")} waiting`,
      `${(crossed[step] ?? 0).toLocaleString("en")} done`,
      `${(trimmed[step] ?? 0).toLocaleString("en")} trimmed away`,
    ];
    return `${front} · ${windows.join(", ")}`;
  }

  private popping({ settled, lit, created }: Deed, unit: string): string {
    const vertex = settled[0] ?? 0;
    const distance = written(this.sweep.distances[vertex] ?? 0, 4);
    const popped = `Pop: vertex ${vertex}, the nearest, leaves the queue at distance ${distance} ${unit}`;
    const isSource = this.sweep.sources.some((source) => source.vertex === vertex);
    if (isSource)
      return `Initialise (3.4): the source sends out ${count(created, "window")}, one over each edge opposite to it.`;
    if (lit.includes(vertex))
      return `${popped}. Shortest paths bend here: a new pseudosource (3.2) sends ${count(created, "window")} into the part that its own light misses.`;
    return `${popped} (3.4). The windows of the edges around it may be propagated now.`;
  }
}

const START = "Start: the queue holds the sources, at distance 0. No edge has a window yet.";
const END = "The queue is empty: all distances are exact.";

function crossing({ crossed, created, trimmed, shortened }: Deed): string {
  const cut = [
    ...(trimmed > 0 ? [`${trimmed} trimmed away`] : []),
    ...(shortened > 0 ? [`${shortened} made shorter`] : []),
  ];
  const trimming =
    cut.length > 0
      ? `Intersect (3.3): where windows overlap the nearer stays; ${cut.join(", ")}. `
      : "";
  if (crossed === 0) return `${trimming}None is left to propagate.`;
  const onward = created > 0 ? `${count(created, "new window")} beyond it` : "no edge beyond it";
  return `${trimming}Propagate (3.2): ${count(crossed, "window")} of an edge ${crossed === 1 ? "crosses" : "cross"} a face, ${onward}.`;
}

function several({ settled, lit, crossed, created, trimmed }: Deed): string {
  const bends = lit.length > 0 ? `, ${count(lit.length, "new pseudosource")}` : "";
  const popped = `Pop (3.4): ${count(settled.length, "vertex", "vertices")}${bends}.`;
  const onward = `Propagate (3.2): ${count(crossed, "window")}, ${created.toLocaleString("en")} new beyond.`;
  const cut = `Intersect (3.3): ${trimmed.toLocaleString("en")} trimmed away.`;
  return [
    ...(settled.length > 0 ? [popped] : []),
    ...(crossed > 0 || created > 0 ? [onward] : []),
    ...(trimmed > 0 ? [cut] : []),
  ].join(" ");
}
