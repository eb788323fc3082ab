// Arrays in NumPy's format, written from its specification.

type Numbers = Float64Array | Float32Array | Int32Array | Uint32Array | BigInt64Array;

export function npyOf(
  numbers: Numbers,
  kind: string,
  shape: readonly number[],
  { version = 1, order = "False" } = {},
): ArrayBuffer {
  const text = `{'descr': '${kind}', 'fortran_order': ${order}, 'shape': (${shape.join(", ")}${
    shape.length === 1 ? "," : ""
  }), }`;
  const start = version === 1 ? 10 : 12;
  const padded = text.padEnd(Math.ceil((start + text.length + 1) / 64) * 64 - start - 1);
  const header = new TextEncoder().encode(`${padded}\n`);
  const bytes = new Uint8Array(start + header.length + numbers.byteLength);
  bytes.set([0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59, version, 0]);
  const view = new DataView(bytes.buffer);
  if (version === 1) view.setUint16(8, header.length, true);
  else view.setUint32(8, header.length, true);
  bytes.set(header, start);
  const raw = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
  bytes.set(raw, start + header.length);
  return bytes.buffer;
}
