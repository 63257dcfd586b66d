/** What a map of the flight can do, whichever draws it. */

import type { LonLat } from "./geo";
import type { Layers } from "./maplayers";
import type { MapFile } from "./types";

export interface Tap {
  at: LonLat;
  x: number;
  y: number;
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
  drawMarks(): void;
  setMe(at: LonLat | null): void;
  setMeasure(line: LonLat[]): void;
  setLayer(name: keyof Layers, visible: boolean): void;
  setBasemap(file: MapFile | null): Promise<void>;
}
