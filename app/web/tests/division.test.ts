// Faces divided along borders: all of a face, each part on the side of its source.
import { describe, expect, it } from "vitest";
import { divide, type Part, type Piece } from "../src/mesh/division";

type Place = readonly [number, number];

function area({ places: [a, b, c] }: Part): number {
  return 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]));
}

/** Sum the areas of the parts of each source. */
function areas(parts: Part[]): Map<number, number> {
  const found = new Map<number, number>();
  for (const part of parts) {
    expect(area(part)).toBeGreaterThan(0);
    found.set(part.source, (found.get(part.source) ?? 0) + area(part));
  }
  return found;
}

function expectAreas(parts: Part[], expected: Record<number, number>): void {
  const found = areas(parts);
  expect([...found.keys()].sort()).toEqual(Object.keys(expected).map(Number).sort());
  for (const [source, size] of Object.entries(expected)) {
    expect(found.get(Number(source))).toBeCloseTo(size, 9);
  }
}

describe("a face", () => {
  it("is whole without a border", () => {
    expectAreas(divide([3, 3, 3], []), { 3: 0.5 });
  });

  it("is divided from side to side", () => {
    const piece: Piece = {
      places: [
        [0.5, 0],
        [0.3, 0.2],
        [0, 0.5],
      ],
      sources: [0, 1],
    };
    expectAreas(divide([0, 1, 1], [piece]), { 0: 0.1 + 0.025, 1: 0.375 });
  });

  it("is divided in three where borders meet", () => {
    const centre: Place = [1 / 3, 1 / 3];
    const pieces: Piece[] = [
      { places: [[0.5, 0], centre], sources: [4, 7] },
      { places: [centre, [0.5, 0.5]], sources: [7, 9] },
      { places: [[0, 0.5], centre], sources: [4, 9] },
    ];
    expectAreas(divide([4, 7, 9], pieces), { 4: 1 / 6, 7: 1 / 6, 9: 1 / 6 });
  });

  it("has a part without a corner between two borders", () => {
    const pieces: Piece[] = [
      {
        places: [
          [0.4, 0],
          [0, 0.4],
        ],
        sources: [0, 2],
      },
      {
        places: [
          [0.6, 0],
          [0, 0.6],
        ],
        sources: [1, 2],
      },
    ];
    expectAreas(divide([0, 1, 1], pieces), { 0: 0.08, 1: 0.32, 2: 0.1 });
  });

  it("has a bay that a border enters and leaves over one side", () => {
    const piece: Piece = {
      places: [
        [0.3, 0],
        [0.4, 0.2],
        [0.5, 0],
      ],
      sources: [1, 5],
    };
    expectAreas(divide([1, 1, 1], [piece]), { 1: 0.48, 5: 0.02 });
  });

  it("has an island", () => {
    const places: Place[] = [
      [0.2, 0.2],
      [0.3, 0.2],
      [0.2, 0.3],
      [0.2, 0.2],
    ];
    expectAreas(divide([1, 1, 1], [{ places, sources: [0, 1] }]), { 0: 0.005, 1: 0.495 });
  });

  it("is divided from a corner, whose source may be that of neither part", () => {
    const piece: Piece = {
      places: [
        [0, 0],
        [0.5, 0.5],
      ],
      sources: [1, 2],
    };
    expectAreas(divide([0, 1, 2], [piece]), { 1: 0.25, 2: 0.25 });
  });

  it("is divided beside a side where a border runs along it, by rounding", () => {
    const piece: Piece = {
      places: [
        [1e-9, -1e-12],
        [1, 1e-10],
      ],
      sources: [1, 2],
    };
    expectAreas(divide([1, 1, 1], [piece]), { 1: 0.5 });
  });
});
