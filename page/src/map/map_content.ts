/** What of the flight is on the map at all: for both kinds of map. */

import { BASE } from "../shared/api";
import type { LonLat } from "../shared/geo";
import type { Track } from "../shared/vehicle_track";
import { isPlaced, store } from "../store";
import type { BearingRecord, FleetRecord, PositionRecord } from "../types";

/** Roses and wedges of older turns than these are left to the layer of positions. */
const TURNS_SHOWN = 6;
/** Such a sector shows only that the drone turned. */
const WIDE_DEG = 300;

/** Bearings of the last turns, and positions, of the tags that are not hidden. */
export function bearingsShown(): [BearingRecord[], PositionRecord[]] {
  const bearings = store.bearings.filter((one) => !store.hidden.has(one.tag_id) && one.start_time_ns <= store.until);
  const turns = [...new Set(bearings.map((one) => one.turn))].sort((a, b) => b - a).slice(0, TURNS_SHOWN);
  const positions = store.placed().filter((one) => !store.hidden.has(one.tag_id));
  return [bearings.filter((one) => turns.includes(one.turn)), positions];
}

/** Whether a bearing's sector is worth drawing. */
export function isTelling(one: BearingRecord): boolean {
  if (!one.interval90_deg) return false;
  const [low, high] = one.interval90_deg;
  return (high - low >= 360 ? 360 : (((high - low) % 360) + 360) % 360) < WIDE_DEG;
}

/** Where the drone is, or was at the replay's time. */
export function herePlace(): { at: LonLat; heading: number } | null {
  const { track, pose, review, until } = store;
  if (!review) {
    return pose && { at: [pose.longitude_deg, pose.latitude_deg], heading: pose.heading_deg };
  }
  let at = track.count - 1;
  while (at > 0 && track.time[at]! > until) at -= 1;
  if (at < 0) return null;
  return { at: [track.lon[at]!, track.lat[at]!], heading: track.yaw[at]! };
}

/** The way flown up to a time, of about `most` points. */
export function lineFlown(track: Track, most: number, until = Infinity): LonLat[] {
  const line: LonLat[] = [];
  const step = Math.max(1, Math.floor(track.count / most));
  for (let place = 0; place < track.count && track.time[place]! <= until; place += step) line.push([track.lon[place]!, track.lat[place]!]);
  return line;
}

/** Places that the whole flight covers, with the regions of its positions. */
export function placesOf(): LonLat[] {
  const places: LonLat[] = [];
  const [lat, lon] = [store.pulses.get("lat"), store.pulses.get("lon")];
  const step = Math.max(1, Math.floor(store.pulses.count / 3000));
  for (let place = 0; place < store.pulses.count; place += step) {
    if (Number.isFinite(lat[place]!)) places.push([lon[place]!, lat[place]!]);
  }
  for (let place = 0; place < store.track.count; place += 20) {
    places.push([store.track.lon[place]!, store.track.lat[place]!]);
  }
  for (const one of store.positions) {
    places.push([one.longitude_deg, one.latitude_deg]);
    const ends = isPlaced(one) ? one.region95.flat() : [];
    places.push(...ends);
  }
  for (const one of store.marks()) places.push([one.longitude_deg, one.latitude_deg]);
  const here = herePlace();
  if (here) places.push(here.at);
  return places;
}

/** Room for the boxes over the map, as much as a map of this size has. */
export function paddingIn(width: number, height: number): { top: number; left: number; right: number; bottom: number } {
  const below = store.review ? 150 : 110;
  return { top: Math.min(190, height * 0.32), left: width * 0.09, right: width * 0.14, bottom: Math.min(below, height * 0.28) };
}

/** Names what must be in the view: another name sets the view again. */
export function frameKey(): string {
  return `${store.flightId() ?? "none"}:${store.placed().map((one) => one.tag_id).join()}`;
}

/** The other vehicles whose place is known. */
export function othersPlaced(): (FleetRecord & { pose: NonNullable<FleetRecord["pose"]> })[] {
  const fleet = store.state?.fleet ?? [];
  return fleet.filter((one): one is FleetRecord & { pose: NonNullable<FleetRecord["pose"]> } => one.page !== `${BASE}/` && one.pose !== null);
}
