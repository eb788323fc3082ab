import { describe, expect, test } from "vitest";
import { levelSetsOf } from "../src/ask/isolines";
import { extremesOf, numbersOfText, readNumbers } from "../src/mesh/values";
import { npyOf } from "./support/npy";

describe("numbers of a text", () => {
  test.each([
    ["1\n-2.5\n3e2\n", [1, -2.5, 300]],
    ["vertex,height\r\n0,4\r\n1,5\r\n", [4, 5]],
    ["1, 2,3", [1, 2, 3]],
    ["1\nnan\nnull\n", [1, Number.NaN, Number.NaN]],
  ])("%j", (text, numbers) => {
    expect([...numbersOfText("file", text)]).toEqual(numbers);
  });

  test("what is no number is named", () => {
    expect(() => numbersOfText("a.txt", "1\n2\nthree\n")).toThrow("a.txt has “three” as number 3.");
  });
});

test("numbers of an array are read, and a file that is none is refused", async () => {
  const file = new File([npyOf(Float64Array.of(1, 2, -3), "<f8", [3])], "a.npy");
  expect([...(await readNumbers(file)).numbers]).toEqual([1, 2, -3]);
  await expect(readNumbers(new File(["no"], "b.npy"))).rejects.toThrow("b.npy cannot be read");
});

test("extremes leave out what is no number", () => {
  expect(extremesOf(Float64Array.of(Number.NaN, -2, Infinity, 5))).toEqual([-2, 5]);
});

test("levels are the multiples of a spacing strictly between the extremes", () => {
  const values = { name: "", key: 1, numbers: Float64Array.of(-1, 0.4, 1, Number.NaN) };
  expect(levelSetsOf(values, { spacing: 0.5 })).toEqual({
    values: Float64Array.of(-1, 0.4, 1, Number.NaN),
    levels: [-0.5, 0, 0.5],
  });
});
