/** Pulses of one flight in columns: 100 000 of them are 12 MB, not 100 000 objects. */

import { yawOf } from "./geo";
import type { PulseRecord } from "../types";

const COLUMNS = ["tag", "time", "frequency", "snr", "status", "rate", "lat", "lon", "height", "yaw", "also", "ghost", "clipped"] as const;
export type Column = (typeof COLUMNS)[number];

/** What the server calls them, in the same order. */
export const PULSE_NAMES = [
  "tag_id",
  "start_time_ns",
  "frequency_hz",
  "snr_db",
  "detection_status",
  "rate",
  "latitude_deg",
  "longitude_deg",
  "altitude_relative_m",
  "yaw_deg",
  "also_possible_tag_id",
  "ghost_of_tag_id",
  "clipped",
] as const;

export class Pulses {
  count = 0;
  private capacity = 1024;
  private columns: Record<Column, Float64Array>;
  /** What is here, by tag and time; made when the first pulse is added. */
  private seen: Map<number, Set<number>> | null = null;

  constructor() {
    this.columns = Object.fromEntries(
      COLUMNS.map((name) => [name, new Float64Array(this.capacity)]),
    ) as Record<Column, Float64Array>;
  }

  /** One column; only the first `count` values mean something. */
  get(column: Column): Float64Array {
    return this.columns[column];
  }

  /** Take the server's columns, in order of time. */
  static from(cells: Float64Array[]): Pulses {
    const pulses = new Pulses();
    const order = sortedOrder(cells[COLUMNS.indexOf("time")]!);
    COLUMNS.forEach((name, column) => {
      const source = cells[column]!;
      pulses.columns[name] = order === null ? source : Float64Array.from(order, (place) => source[place]!);
    });
    pulses.count = pulses.capacity = cells[0]!.length;
    return pulses;
  }

  /** Take a pulse; false when it was here before. */
  add(record: PulseRecord): boolean {
    if (!this.remember(record.tag_id, record.start_time_ns)) return false;
    this.reserve(this.count + 1);
    const q = record.quaternion_wxyz;
    const values: Record<Column, number | null> = {
      tag: record.tag_id,
      time: record.start_time_ns,
      frequency: record.frequency_hz,
      snr: record.snr_db,
      status: ["subthreshold", "detected", "confirmed"].indexOf(record.detection_status),
      rate: record.rate,
      lat: record.latitude_deg,
      lon: record.longitude_deg,
      height: record.altitude_relative_m,
      yaw: q === null ? null : yawOf(...q),
      also: record.also_possible_tag_ids[0] ?? null,
      ghost: record.ghost_of_tag_id,
      clipped: Number(record.clipped),
    };
    for (const name of COLUMNS) this.columns[name][this.count] = values[name] ?? NaN;
    this.count += 1;
    return true;
  }

  /** Say whose else a burst may be; false when it is not here. */
  doubt(tag: number, time: number, also: number): boolean {
    const { tag: tags, time: times } = this.columns;
    for (let place = this.count - 1; place >= 0; place -= 1) {
      if (tags[place] !== tag || times[place] !== time) continue;
      this.columns.also[place] = also;
      return true;
    }
    return false;
  }

  private remember(tag: number, time: number): boolean {
    const seen = (this.seen ??= this.known());
    let times = seen.get(tag);
    if (times === undefined) seen.set(tag, (times = new Set()));
    if (times.has(time)) return false;
    times.add(time);
    return true;
  }

  private known(): Map<number, Set<number>> {
    const { tag, time } = this.columns;
    const seen = new Map<number, Set<number>>();
    for (let place = 0; place < this.count; place += 1) {
      const times = seen.get(tag[place]!);
      if (times) times.add(time[place]!);
      else seen.set(tag[place]!, new Set([time[place]!]));
    }
    return seen;
  }

  private reserve(count: number): void {
    if (count <= this.capacity) return;
    this.capacity = Math.max(count, this.capacity * 2);
    for (const name of COLUMNS) {
      const grown = new Float64Array(this.capacity);
      grown.set(this.columns[name].subarray(0, this.count));
      this.columns[name] = grown;
    }
  }
}

/** Order of rising times, or null when they rise already. */
function sortedOrder(time: Float64Array): Uint32Array | null {
  let rising = true;
  for (let place = 1; place < time.length && rising; place += 1) {
    rising = time[place]! >= time[place - 1]!;
  }
  if (rising) return null;
  return Uint32Array.from(time.keys()).sort((a, b) => time[a]! - time[b]!);
}
