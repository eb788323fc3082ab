// Arrays in NumPy's .npy format: a header of text, then the raw numbers.

export interface NpyArray {
  data: Float64Array | Float32Array | Int32Array | Uint32Array | BigInt64Array;
  shape: number[];
}

const KINDS = {
  "<f8": Float64Array,
  "<f4": Float32Array,
  "<i4": Int32Array,
  "<u4": Uint32Array,
  "<i8": BigInt64Array,
} as const;

/** Parse an array in C order; its numbers share memory with ``buffer``. */
export function parseNpy(buffer: ArrayBuffer): NpyArray {
  const view = new DataView(buffer);
  const isLong = view.getUint8(6) > 1; // version 2 has a header of more than 64 kB
  const start = isLong ? 12 : 10;
  const length = isLong ? view.getUint32(8, true) : view.getUint16(8, true);
  const header = new TextDecoder().decode(new Uint8Array(buffer, start, length));
  const kind = /'descr':\s*'([^']+)'/.exec(header)?.[1];
  const shape = /'shape':\s*\(([^)]*)\)/.exec(header)?.[1];
  if (kind === undefined || shape === undefined || !(kind in KINDS) || header.includes("True")) {
    throw new Error(`This array cannot be read: ${header.trim()}`);
  }
  const data = new KINDS[kind as keyof typeof KINDS](buffer, start + length);
  return {
    data,
    shape: shape
      .split(",")
      .filter((part) => part.trim())
      .map(Number),
  };
}

/** Return the numbers as 32-bit indices: the service writes 64 bits, but no mesh needs as many. */
export function toIndices(array: NpyArray): Uint32Array<ArrayBuffer> {
  return Uint32Array.from(array.data as ArrayLike<number | bigint>, Number);
}
