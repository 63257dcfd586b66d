/**
 * One scale for SNR: viridis, which is even to the eye and safe for the colour-blind, cut at its
 * darkest so that it differs from a dark ground.
 */

export const SNR_LOW = 5;
export const SNR_HIGH = 40;

const STOPS: [number, string][] = [
  [0.0, "#443983"],
  [0.2, "#31688e"],
  [0.4, "#21918c"],
  [0.6, "#35b779"],
  [0.8, "#90d743"],
  [1.0, "#fde725"],
];

export function snrColour(snrDb: number): string {
  const part = Math.min(1, Math.max(0, (snrDb - SNR_LOW) / (SNR_HIGH - SNR_LOW)));
  let at = 0;
  while (at < STOPS.length - 2 && part > STOPS[at + 1]![0]) at += 1;
  const [low, from] = STOPS[at]!;
  const [high, to] = STOPS[at + 1]!;
  return mix(from, to, (part - low) / (high - low));
}

/** The same as a MapLibre expression on a number. */
export function snrExpression(value: unknown): unknown {
  const stops = STOPS.flatMap(([part, colour]) => [SNR_LOW + part * (SNR_HIGH - SNR_LOW), colour]);
  return ["interpolate", ["linear"], value, ...stops];
}

export function gradient(): string[] {
  return STOPS.map(([part, colour]) => `${colour} ${part * 100}%`);
}

function mix(from: string, to: string, part: number): string {
  const parts = [1, 3, 5].map((place) => {
    const a = parseInt(from.slice(place, place + 2), 16);
    const b = parseInt(to.slice(place, place + 2), 16);
    return Math.round(a + (b - a) * part);
  });
  return `rgb(${parts.join(",")})`;
}

/**
 * Lines of different tags: Okabe and Ito's, with a dark brown for their yellow, which is too pale
 * on white; lighter ones of the same hues on a dark ground, where their blue has a contrast of 3
 * only. A test computes that the colour-blind can distinguish them.
 */
const TAG_COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#481800", "#56b4e9"];
const TAG_COLOURS_DARK = ["#4fb0ee", "#f5854a", "#33c79b", "#e5a0c8", "#f0bd3a", "#b3c7ff"];

export function tagColour(order: number): string {
  const colours = document.documentElement.dataset.theme === "dark" ? TAG_COLOURS_DARK : TAG_COLOURS;
  return colours[((order % colours.length) + colours.length) % colours.length]!;
}
