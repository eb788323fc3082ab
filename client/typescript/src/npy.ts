// Arrays in NumPy's .npy format: a header of text, then the raw numbers.

const KINDS = {
  "<f8": Float64Array,
  "<f4": Float32Array,
  "<i4": Int32Array,
  "<u4": Uint32Array,
  "<i8": BigInt64Array,
} as const;

export interface NpyArray {
  data: InstanceType<(typeof KINDS)[keyof typeof KINDS]>;
  shape: number[];
}

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

/** Return integers of 32 bits: the service writes 64, but no mesh needs as many. */
export function toIntegers({ data }: NpyArray): Int32Array<ArrayBuffer> {
  return Int32Array.from(data as ArrayLike<number | bigint>, Number);
}

/** Return the numbers as doubles; those that are not are copied. */
export function toDoubles({ data }: NpyArray): Float64Array<ArrayBuffer> {
  if (data instanceof Float64Array) return data;
  return Float64Array.from(data as ArrayLike<number | bigint>, Number);
}

/** Write doubles of one dimension. */
export function npyOf(values: Float64Array): Blob {
  const text = `{'descr': '<f8', 'fortran_order': False, 'shape': (${values.length},), }`;
  const header = `${text.padEnd(117)}\n`; // with the ten bytes before it, a multiple of 64
  const start = Uint8Array.of(0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, 1, 0, header.length, 0);
  return new Blob([start, header, values as Float64Array<ArrayBuffer>]);
}
