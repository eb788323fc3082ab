import { expect, test } from "vitest";
import { refusalOf } from "../src/panel/meshes";

test.each([
  ["a.obj", "text/plain"],
  ["b.OFF", ""],
  ["c.d.ply", "text/plain"],
  ["lh.pial", ""],
  ["lh.sphere.reg", "text/plain"],
  ["cube.surf.gii.gz", "application/gzip"],
  ["mesh.zip", "application/zip"],
  ["g.json", "application/json"],
  ["obj", ""],
])("%s may be a mesh", (name, type) => {
  expect(refusalOf({ name, type }, "OBJ, OFF")).toBeNull();
});

test.each([
  ["cat.png", "image/png", "cat.png is an image."],
  ["notes.TXT", "", "notes.TXT is a text file."],
  ["page.html", "text/html", "page.html is a text file."],
  ["talk.mp4", "video/mp4", "talk.mp4 is a recording."],
  ["paper.pdf", "application/pdf", "paper.pdf is a document."],
])("%s is refused in a sentence", (name, type, detail) => {
  const refusal = refusalOf({ name, type }, "OBJ, OFF");
  expect(refusal?.message).toBe(detail);
  expect(refusal?.hint).toBe("This service reads OBJ, OFF.");
});
