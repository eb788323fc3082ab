// Random numbers from a seed (mulberry32), so that a failing case comes again.

export class Random {
  constructor(private seed: number) {}

  /** Return a number from 0 up to 1. */
  next(): number {
    this.seed = (this.seed + 0x6d2b79f5) | 0;
    let t = Math.imul(this.seed ^ (this.seed >>> 15), 1 | this.seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  }

  /** Return an integer from 0 up to ``end``. */
  below(end: number): number {
    return Math.floor(this.next() * end);
  }

  pick<T>(choices: readonly T[]): T {
    return choices[this.below(choices.length)] as T;
  }

  /** Return up to ``most`` values that ``make`` returns. */
  list<T>(most: number, make: () => T): T[] {
    return Array.from({ length: this.below(most + 1) }, make);
  }

  /** Return a positive number of any size. */
  size(): number {
    return Number(((1 + 9 * this.next()) * 10 ** (this.below(13) - 6)).toPrecision(6));
  }
}
