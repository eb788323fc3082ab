// A film as a video: the canvas with its caption below, frame by frame, in the browser's own format.
import { download } from "../dom";
import type { Stage } from "../view/scene";

const HEIGHT = 136; // of the caption, in pixels of the canvas at a ratio of 1
const FONT = 15;
/** How long the last step is shown. */
const LINGER_MS = 1500;

/** Record the steps up to the last one, and hand the video to the user. */
export async function record(
  stage: Stage,
  last: number,
  pause: number,
  frame: (step: number) => string[],
  signal: AbortSignal,
): Promise<void> {
  const picture = document.createElement("canvas");
  const ratio = stage.renderer.getPixelRatio();
  picture.width = even(stage.canvas.width);
  picture.height = even(stage.canvas.height + HEIGHT * ratio);
  const context = picture.getContext("2d");
  if (!context) throw new DOMException("It has no canvas to draw on.", "NotSupportedError");
  const recorder = new MediaRecorder(picture.captureStream(), { mimeType: "video/webm" });
  const parts: Blob[] = [];
  recorder.addEventListener("dataavailable", ({ data }) => parts.push(data));
  const isDone = new Promise((resolve) => recorder.addEventListener("stop", resolve));
  recorder.start();
  try {
    for (let step = 0; step <= last; step++) {
      const words = frame(step);
      await stage.drawn(); // a moment later the canvas could not be read any more
      draw(context, stage.canvas, words, ratio);
      await new Promise((resolve) => setTimeout(resolve, step === last ? LINGER_MS : pause));
      signal.throwIfAborted();
    }
  } finally {
    recorder.stop();
  }
  await isDone;
  download(new Blob(parts, { type: "video/webm" }), "geodesic-search.webm");
}

/** Encoders want even numbers of pixels. */
function even(size: number): number {
  return 2 * Math.ceil(size / 2);
}

function draw(
  context: CanvasRenderingContext2D,
  canvas: HTMLCanvasElement,
  words: string[],
  ratio: number,
): void {
  const { width, height } = context.canvas;
  const style = getComputedStyle(document.documentElement);
  context.fillStyle = style.getPropertyValue("--ground");
  context.fillRect(0, 0, width, height);
  context.drawImage(canvas, 0, 0);
  context.fillStyle = style.getPropertyValue("--ink") || "#888";
  context.font = `${FONT * ratio}px sans-serif`;
  const margin = FONT * ratio;
  let y = canvas.height + 1.5 * margin;
  for (const line of words.flatMap((text) => wrapped(context, text, width - 2 * margin))) {
    context.fillText(line, margin, y);
    y += 1.3 * margin;
  }
}

function wrapped(context: CanvasRenderingContext2D, text: string, width: number): string[] {
  const lines: string[] = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines.at(-1)} ${word}`.trim();
    if (context.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}
