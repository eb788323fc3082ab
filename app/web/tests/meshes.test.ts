import { expect, test } from "vitest";
import { refusalOf } from "../src/panel/meshes";

test.each(["a.obj", "b.OFF", "c.d.ply", "e.stl", "f.glb", "g.json"])("%s may be a mesh", (name) => {
  expect(refusalOf({ name, type: "" })).toBeNull();
});

test.each([
  ["cat.png", "image/png", "cat.png is an image."],
  ["notes.txt", "text/plain", "notes.txt is a text file."],
  ["archive.zip", "application/zip", "archive.zip is not a mesh that can be read here."],
  ["obj", "", null],
])("%s is refused in a sentence", (name, type, detail) => {
  const refusal = refusalOf({ name, type });
  expect(refusal?.problem.detail ?? null).toBe(detail);
  if (refusal) expect(refusal.problem.hint).toMatch(/obj, off, ply, stl, glb or json/);
});
