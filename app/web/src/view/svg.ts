// What is drawn as SVG: the surface as a picture, and lines, points and names over it as shapes.
import { Vector3 } from "three";
import type { Mark } from "./markers";
import type { Look } from "./ribbon";
import type { Shape, Stage } from "./scene";
import type { Triple } from "./simplified";

/** Steps in which a line is looked at, in radii of the unit ball: parts of it may be hidden. */
const STEP = 0.02;

/** Return the picture that the canvas shows as SVG, in the pixels of the page. */
export function svgOf(stage: Stage, isSeen: (position: Triple) => boolean): Blob {
  const { clientWidth: width, clientHeight: height } = stage.canvas;
  const { left, top } = stage.canvas.getBoundingClientRect();
  const place = (position: Triple): [number, number] => {
    const [x, y] = stage.toPage(new Vector3(...position));
    return [x - left, y - top];
  };
  const shapes = stage.shapes();
  for (const each of shapes) each.visible = false;
  const surface = stage.picture();
  for (const each of shapes) each.visible = true;
  stage.invalidate();

  const parts = [
    `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}">`,
    `<image width="${width}" height="${height}" href="${surface.toDataURL("image/png")}"/>`,
    ...shapes.flatMap((each) => shapesOf(each, place, isSeen)),
    ...namesOf(left, top),
    "</svg>",
  ];
  return new Blob([parts.join("\n")], { type: "image/svg+xml" });
}

function shapesOf(
  { userData, geometry }: Shape,
  place: (position: Triple) => [number, number],
  isSeen: (position: Triple) => boolean,
): string[] {
  const { look, marks } = userData as { look?: Look; marks?: { opacity: number; hidden: boolean } };
  const { lines, points } = geometry.userData as { lines?: Triple[][]; points?: Mark[] };
  if (look && lines) {
    const runs = look.before === null ? lines : lines.flatMap((line) => seenOf(line, isSeen));
    return strokesOf(
      look,
      runs.map((run) => run.map(place)),
    );
  }
  if (marks && points) {
    return points
      .filter(({ position }) => marks.hidden || isSeen(position))
      .map((point) => discOf(point, place(point.position), marks.opacity));
  }
  return [];
}

/** Return lines through places, with their casing below them. */
function strokesOf(look: Look, lines: [number, number][][]): string[] {
  const d = lines
    .map((line) => `M${line.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L")}`)
    .join("");
  const stroke = (colour: number, width: number): string =>
    `<path d="${d}" fill="none" stroke="#${colour.toString(16).padStart(6, "0")}" ` +
    `stroke-width="${width}" stroke-linejoin="round" opacity="${look.opacity}"/>`;
  if (!d) return [];
  const line = stroke(look.colour, look.inner);
  return look.width > look.inner ? [stroke(look.casing, look.width), line] : [line];
}

/** Return a point as it is drawn: its colour, a light ring and a dark rim. */
function discOf({ fill, size }: Mark, [x, y]: [number, number], opacity: number): string {
  const colour = `rgb(${fill.map((share) => Math.round(255 * share)).join(" ")})`;
  const discs = [
    [size / 2 - 0.2, "#1f1f1f"],
    [size / 2 - 0.7, "#fff"],
    [size / 2 - 2.7, colour],
  ] as const;
  const circles = discs.map(([r, paint]) => `<circle r="${Math.max(r, 0)}" fill="${paint}"/>`);
  return `<g opacity="${opacity}" transform="translate(${x.toFixed(2)} ${y.toFixed(2)})">${circles.join("")}</g>`;
}

/** Return the parts of a line that the surface does not hide. */
function seenOf(line: Triple[], isSeen: (position: Triple) => boolean): Triple[][] {
  const runs: Triple[][] = [];
  let run: Triple[] = [];
  for (const position of refined(line)) {
    if (isSeen(position)) run.push(position);
    else if (run.length > 0) {
      runs.push(run);
      run = [];
    }
  }
  return [...runs, run].filter((each) => each.length > 1);
}

/** Return a line with further points, at most a step apart. */
function refined(line: Triple[]): Triple[] {
  return line.flatMap((end, i) => {
    const start = line[i - 1] ?? end;
    const steps = Math.ceil(Math.hypot(...end.map((x, axis) => x - start[axis]!)) / STEP) || 1;
    return Array.from({ length: steps }, (_, k) => {
      const t = (k + 1) / steps;
      return end.map((x, axis) => start[axis]! + t * (x - start[axis]!)) as Triple;
    });
  });
}

/** Return the names of points and levels where the page shows them. */
function namesOf(left: number, top: number): string[] {
  const names = [...document.querySelectorAll("#point-labels span, #level-labels span")];
  return names.flatMap((name) => {
    const style = getComputedStyle(name);
    if (style.visibility === "hidden") return [];
    const { x, y, width, height } = name.getBoundingClientRect();
    const box = shape("rect", {
      width,
      height,
      rx: style.borderRadius,
      fill: style.backgroundColor,
    });
    const text = shape("text", {
      ...{ x: width / 2, y: height / 2, "text-anchor": "middle", "dominant-baseline": "central" },
      ...{ "font-family": style.fontFamily, "font-size": style.fontSize },
      ...{ "font-weight": style.fontWeight, fill: style.color },
    });
    text.textContent = name.textContent;
    const transform = `translate(${x - left} ${y - top})`;
    const both = shape("g", { transform, opacity: style.opacity });
    both.append(box, text);
    return [new XMLSerializer().serializeToString(both)];
  });
}

function shape(kind: string, attributes: Record<string, string | number>): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, `${value}`);
  return element;
}
