/** The waterfall of a channel: of recorded samples, or live where the channel's datagrams come. */

import { get, reasonOf, send } from "../shared/api";
import { by, h, say } from "../shared/dom";
import { clock } from "../shared/format";
import { t, verbatim } from "../shared/i18n";
import { store } from "../store";
import type { WaterfallRecord } from "../types";

/** Seconds of a live waterfall that are kept on the screen. */
const LIVE_S = 60;
const STRETCH_S = 60;

const INFERNO: [number, number, number][] = [
  [0, 0, 4], [40, 11, 84], [101, 21, 110], [159, 42, 99], [212, 72, 66], [245, 125, 21], [250, 193, 39], [252, 255, 164],
];
const PALETTE = Array.from({ length: 256 }, (_, value) => {
  const at = (value / 255) * (INFERNO.length - 1);
  const low = Math.min(INFERNO.length - 2, Math.floor(at));
  return [0, 1, 2].map((part) => INFERNO[low]![part]! + (INFERNO[low + 1]![part]! - INFERNO[low]![part]!) * (at - low));
});

let shown = false;
let stretches: WaterfallRecord[] = [];
let live = false;
let start = 0;
let asked = "";

export function waterfallFigure(): HTMLElement {
  const address = h("input", {
    id: "waterfall-address",
    value: "udp://127.0.0.1:20000",
    "aria-label": t("waterfall.address"),
    size: "22",
  });
  store.on(["waterfall"], takeLive);
  store.on(["reset", "selection"], () => {
    if (!live) void loadRecorded();
  });
  return h(
    "figure",
    { class: "plot waterfall" },
    h(
      "figcaption",
      { class: "toolbar" },
      h("span", { id: "waterfall-title" }, t("waterfall.title")),
      h("button", { id: "waterfall-back", class: "format", "aria-label": t("waterfall.earlier"), onclick: () => void step(-1) }, verbatim("◀")),
      h("button", { id: "waterfall-on", class: "format", "aria-label": t("common.later"), onclick: () => void step(1) }, verbatim("▶")),
      address,
      h("button", { id: "waterfall-live", class: "format", "aria-pressed": "false", onclick: () => void toggleLive() }, t("waterfall.live")),
    ),
    h("canvas", { id: "waterfall", role: "img", "aria-label": t("waterfall.label") }),
    h("p", { id: "waterfall-note", class: "note" }),
  );
}

export function showWaterfall(visible: boolean): void {
  shown = visible;
  if (visible && !live) void loadRecorded();
  else draw();
}

async function toggleLive(): Promise<void> {
  const wanted = live ? "" : (by("waterfall-address") as HTMLInputElement).value;
  try {
    const answer = await send<{ address: string | null }>("POST", "/waterfall", { address: wanted });
    live = answer.address !== null;
    asked = ""; // what was recorded is not waited for any longer
    stretches = [];
    store.waterfall = [];
    say(by("waterfall-note"), live ? t("waterfall.waiting", { address: verbatim(answer.address!) }) : "");
    by("waterfall-live").setAttribute("aria-pressed", String(live));
    if (!live) await loadRecorded();
    draw();
  } catch (error) {
    say(by("waterfall-note"), reasonOf(error));
  }
}

function takeLive(): void {
  if (!live) return;
  stretches.push(...store.waterfall.splice(0));
  const newest = stretches.at(-1)?.start_time_ns ?? 0;
  stretches = stretches.filter((one) => one.start_time_ns > newest - LIVE_S * 1e9);
  say(by("waterfall-note"), t("waterfall.live_note"));
  draw();
}

async function step(by: number): Promise<void> {
  start = Math.max(0, start + by * STRETCH_S);
  asked = "";
  await loadRecorded();
}

async function loadRecorded(): Promise<void> {
  if (!shown) return;
  const flight = store.flightId();
  const key = `${flight}/${store.selected}/${start}`;
  if (key === asked) return;
  if (!asked.startsWith(`${flight}/`)) start = asked ? 0 : start;
  asked = `${flight}/${store.selected}/${start}`;
  const mine = asked;
  stretches = [];
  const note = by("waterfall-note");
  try {
    const there = flight === null ? [] : await get<string[]>(`/flights/${encodeURIComponent(flight)}/recordings`);
    if (mine !== asked) return;
    if (!there.length) {
      say(note, t("waterfall.no_samples"));
    } else if (store.selected !== null) {
      say(note, t("waterfall.reading"));
      const query = `tag=${store.selected}&start_s=${start}&length_s=${STRETCH_S}`;
      const found = await get<WaterfallRecord>(`/flights/${encodeURIComponent(flight!)}/waterfall?${query}`);
      if (mine !== asked) return;
      stretches = [found];
      say(note, t("waterfall.recorded_note"));
    }
  } catch (error) {
    if (mine === asked) say(note, reasonOf(error));
  }
  draw();
}

function draw(): void {
  if (!shown) return;
  const canvas = by("waterfall") as HTMLCanvasElement;
  const box = canvas.getBoundingClientRect();
  const [wide, high] = [Math.max(50, Math.round(box.width)), Math.max(40, Math.round(box.height))];
  if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
  const context = canvas.getContext("2d")!;
  context.fillStyle = "#000004";
  context.fillRect(0, 0, wide, high);
  by("waterfall-back").hidden = live;
  by("waterfall-on").hidden = live;
  const first = stretches[0];
  const last = stretches.at(-1);
  canvas.dataset.columns = String(stretches.reduce((sum, one) => sum + one.columns, 0));
  if (!first || !last) return;
  const lengthOf = (one: WaterfallRecord) => one.columns * one.column_s * 1e9;
  const end = last.start_time_ns + lengthOf(last);
  const begin = live ? end - LIVE_S * 1e9 : first.start_time_ns;
  const x = (timeNs: number) => ((timeNs - begin) / (end - begin)) * wide;
  context.imageSmoothingEnabled = false;
  for (const one of stretches) {
    const from = x(one.start_time_ns);
    context.drawImage(bitmap(one), from, 0, x(one.start_time_ns + lengthOf(one)) - from + 0.5, high);
  }
  label(context, wide, high, first, begin, end);
}

/** One pixel a cell; rows from the highest frequency down. */
function bitmap(one: WaterfallRecord): HTMLCanvasElement {
  const bytes = Uint8Array.from(atob(one.values), (letter) => letter.charCodeAt(0));
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [one.columns, one.rows];
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(one.columns, one.rows);
  for (let column = 0; column < one.columns; column += 1) {
    for (let row = 0; row < one.rows; row += 1) {
      const place = ((one.rows - 1 - row) * one.columns + column) * 4;
      image.data.set([...PALETTE[bytes[column * one.rows + row]!]!, 255], place);
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

function label(context: CanvasRenderingContext2D, wide: number, high: number, one: WaterfallRecord, begin: number, end: number): void {
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = "#ffffff";
  context.shadowColor = "#000000";
  context.shadowBlur = 3;
  const hertz = (value: number) => `${value > 0 ? "+" : ""}${Math.round(value)}\u202fHz`;
  context.fillText(hertz(one.high_hz), 4, 12);
  context.fillText(hertz((one.high_hz + one.low_hz) / 2), 4, high / 2 + 4);
  context.fillText(hertz(one.low_hz), 4, high - 16);
  context.textAlign = "center";
  for (const part of [0.25, 0.5, 0.75]) {
    context.fillText(clock(begin + part * (end - begin)), part * wide, high - 4);
  }
  context.textAlign = "left";
  context.shadowBlur = 0;
}

