// Colours of distances and of territories.
import { rgb } from "d3-color";
import {
  interpolateCividis,
  interpolateMagma,
  interpolateTurbo,
  interpolateViridis,
} from "d3-scale-chromatic";
import type { Palette } from "../state/state";

export type Rgb = [number, number, number];

const SIZE = 256;

const COLOURS: Record<Palette, (share: number) => Rgb> = {
  teal: tealAt,
  viridis: (t: number) => parsed(interpolateViridis(t)),
  magma: (t: number) => parsed(interpolateMagma(t)),
  cividis: (t: number) => parsed(interpolateCividis(t)),
  turbo: (t: number) => parsed(interpolateTurbo(t)),
};

/** Return the colours of a palette, from the nearest to the farthest. */
export function ramp(palette: Palette): readonly Rgb[] {
  return Array.from({ length: SIZE }, (_, i) => COLOURS[palette](i / (SIZE - 1)));
}

function parsed(text: string): Rgb {
  const { r, g, b } = rgb(text);
  return [r / 255, g / 255, b / 255];
}

/**
 * Return a colour between dark indigo, teal and light yellow. Perceived lightness (OKLab) grows evenly:
 * equal steps of distance look equal, and every kind of colour vision sees their order.
 */
function tealAt(t: number): Rgb {
  const chroma = 0.115 + 0.03 * Math.cos(2 * Math.PI * t); // as much as sRGB allows along the way
  return fromOklch(0.28 + 0.65 * t, chroma, ((300 - 200 * t) * Math.PI) / 180);
}

/** Convert OKLCh to sRGB by the matrices of its definition. */
function fromOklch(lightness: number, chroma: number, hue: number): Rgb {
  const [a, b] = [chroma * Math.cos(hue), chroma * Math.sin(hue)];
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const linear = [
    4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
    -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s,
  ];
  return linear.map((x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055)) as Rgb;
}

/** The colours of Okabe and Ito, which colour-blind people can tell apart; without black. */
const TERRITORIES: readonly Rgb[] = [
  [0.902, 0.624, 0.0],
  [0.337, 0.706, 0.914],
  [0.0, 0.62, 0.451],
  [0.941, 0.894, 0.259],
  [0.0, 0.447, 0.698],
  [0.835, 0.369, 0.0],
  [0.8, 0.475, 0.655],
];

/** How many colours territories have. */
export const HUES = TERRITORIES.length;

export function territory(index: number): Rgb {
  return TERRITORIES[index % TERRITORIES.length]!;
}

export function css(colour: Rgb): string {
  return `rgb(${colour.map((x) => Math.round(255 * x)).join(" ")})`;
}
