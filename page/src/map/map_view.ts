/** What a map of the flight can do, whichever draws it. */

import type { LonLat } from "../shared/geo";
import type { Layers } from "./maplayers";
import type { HeardMap, MapFile } from "../types";

export interface Tap {
  at: LonLat;
  x: number;
  y: number;
}

/** What a motion draws: the area, the way, and where a search keeps away from. */
export interface MotionDrawing {
  area: LonLat[];
  way: LonLat[];
  keepAway: { at: LonLat; radiusM: number }[];
  /** Outlines of people and buildings. */
  keepOut: LonLat[][];
}

export interface FlightMap {
  readonly layers: Layers;
  /** Drawn on a plain canvas. */
  readonly flat: boolean;
  follow: boolean;
  onTap: (tap: Tap) => void;
  resize(): void;
  recolour(): void;
  fit(): void;
  drawPulses(all: boolean): void;
  drawTrack(): void;
  drawEstimates(): void;
  drawOther(): void;
  /** The other vehicles of this station. */
  drawFleet(): void;
  drawMarks(): void;
  setMe(at: LonLat | null): void;
  setMeasure(line: LonLat[]): void;
  setMotion(drawn: MotionDrawing): void;
  /** What a whole flight's samples say. */
  drawHindsight(): void;
  /** Where a tag is heard, below all else; null: nothing. */
  setHeard(map: HeardMap | null): void;
  /** Frame some places. */
  show(places: LonLat[]): void;
  setLayer(name: keyof Layers, visible: boolean): void;
  setBasemap(file: MapFile | null): Promise<void>;
}
