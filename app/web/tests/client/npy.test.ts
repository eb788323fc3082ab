import { describe, expect, test } from "vitest";
import {
  npyOf as npyOfDoubles,
  parseNpy,
  toDoubles,
  toIntegers,
} from "../../../../client/typescript/src/npy";
import { npyOf } from "../support/npy";
import { Random } from "../support/random";

function bytesOf(base64: string): ArrayBuffer {
  return Uint8Array.from(atob(base64), (character) => character.charCodeAt(0)).buffer;
}

/** Files that NumPy itself has written. */
const BY_NUMPY = {
  doubles:
    "k05VTVBZAQB2AHsnZGVzY3InOiAnPGY4JywgJ2ZvcnRyYW5fb3JkZXInOiBGYWxzZSwgJ3NoYXBlJzogKDQsKSwgfSAg" +
    "ICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgIAqamZmZmZm5PwAA" +
    "AAAAAPB/AAAAAAAAAIABAAAAAAAAAA==",
  version2:
    "k05VTVBZAgB0AAAAeydkZXNjcic6ICc8aTgnLCAnZm9ydHJhbl9vcmRlcic6IEZhbHNlLCAnc2hhcGUnOiAoMiwgMyks" +
    "IH0gICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgIAoAAAAAAAAAAAEA" +
    "AAAAAAAAAgAAAAAAAAADAAAAAAAAAAQAAAAAAAAABQAAAAAAAAA=",
  scalar:
    "k05VTVBZAQB2AHsnZGVzY3InOiAnPGY4JywgJ2ZvcnRyYW5fb3JkZXInOiBGYWxzZSwgJ3NoYXBlJzogKCksIH0gICAg" +
    "ICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgICAgIAoAAAAAAAD4Pw==",
};

describe("files by NumPy", () => {
  test("doubles arrive to the bit", () => {
    const { data, shape } = parseNpy(bytesOf(BY_NUMPY.doubles));
    expect(data).toEqual(new Float64Array([0.1, Infinity, -0, 5e-324]));
    expect(shape).toEqual([4]);
  });

  test("version 2, of two dimensions and 64-bit integers", () => {
    const array = parseNpy(bytesOf(BY_NUMPY.version2));
    expect(array.data).toEqual(new BigInt64Array([0n, 1n, 2n, 3n, 4n, 5n]));
    expect(array.shape).toEqual([2, 3]);
    expect(toIntegers(array)).toEqual(new Int32Array([0, 1, 2, 3, 4, 5]));
  });

  test("a scalar has no dimension", () => {
    const { data, shape } = parseNpy(bytesOf(BY_NUMPY.scalar));
    expect(data).toEqual(new Float64Array([1.5]));
    expect(shape).toEqual([]);
  });
});

describe("round trips", () => {
  const kinds = {
    "<f8": Float64Array,
    "<f4": Float32Array,
    "<i4": Int32Array,
    "<u4": Uint32Array,
    "<i8": BigInt64Array,
  } as const;

  test.each(Object.keys(kinds) as (keyof typeof kinds)[])("of %s keep every bit", (kind) => {
    const random = new Random(6);
    const Kind = kinds[kind];
    for (let i = 0; i < 100; i++) {
      const shape = [random.below(20), ...random.list(2, () => 1 + random.below(4))];
      const length = shape.reduce((product, size) => product * size, 1);
      const bits = Uint8Array.from({ length: length * Kind.BYTES_PER_ELEMENT }, () =>
        random.below(256),
      );
      const version = random.pick([1, 2]);
      const parsed = parseNpy(npyOf(new Kind(bits.buffer), kind, shape, { version }));
      expect(parsed.shape).toEqual(shape);
      expect(parsed.data).toBeInstanceOf(Kind);
      expect(parsed.data.length).toBe(length);
      const { buffer, byteOffset, byteLength } = parsed.data;
      expect(new Uint8Array(buffer, byteOffset, byteLength)).toEqual(bits);
    }
  });

  test("indices of 31 bits, and -1 for none, fit", () => {
    const largest = 2 ** 31 - 1;
    const array = parseNpy(npyOf(new BigInt64Array([-1n, BigInt(largest)]), "<i8", [2]));
    expect(toIntegers(array)).toEqual(new Int32Array([-1, largest]));
  });

  test("single precision becomes double", () => {
    const array = parseNpy(npyOf(new Float32Array([0.5, Infinity]), "<f4", [2]));
    expect(toDoubles(array)).toEqual(new Float64Array([0.5, Infinity]));
  });

  test.each([0, 1, 1000])("what is written is as NumPy would write it: %i doubles", async (n) => {
    const doubles = Float64Array.from({ length: n }, (_, i) => 1 / i);
    const written = await npyOfDoubles(doubles).arrayBuffer();
    expect(new Uint8Array(written)).toEqual(new Uint8Array(npyOf(doubles, "<f8", [n])));
  });
});

describe("bad input", () => {
  const three = new Float64Array(3);

  test.each([
    ["big-endian numbers", npyOf(three, ">f8", [3])],
    ["numbers of an unknown kind", npyOf(three, "<c16", [3])],
    ["objects", npyOf(three, "|O", [3])],
    ["Fortran's order", npyOf(three, "<f8", [3], { order: "True" })],
  ])("%s cannot be read, and the header is named", (_, buffer) => {
    expect(() => parseNpy(buffer)).toThrow(/cannot be read: \{'descr'/);
  });

  test("text cannot be read", () => {
    for (const text of ["", "{}", "<!doctype html><title>Proxy</title><p>Sorry.</p>"]) {
      expect(() => parseNpy(new TextEncoder().encode(text).buffer), text).toThrow();
    }
  });

  test("no file that is cut within a number or the header can be read", () => {
    const buffer = npyOf(three, "<f8", [3]);
    const header = buffer.byteLength - three.byteLength;
    for (let end = 0; end < buffer.byteLength; end++) {
      if (end >= header && (end - header) % 8 === 0) continue; // whole numbers
      expect(() => parseNpy(buffer.slice(0, end)), `${end} bytes`).toThrow();
    }
  });
});
