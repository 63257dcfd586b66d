/** Plots of the selected tag: SNR over heading, over time, intervals, frequency. */

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { getOnceThere } from "../shared/api";
import { snrColour, tagColour } from "../shared/colour";
import { by, fill, h, say, svg } from "../shared/dom";
import { fixed } from "../shared/format";
import { fromServer, listed, t, type Words } from "../shared/i18n";
import { store } from "../store";
import { showWaterfall, waterfallFigure } from "./waterfall";
import type { Choices } from "../types";

const POLAR = 340;
const LOWEST_DB = 0;
const HIGHEST_DB = 45;
const MOST_POLAR = 1500;

let antennas: Choices["antennas"] = {};
let shown = false;
const plots: { kind: string; plot: uPlot; holder: HTMLElement }[] = [];

export function buildPlots(): void {
  fill(
    by("view-plots"),
    h("div", { class: "plot-tags", role: "group", "aria-label": t("common.tag"), id: "plot-tags" }),
    h(
      "div",
      { class: "plots" },
      h(
        "figure",
        { class: "plot polar" },
        h("figcaption", {}, t("plots.snr_by_heading_and_pattern")),
        h("div", { id: "polar" }),
        h("p", { id: "polar-note", class: "note" }),
      ),
      figure("snr", t("plots.snr_over_time")),
      figure("fold", t("plots.interval")),
      figure("frequency", t("plots.frequency_offset")),
      waterfallFigure(),
    ),
  );
  void getOnceThere<Choices>("/choices").then((choices) => {
    antennas = choices.antennas;
    draw();
  });
  store.on(["pulses", "reset", "selection", "estimates", "settings", "tags"], draw);
  const watch = new ResizeObserver(resize);
  for (const id of ["snr", "fold", "frequency"]) watch.observe(by(`plot-${id}`));
}

/** Nothing is drawn while the view is hidden. */
export function showPlots(visible: boolean): void {
  shown = visible;
  if (visible) requestAnimationFrame(draw);
  showWaterfall(visible);
}

function figure(id: string, caption: Words): HTMLElement {
  return h("figure", { class: "plot" }, h("figcaption", {}, caption), h("div", { id: `plot-${id}`, class: "plot-area" }));
}

function draw(): void {
  if (!shown) return;
  drawTags();
  drawPolar();
  drawTimes();
}

function drawTags(): void {
  const rows = store.tagRows();
  fill(
    by("plot-tags"),
    ...rows.map((row) => {
      const id = Number(row.id);
      const dot = h("span", { class: "tag-dot" });
      dot.style.background = tagColour(store.tagOrder(id));
      return h(
        "button",
        { "aria-pressed": String(id === store.selected), translate: "no", onclick: () => store.select(id) },
        dot,
        store.tagName(id),
      );
    }),
  );
}

// ------------------------------------------------------------------- polar

function radiusOf(db: number): number {
  const part = Math.min(1, Math.max(0, (db - LOWEST_DB) / (HIGHEST_DB - LOWEST_DB)));
  return part * (POLAR / 2 - 24);
}

function drawPolar(): void {
  const shapes: SVGElement[] = [];
  for (const db of [10, 20, 30, 40]) {
    shapes.push(svg("circle", { r: radiusOf(db), class: "polar-ring" }));
    const text = svg("text", { x: 3, y: -radiusOf(db) - 2, class: "polar-text" });
    text.textContent = `${db} dB`;
    shapes.push(text);
  }
  for (let angle = 0; angle < 360; angle += 30) {
    const [x, y] = at(angle, HIGHEST_DB);
    shapes.push(svg("line", { x1: 0, y1: 0, x2: x, y2: y, class: "polar-ring" }));
    const text = svg("text", { x: x * 1.08, y: y * 1.08 + 4, class: "polar-text", "text-anchor": "middle" });
    text.textContent = angle === 0 ? "N" : `${angle}°`;
    shapes.push(text);
  }
  const bearing = store.bearings
    .filter((one) => one.tag_id === store.selected && one.start_time_ns <= store.until)
    .at(-1);
  const offset = store.settings?.antenna_offset_deg ?? 0;
  const [from, to] = bearing ? [bearing.start_time_ns - 1e9, bearing.end_time_ns + 1e9] : [0, Infinity];
  let strongest = -Infinity;
  let count = 0;
  const dots: SVGElement[] = [];
  const [tag, time, snr, yaw] = (["tag", "time", "snr", "yaw"] as const).map((name) => store.pulses.get(name)) as [
    Float64Array,
    Float64Array,
    Float64Array,
    Float64Array,
  ];
  for (let place = store.shown() - 1; place >= 0 && count < MOST_POLAR; place -= 1) {
    if (tag[place] !== store.selected || time[place]! < from || time[place]! > to) continue;
    if (!Number.isFinite(yaw[place]!) || !Number.isFinite(snr[place]!)) continue;
    count += 1;
    strongest = Math.max(strongest, snr[place]!);
    const [x, y] = at(yaw[place]! + offset, snr[place]!);
    dots.push(svg("circle", { cx: x, cy: y, r: 4, fill: snrColour(snr[place]!), class: "polar-dot" }));
  }
  const pattern = antennas[store.settings?.antenna ?? ""]?.e_plane_db;
  if (bearing && pattern && count) shapes.push(patternPath(pattern, bearing.bearing_deg, strongest));
  if (bearing) {
    const [x, y] = at(bearing.bearing_deg, HIGHEST_DB);
    shapes.push(svg("line", { x1: 0, y1: 0, x2: x, y2: y, class: "polar-bearing" }));
    if (bearing.interval90_deg) shapes.push(sector(...bearing.interval90_deg));
  }
  const half = POLAR / 2;
  fill(
    by("polar"),
    svg("svg", { viewBox: `${-half} ${-half} ${POLAR} ${POLAR}`, role: "img", "aria-label": t("plots.snr_by_heading") }, ...shapes, ...dots),
  );
  const interval = bearing?.interval90_deg;
  say(
    by("polar-note"),
    bearing
      ? listed(
          t("plots.bearing", { turn: bearing.turn + 1, bearing: fixed(bearing.bearing_deg, 0) }),
          interval && t("plots.interval90", { low: fixed(interval[0], 0), high: fixed(interval[1], 0) }),
          t("common.pulse_count", { pulses: bearing.pulses }),
          bearing.from_drone && t("plots.on_the_drone"),
          ...bearing.remarks.map(fromServer),
        )
      : t("plots.no_turn"),
  );
}

