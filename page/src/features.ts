/** What of a flight is drawn on the map, as GeoJSON. */

import type { LngLatBounds } from "maplibre-gl";
import { tagColour } from "./colour";
import { type LonLat, destination, distanceM, wedge } from "./geo";
import { store } from "./store";
import type { BearingRecord, PositionRecord } from "./types";

export type Feature = GeoJSON.Feature;

const RAY_M = 900;
const GROWN = 1.15;
const COLUMNS = ["lat", "lon", "snr", "tag", "height"] as const;
type Five = [Float64Array, Float64Array, Float64Array, Float64Array, Float64Array];
/** Pulses in a row whose mean is the strongest signal, as in the report: one alone is luck. */
const IN_A_ROW = 6;

export function pulseFeatures(from: number, to: number): GeoJSON.FeatureCollection {
  const [lat, lon, snr, tag, height] = COLUMNS.map((name) => store.pulses.get(name)) as Five;
  const features: Feature[] = [];
  for (let place = from; place < to; place += 1) {
    if (!Number.isFinite(lat[place]!) || store.hidden.has(tag[place]!)) continue;
    if (!store.within(height[place]!)) continue;
    const value = snr[place]!;
    features.push(point([lon[place]!, lat[place]!], { snr: Number.isFinite(value) ? value : 0 }));
  }
  return collection(features);
}

/**
 * The best of each cell of the screen, in a view three times as wide and high: what a pan of one
 * screen shows is there already. Bounded by the screen, not by the flight: 100 000 pulses take
 * one pass over typed arrays.
 */
export function clusterFeatures(count: number, bounds: LngLatBounds, zoom: number, cellPx: number): GeoJSON.FeatureCollection {
  const [lat, lon, snr, tag, height] = COLUMNS.map((name) => store.pulses.get(name)) as Five;
  const [west, south, east, north] = [bounds.getWest(), bounds.getSouth(), bounds.getEast(), bounds.getNorth()];
  const [wide, high] = [east - west, north - south];
  const lonStep = (cellPx * 360) / (512 * 2 ** zoom);
  const latStep = lonStep * Math.cos((((south + north) / 2) * Math.PI) / 180);
  const columns = Math.ceil((3 * wide) / lonStep) + 1;
  const rows = Math.ceil((3 * high) / latStep) + 1;
  const best = new Int32Array(columns * rows).fill(-1);
  const counts = new Uint32Array(columns * rows);
  const cells: number[] = [];
  const hidden = store.hidden.size > 0 ? store.hidden : null;
  const layer = store.heights !== null;
  for (let place = 0; place < count; place += 1) {
    const column = Math.floor((lon[place]! - west + wide) / lonStep);
    const row = Math.floor((lat[place]! - south + high) / latStep);
    if (!(column >= 0 && column < columns && row >= 0 && row < rows)) continue;
    if (hidden?.has(tag[place]!) || (layer && !store.within(height[place]!))) continue;
    const cell = row * columns + column;
    if (counts[cell] === 0) cells.push(cell);
    counts[cell]! += 1;
    if (best[cell]! < 0 || snr[place]! > snr[best[cell]!]!) best[cell] = place;
  }
  const features: Feature[] = [];
  for (const cell of cells) {
    const place = best[cell]!;
    const value = snr[place]!;
    const properties = { snr: Number.isFinite(value) ? value : 0, count: counts[cell]! };
    features.push(point([lon[place]!, lat[place]!], properties));
  }
  return collection(features);
}

export function point(coordinates: LonLat, properties: Record<string, unknown>): Feature {
  return { type: "Feature", properties, geometry: { type: "Point", coordinates } };
}

/** A line, or nothing where it has no length. */
export function lineOf(coordinates: LonLat[]): GeoJSON.FeatureCollection {
  const geometry: GeoJSON.LineString = { type: "LineString", coordinates };
  return collection(coordinates.length > 1 ? [{ type: "Feature", properties: {}, geometry }] : []);
}

export function collection(features: Feature[]): GeoJSON.FeatureCollection {
  return { type: "FeatureCollection", features };
}

export function stationOf(one: BearingRecord): LonLat {
  return [one.longitude_deg, one.latitude_deg];
}

/** Rays reach a little beyond the position where there is one. */
export function reach(one: BearingRecord, positions: PositionRecord[]): number {
  const fix = positions.find((position) => position.tag_id === one.tag_id);
  if (!fix || fix.stations < 2) return RAY_M;
  return Math.max(80, 1.35 * distanceM(stationOf(one), [fix.longitude_deg, fix.latitude_deg]));
}

export function wedgeOf(one: BearingRecord, positions: PositionRecord[]): Feature[] {
  if (!one.interval90_deg) return [];
  const ring = wedge(stationOf(one), ...one.interval90_deg, reach(one, positions));
  const chosen = one.tag_id === store.selected;
  return [
    {
      type: "Feature",
      properties: {
        colour: tagColour(store.tagOrder(one.tag_id)),
        opacity: (chosen ? 0.22 : 0.08) * (one.accepted ? 1 : 0.5),
      },
      geometry: { type: "Polygon", coordinates: [ring] },
    },
  ];
}

export function rayOf(one: BearingRecord, positions: PositionRecord[]): Feature {
  const start = stationOf(one);
  return {
    type: "Feature",
    properties: {
      colour: tagColour(store.tagOrder(one.tag_id)),
      sure: one.accepted && !one.ambiguous,
    },
    geometry: {
      type: "LineString",
      coordinates: [start, destination(start, one.bearing_deg, reach(one, positions))],
    },
  };
}

export function regionsOf(one: PositionRecord): Feature[] {
  const colour = tagColour(store.tagOrder(one.tag_id));
  const regions: Feature[] = ([50, 95] as const).map((share) => ({
    type: "Feature",
    properties: { colour, share },
    geometry: {
      type: "MultiLineString",
      coordinates: share === 50 ? one.region50 : one.region95,
    },
  }));
  const now = store.radiusNow(one);
  if (now !== null && one.radius95_m !== null && now > GROWN * one.radius95_m) {
    // Where it may be by now: a circle, dashed.
    const centre: LonLat = [one.longitude_deg, one.latitude_deg];
    const ring = Array.from({ length: 73 }, (_, step) => destination(centre, step * 5, now));
    regions.push({ type: "Feature", properties: { colour, share: 0 }, geometry: { type: "MultiLineString", coordinates: [ring] } });
  }
  return regions;
}

/** Where a tag was strongest, six pulses in a row averaged, as far as the replay goes. */
export function strongestSignal(id: number): LonLat | null {
  const [lat, lon, snr, tag, height] = COLUMNS.map((name) => store.pulses.get(name)) as Five;
  const mine: number[] = [];
  for (let place = 0; place < store.shown(); place += 1) {
    if (tag[place] !== id || !Number.isFinite(lat[place]!) || !Number.isFinite(snr[place]!)) continue;
    if (store.within(height[place]!)) mine.push(place);
  }
  const row = Math.min(IN_A_ROW, mine.length);
  let [best, most, sum] = [-1, -Infinity, 0];
  mine.forEach((place, number) => {
    sum += snr[place]! - (number >= row ? snr[mine[number - row]!]! : 0);
    if (number >= row - 1 && sum > most) [best, most] = [mine[number - (row >> 1)]!, sum];
  });
  return best < 0 ? null : [lon[best]!, lat[best]!];
}
