/**
 * What of a flight is drawn on the map, as GeoJSON.
 *
 * Of more than 4000 pulses one is drawn for each cell of the screen, the strongest, as large as
 * their number: the work is bounded by the screen, not by the flight. MapLibre's own clustering
 * makes and indexes 100 000 features at every change of a filter.
 */

import type { LngLatBounds } from "maplibre-gl";
import { tagColour } from "../shared/colour";
import { type LonLat, destination, distanceM, wedge } from "../shared/geo";
import { store } from "../store";
import type { BearingRecord, PositionRecord, Verdict } from "../types";
import type { MotionDrawing } from "./map_view";

export type Feature = GeoJSON.Feature;

const RAY_M = 900;
const GROWN = 1.15;
/** Of a way that are drawn; more hide each other. */
const CIRCLES = 4;
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

function feature(geometry: GeoJSON.Geometry, properties: Record<string, unknown> = {}): Feature {
  return { type: "Feature", properties, geometry };
}

export function point(coordinates: LonLat, properties: Record<string, unknown>): Feature {
  return feature({ type: "Point", coordinates }, properties);
}

/** A line, or nothing where it has no length. */
export function lineOf(coordinates: LonLat[]): GeoJSON.FeatureCollection {
  return collection(coordinates.length > 1 ? [feature({ type: "LineString", coordinates })] : []);
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
  const opacity = (one.tag_id === store.selected ? 0.22 : 0.08) * (one.accepted ? 1 : 0.5);
  return [feature({ type: "Polygon", coordinates: [ring] }, { colour: tagColour(store.tagOrder(one.tag_id)), opacity })];
}

export function rayOf(one: BearingRecord, positions: PositionRecord[]): Feature {
  const start = stationOf(one);
  const coordinates = [start, destination(start, one.bearing_deg, reach(one, positions))];
  const sure = one.accepted && !one.ambiguous;
  return feature({ type: "LineString", coordinates }, { colour: tagColour(store.tagOrder(one.tag_id)), sure });
}

export function regionsOf(one: PositionRecord): Feature[] {
  const colour = tagColour(store.tagOrder(one.tag_id));
  const regions = [linesOf({ colour, share: 50 }, one.region50), linesOf({ colour, share: 95 }, one.region95), ...wayOf(one, colour)];
  const now = store.radiusNow(one);
  if (now !== null && one.radius95_m !== null && now > GROWN * one.radius95_m) {
    // Where it may be by now: a circle, dashed.
    const centre: LonLat = [one.longitude_deg, one.latitude_deg];
    regions.push(linesOf({ colour, share: 0 }, [circle(centre, now)]));
  }
  return regions;
}

/** The way of a tag that moves, and at a few of its times the circle that held it with 95 %. */
function wayOf(one: PositionRecord, colour: string): Feature[] {
  if (one.track.length < 2) return [];
  const places = one.track.map((each): LonLat => [each.longitude_deg, each.latitude_deg]);
  const step = Math.max(1, Math.floor((places.length - 1) / CIRCLES));
  const circles = places.filter((_, number) => number % step === 0).map((each, number) => circle(each, one.track[number * step]!.radius95_m));
  return [linesOf({ colour, share: 50 }, [places]), linesOf({ colour, share: 0 }, circles)];
}

/** A circle of 95 % that is wider is no position. */
const POSITION_M = 2000;

/** Whether a whole flight gives a single place of a tag. */
function isPlace(one: Verdict): boolean {
  return one.found && one.places === 1 && one.latitude_deg !== null && one.longitude_deg !== null && (one.radius95_m ?? Infinity) <= POSITION_M;
}

/** Pulses found after the flight, and the places given by the whole flight: all that it cannot distinguish, and the region of 95 %. */
export function hindsightFeatures(): GeoJSON.FeatureCollection {
  const found = store.hindsight;
  if (!found) return collection([]);
  const features: Feature[] = [];
  for (const one of found.pulses) {
    if (store.hidden.has(one.tag_id) || one.time_ns > store.until) continue;
    features.push(point([one.longitude_deg, one.latitude_deg], { part: "pulse", colour: tagColour(store.tagOrder(one.tag_id)) }));
  }
  for (const one of found.tags) {
    if (!one.found || store.hidden.has(one.tag_id) || Number.isFinite(store.until)) continue;
    const colour = tagColour(store.tagOrder(one.tag_id));
    if (isPlace(one)) {
      const at: LonLat = [one.longitude_deg!, one.latitude_deg!];
      features.push(linesOf({ part: "circle", colour }, [circle(at, one.radius95_m!)]), point(at, { part: "place", colour }));
      continue;
    }
    const rings = one.region95.map((ring) => ring.map(([lat, lon]): LonLat => [lon, lat]));
    if (rings.length) features.push(linesOf({ part: "circle", colour }, rings));
    if (one.places > 1) for (const each of one.parts) features.push(point([each.longitude_deg, each.latitude_deg], { part: "place", colour }));
  }
  return collection(features);
}

/** The area, the way and the keep-away circles of a motion. */
export function motionFeatures(drawn: MotionDrawing): GeoJSON.FeatureCollection {
  const features: Feature[] = [];
  const polygon = (part: string, ring: LonLat[]) => features.push(feature({ type: "Polygon", coordinates: [ring] }, { part }));
  const line = (part: string, coordinates: LonLat[]) => features.push(feature({ type: "LineString", coordinates }, { part }));
  for (const one of drawn.keepAway) polygon("keep", circle(one.at, one.radiusM));
  for (const one of drawn.keepOut) polygon("keep", [...one, one[0]!]);
  if (drawn.area.length > 2) polygon("area", [...drawn.area, drawn.area[0]!]);
  if (drawn.area.length === 2) line("area", drawn.area);
  for (const corner of drawn.area) features.push(point(corner, { part: "corner" }));
  if (drawn.way.length > 1) line("way", drawn.way);
  if (drawn.way.length > 1) features.push(point(drawn.way.at(-1)!, { part: "end" }));
  return collection(features);
}

function circle(centre: LonLat, radius: number): LonLat[] {
  return Array.from({ length: 73 }, (_, step) => destination(centre, step * 5, radius));
}

function linesOf(properties: Record<string, unknown>, coordinates: LonLat[][]): Feature {
  return feature({ type: "MultiLineString", coordinates }, properties);
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