function at(angleDeg: number, db: number): [number, number] {
  const angle = (angleDeg * Math.PI) / 180;
  const radius = radiusOf(db);
  return [radius * Math.sin(angle), -radius * Math.cos(angle)];
}

/** What the antenna would hear at each heading of a tag in the bearing's direction. */
function patternPath(table: number[], bearingDeg: number, topDb: number): SVGElement {
  const step = 180 / (table.length - 1);
  const points: string[] = [];
  for (let heading = 0; heading < 360; heading += 2) {
    const off = Math.abs(((heading - bearingDeg + 540) % 360) - 180);
    const place = Math.min(table.length - 2, Math.floor(off / step));
    const part = off / step - place;
    const gain = table[place]! * (1 - part) + table[place + 1]! * part;
    points.push(at(heading, topDb + gain).map((value) => value.toFixed(1)).join(","));
  }
  return svg("polygon", { points: points.join(" "), class: "polar-pattern" });
}

function sector(from: number, to: number): SVGElement {
  const [x1, y1] = at(from, HIGHEST_DB);
  const [x2, y2] = at(to, HIGHEST_DB);
  const radius = radiusOf(HIGHEST_DB);
  const wide = (((to - from) % 360) + 360) % 360 > 180 ? 1 : 0;
  return svg("path", { d: `M0 0L${x1} ${y1}A${radius} ${radius} 0 ${wide} 1 ${x2} ${y2}Z`, class: "polar-sector" });
}

// ------------------------------------------------------------------- over time

function drawTimes(): void {
  const count = store.shown();
  const [tag, time, snr, frequency] = (["tag", "time", "snr", "frequency"] as const).map((name) =>
    store.pulses.get(name),
  ) as [Float64Array, Float64Array, Float64Array, Float64Array];
  const mine: number[] = [];
  for (let place = 0; place < count; place += 1) if (tag[place] === store.selected) mine.push(place);
  mine.sort((a, b) => time[a]! - time[b]!);
  const seconds = mine.map((place) => time[place]! / 1e9);
  const row = store.tagRows().find((one) => Number(one.id) === store.selected);
  const intervals = mine.map((place, order) => {
    const gap = order ? (time[place]! - time[mine[order - 1]!]!) / 1e6 : null;
    return gap !== null && gap < 6000 ? gap : null;
  });
  const nominal = Number(row?.frequency_mhz ?? NaN) * 1e6;
  const shift = mine.map((place) => (Number.isFinite(nominal) ? frequency[place]! - nominal : frequency[place]!));
  plot("snr", seconds, mine.map((place) => snr[place]!));
  plot("fold", seconds, intervals);
  plot("frequency", seconds, shift);
}

function plot(kind: string, x: number[], y: (number | null)[]): void {
  const holder = by(`plot-${kind}`);
  const data: uPlot.AlignedData = [x, y];
  const known = plots.find((one) => one.kind === kind);
  if (known) {
    known.plot.setData(data);
    return;
  }
  const ink = () => getComputedStyle(document.documentElement).getPropertyValue("--ink").trim();
  const line = () => getComputedStyle(document.documentElement).getPropertyValue("--line").trim();
  const utc = (seconds: number) => new Date(seconds * 1000).toISOString().slice(11, 19);
  const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 } };
  const made = new uPlot(
    {
      width: Math.max(200, holder.clientWidth),
      height: Math.max(110, holder.clientHeight),
      tzDate: (ts) => uPlot.tzDate(new Date(ts * 1e3), "Etc/UTC"),
      legend: { show: false },
      cursor: { drag: { x: true, y: false } },
      scales: { x: { time: true } },
      axes: [
        { ...axis, values: (_: uPlot, ticks: number[]) => ticks.map(utc), space: 80, size: 28 },
        { ...axis, size: 52, space: 18 },
      ],
      series: [
        {},
        {
          paths: () => null,
          points: {
            show: true,
            size: 5,
            stroke: () => tagColour(store.tagOrder(store.selected ?? 0)),
            fill: () => tagColour(store.tagOrder(store.selected ?? 0)),
          },
        },
      ],
    },
    data,
    holder,
  );
  plots.push({ kind, plot: made, holder });
}

function resize(): void {
  for (const { plot: one, holder } of plots) {
    if (holder.clientWidth > 0) {
      one.setSize({ width: holder.clientWidth, height: Math.max(110, holder.clientHeight) });
    }
  }
}

/** The theme has changed: draw the axes again. */
export function recolourPlots(): void {
  for (const { plot: one } of plots) one.redraw(false, true);
}
