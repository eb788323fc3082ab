// Numbers of a file: one for each vertex or each face of a mesh.
import { parseNpy } from "geodesic-client";
import { InputError } from "../inputError";
import type { Values } from "../state/state";

/** Files of numbers by their names. */
export const NUMBERS = /\.(csv|txt|npy)$/i;
let files = 0;

/** Read the numbers of a file: of an array, or the last of each line of a text. */
export async function readNumbers(file: File): Promise<Values> {
  const isArray = /\.npy$/i.test(file.name);
  const numbers = isArray
    ? numbersOfArray(file.name, await file.arrayBuffer())
    : numbersOfText(file.name, await file.text());
  files += 1;
  return { name: file.name, numbers, key: files };
}

function numbersOfArray(name: string, buffer: ArrayBuffer): Float64Array {
  try {
    return Float64Array.from(parseNpy(buffer).data as ArrayLike<number | bigint>, Number);
  } catch {
    throw new InputError(
      "Not an array of numbers",
      `${name} cannot be read as numbers.`,
      "Save it by numpy.save, as 32 or 64 bits in C order, or write one number a line.",
    );
  }
}

/** Read one number of each line, after a line of names if there is one. */
export function numbersOfText(name: string, text: string): Float64Array {
  const lines = text.split(/\r?\n/).filter((line) => line.trim());
  const fields = (line: string): string[] => line.trim().split(/\s*[,;]\s*|\s+/);
  const [first = "", ...others] = lines;
  const isNamed = others.length > 0 && numberOf(fields(first).at(-1)) === null;
  const rows = isNamed ? others : lines;
  const texts = rows.length === 1 ? fields(first) : rows.map((line) => fields(line).at(-1));
  const wrong = texts.findIndex((each) => numberOf(each) === null);
  if (wrong >= 0) {
    throw new InputError(
      "Not a list of numbers",
      `${name} has “${texts[wrong]?.slice(0, 40)}” as number ${wrong + 1}.`,
      "Write one number a line; of several columns the last one counts. Write nan for none.",
    );
  }
  return Float64Array.from(texts, (each) => numberOf(each) ?? Number.NaN);
}

/** Return a number, NaN for none, or null for what is not a number. */
function numberOf(text = ""): number | null {
  if (/^("?)(|nan|null|none)\1$/i.test(text)) return Number.NaN;
  const number = Number(text);
  return Number.isNaN(number) ? null : number;
}

/** Return the least and the largest of the finite numbers; 0 and 0 if there are none. */
export function extremesOf(numbers: Float64Array): [number, number] {
  let [least, largest] = [Infinity, -Infinity];
  for (const number of numbers) {
    if (!Number.isFinite(number)) continue;
    least = Math.min(least, number);
    largest = Math.max(largest, number);
  }
  return least <= largest ? [least, largest] : [0, 0];
}
