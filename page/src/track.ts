/** Where the drone was, in columns. */

import type { PoseRecord } from "./types";

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

export function trackFrom(buffer: ArrayBuffer, columnCount: number): Track {
  const cells = new Float64Array(buffer);
  const count = cells.length / columnCount;
  const at = (place: number) => cells.slice(place * count, (place + 1) * count);
  const [w, x, y, z] = [at(4), at(5), at(6), at(7)];
  const yaw = Float64Array.from(
    w,
    (value, place) =>
      (Math.atan2(
        2 * (value * z[place]! + x[place]! * y[place]!),
        1 - 2 * (y[place]! ** 2 + z[place]! ** 2),
      ) *
        180) /
      Math.PI,
  );
  return { time: at(0), lat: at(1), lon: at(2), height: at(3), yaw, count };
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
