/** Where the drone was, in columns. */

import type { PoseRecord } from "../types";

export interface Track {
  time: Float64Array;
  lat: Float64Array;
  lon: Float64Array;
  height: Float64Array;
  yaw: Float64Array;
  count: number;
}

export function emptyTrack(): Track {
  const cells = () => new Float64Array(256);
  return { time: cells(), lat: cells(), lon: cells(), height: cells(), yaw: cells(), count: 0 };
}

/** Largest number of poses requested: three a second for a flight of two hours. */
export const MOST_POSES = 20_000;
export const POSE_NAMES = ["time_ns", "latitude_deg", "longitude_deg", "altitude_relative_m", "yaw_deg"] as const;

export function trackFrom(cells: Float64Array[]): Track {
  const [time, lat, lon, height, yaw] = cells as [Float64Array, Float64Array, Float64Array, Float64Array, Float64Array];
  return { time, lat, lon, height, yaw, count: time.length };
}

export function extend(track: Track, pose: PoseRecord): void {
  if (track.count >= track.time.length) {
    const size = Math.max(256, track.time.length * 2);
    for (const name of ["time", "lat", "lon", "height", "yaw"] as const) {
      const grown = new Float64Array(size);
      grown.set(track[name]);
      track[name] = grown;
    }
  }
  track.time[track.count] = pose.time_ns;
  track.lat[track.count] = pose.latitude_deg;
  track.lon[track.count] = pose.longitude_deg;
  track.height[track.count] = pose.altitude_relative_m;
  track.yaw[track.count] = pose.heading_deg;
  track.count += 1;
}
