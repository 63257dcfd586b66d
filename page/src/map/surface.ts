/**
 * The strength of one tag over the ground, in the colours of its pulses: a mean around each
 * place. It is brightest at the strongest signal, which is not where the tag is.
 */

import type { CanvasSource, Map as MapLibre } from "maplibre-gl";
import { snrColour } from "../shared/colour";
import type { LonLat } from "../shared/geo";
import { store } from "../store";

const CELLS = 90;
/** Of the flight's extent: lines a fifth of it apart leave no gap between them. */
const REACH = 9;
const MARGIN = 3;
/** Within about two cells, pulses count alike. */
const SMOOTH = 4;
const LEAST_CELL_M = 2;
const M_PER_DEG = 111_195;
/** Drawn at most so often while pulses come [ms]. */
const PAUSE_MS = 1000;
/** Heights are split at gaps of this size, and layers above 15 m every 10 m. */
const GAP_M = 5;
const LAYER_M = 10;

export type Heights = [number, number];

/**
 * The layers of height in which pulses were heard, lowest first; the server's
 * `height_bands` in uavrt/localization/position/levels/strongest.py parts them in the same way.
 */
export function heightBands(heights: Float64Array): Heights[] {
  const ordered = heights.filter(Number.isFinite).sort();
  const bands: Heights[] = [];
  let first = 0;
  for (let place = 1; place <= ordered.length; place += 1) {
    if (place < ordered.length && ordered[place]! - ordered[place - 1]! <= GAP_M) continue;
    const [low, high] = [ordered[first]!, ordered[place - 1]!];
    const layers = high - low <= 1.5 * LAYER_M ? 1 : Math.ceil((high - low) / LAYER_M);
    for (let layer = 0; layer < layers; layer += 1) {
      const step = (high - low) / layers;
      const top = layer === layers - 1 ? high + 1e-6 : low + step * (layer + 1);
      bands.push([low + step * layer, top]);
    }
    first = place;
  }
  return bands;
}

interface Surface {
  width: number;
  height: number;
  /** North row first; NaN where nothing was heard around. */
  values: Float32Array;
  corners: [LonLat, LonLat, LonLat, LonLat];
}

/** Mean SNR around each place of a grid over all pulses of a tag that are shown. */
function surfaceOf(id: number): Surface | null {
  const { tag, snr, lat, lon, height } = columns();
  const places: number[] = [];
  for (let place = 0; place < store.shown(); place += 1) {
    const known = tag[place] === id && Number.isFinite(lat[place]!) && Number.isFinite(snr[place]!);
    if (known && store.within(height[place]!)) places.push(place);
  }
  if (places.length < 4) return null;
  let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const place of places) {
    west = Math.min(west, lon[place]!);
    east = Math.max(east, lon[place]!);
    south = Math.min(south, lat[place]!);
    north = Math.max(north, lat[place]!);
  }
  const perLon = M_PER_DEG * Math.cos((((south + north) / 2) * Math.PI) / 180);
  const extent = Math.max((east - west) * perLon, (north - south) * M_PER_DEG);
  const cell = Math.max(LEAST_CELL_M, extent / CELLS);
  const [stepLon, stepLat] = [cell / perLon, cell / M_PER_DEG];
  const width = Math.ceil((east - west) / stepLon) + 2 * MARGIN + 1;
  const rows = Math.ceil((north - south) / stepLat) + 2 * MARGIN + 1;
  const [left, top] = [west - (MARGIN + 0.5) * stepLon, north + (MARGIN + 0.5) * stepLat];
  // First into cells: what is spread is bounded by the screen, not by the flight.
  const sums = new Float32Array(width * rows);
  const counts = new Float32Array(width * rows);
  for (const place of places) {
    const at = Math.floor((top - lat[place]!) / stepLat) * width + Math.floor((lon[place]! - left) / stepLon);
    sums[at]! += snr[place]!;
    counts[at]! += 1;
  }
  const [right, bottom] = [left + width * stepLon, top - rows * stepLat];
  return {
    width,
    height: rows,
    values: spread(sums, counts, width),
    corners: [
      [left, top],
      [right, top],
      [right, bottom],
      [left, bottom],
    ],
  };
}

/** Mean around each cell, what is nearer counting more; NaN where nothing is within reach. */
function spread(sums: Float32Array, counts: Float32Array, width: number): Float32Array {
  const rows = counts.length / width;
  const total = new Float32Array(counts.length);
  const weight = new Float32Array(counts.length);
  counts.forEach((count, from) => {
    if (count === 0) return;
    const [column, row] = [from % width, Math.floor(from / width)];
    for (let y = Math.max(0, row - REACH); y <= Math.min(rows - 1, row + REACH); y += 1) {
      for (let x = Math.max(0, column - REACH); x <= Math.min(width - 1, column + REACH); x += 1) {
        const off = (x - column) ** 2 + (y - row) ** 2;
        if (off > REACH * REACH) continue;
        const share = 1 / (off + SMOOTH) ** 2;
        total[y * width + x]! += share * sums[from]!;
        weight[y * width + x]! += share * count;
      }
    }
  });
  return total.map((value, place) => (weight[place]! > 0 ? value / weight[place]! : NaN));
}

function columns(): Record<"tag" | "snr" | "lat" | "lon" | "height", Float64Array> {
  const of = (name: "tag" | "snr" | "lat" | "lon" | "height") => store.pulses.get(name);
  return { tag: of("tag"), snr: of("snr"), lat: of("lat"), lon: of("lon"), height: of("height") };
}

/** The layer of the map that shows it. */
export class StrengthLayer {
  visible = false;
  private canvas = document.createElement("canvas");
  private drawnMs = 0;
  private due: number | undefined;

  constructor(private map: MapLibre) {}

  /** Draw it now, or soon if it was drawn a moment ago. */
  draw(atOnce: boolean): void {
    const wait = atOnce ? 0 : this.drawnMs + PAUSE_MS - performance.now();
    clearTimeout(this.due);
    if (wait > 0) this.due = window.setTimeout(() => this.draw(true), wait);
    else this.drawNow();
  }

  private drawNow(): void {
    this.drawnMs = performance.now();
    if (this.map.getLayer("strength")) this.map.removeLayer("strength");
    if (this.map.getSource("strength")) this.map.removeSource("strength");
    const surface = this.visible && store.selected !== null ? surfaceOf(store.selected) : null;
    if (surface === null) return;
    this.canvas.width = surface.width;
    this.canvas.height = surface.height;
    const context = this.canvas.getContext("2d")!;
    const image = context.createImageData(surface.width, surface.height);
    surface.values.forEach((value, place) => {
      if (Number.isNaN(value)) return;
      const [red, green, blue] = snrColour(value).match(/\d+/g)!.map(Number);
      image.data.set([red!, green!, blue!, 170], place * 4);
    });
    context.putImageData(image, 0, 0);
    this.map.addSource("strength", {
      type: "canvas",
      canvas: this.canvas,
      coordinates: surface.corners,
      animate: false,
    } as Parameters<MapLibre["addSource"]>[1] & Partial<CanvasSource>);
    const below = this.map.getLayer("wedges") ? "wedges" : undefined;
    this.map.addLayer({ id: "strength", type: "raster", source: "strength", paint: { "raster-fade-duration": 0 } }, below);
  }
}
