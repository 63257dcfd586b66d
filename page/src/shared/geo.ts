/** Directions and distances over a few kilometres. */

import { t, type Words } from "./i18n";

const EARTH_M = 6_371_008.8;

export type LonLat = [number, number];

export function destination([lon, lat]: LonLat, bearingDeg: number, distanceM: number): LonLat {
  const angle = (bearingDeg * Math.PI) / 180;
  const reach = distanceM / EARTH_M;
  const start = (lat * Math.PI) / 180;
  const end = Math.asin(
    Math.sin(start) * Math.cos(reach) + Math.cos(start) * Math.sin(reach) * Math.cos(angle),
  );
  const turned = Math.atan2(
    Math.sin(angle) * Math.sin(reach) * Math.cos(start),
    Math.cos(reach) - Math.sin(start) * Math.sin(end),
  );
  return [lon + (turned * 180) / Math.PI, (end * 180) / Math.PI];
}

export function distanceM(a: LonLat, b: LonLat): number {
  const rad = Math.PI / 180;
  const dLat = (b[1] - a[1]) * rad;
  const dLon = (b[0] - a[0]) * rad;
  const s =
    Math.sin(dLat / 2) ** 2 + Math.cos(a[1] * rad) * Math.cos(b[1] * rad) * Math.sin(dLon / 2) ** 2;
  return 2 * EARTH_M * Math.asin(Math.min(1, Math.sqrt(s)));
}

export function bearingDeg(a: LonLat, b: LonLat): number {
  const rad = Math.PI / 180;
  const dLon = (b[0] - a[0]) * rad;
  const y = Math.sin(dLon) * Math.cos(b[1] * rad);
  const x =
    Math.cos(a[1] * rad) * Math.sin(b[1] * rad) -
    Math.sin(a[1] * rad) * Math.cos(b[1] * rad) * Math.cos(dLon);
  return ((Math.atan2(y, x) / rad) % 360 + 360) % 360;
}

const DIRECTIONS = [
  t("compass.north"),
  t("compass.north_east"),
  t("compass.east"),
  t("compass.south_east"),
  t("compass.south"),
  t("compass.south_west"),
  t("compass.west"),
  t("compass.north_west"),
];

export function compass(deg: number): Words {
  return DIRECTIONS[Math.round(deg / 45) % 8]!;
}

/** A filled wedge: the arc clockwise from one direction to another. */
export function wedge(centre: LonLat, fromDeg: number, toDeg: number, radiusM: number): LonLat[] {
  const sweep = (((toDeg - fromDeg) % 360) + 360) % 360;
  const steps = Math.max(2, Math.ceil(sweep / 4));
  const ring: LonLat[] = [centre];
  for (let step = 0; step <= steps; step += 1) {
    ring.push(destination(centre, fromDeg + (sweep * step) / steps, radiusM));
  }
  ring.push(centre);
  return ring;
}

export function yawOf(w: number, x: number, y: number, z: number): number {
  const yaw = (Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) * 180) / Math.PI;
  return (yaw + 360) % 360;
}
