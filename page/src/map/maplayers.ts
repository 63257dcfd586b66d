/** Layers of the map, from the ground upwards, and their colours. */

import type { LayerSpecification, Map as MapLibre, StyleSpecification } from "maplibre-gl";
import { snrExpression } from "../shared/colour";

export function blank(): StyleSpecification {
  return {
    version: 8,
    sources: {},
    layers: [{ id: "background", type: "background", paint: { "background-color": ground() } }],
  };
}

export function dark(): boolean {
  return document.documentElement.dataset.theme === "dark";
}

export function ground(): string {
  return dark() ? "#1b2429" : "#eef2f3";
}

/** A map that is not seen, for example, is not waited for longer. */
export const WARM_MS = 1500;
const properties = { snr: 10, count: 2, colour: "#888888", opacity: 0.1, sure: false, share: 50 };
const line: GeoJSON.Feature = {
  type: "Feature",
  properties,
  geometry: { type: "LineString", coordinates: [[170, -60], [171, -61]] },
};
const point: GeoJSON.Feature = { type: "Feature", properties, geometry: { type: "Point", coordinates: [170, -60] } };
/**
 * Something of each kind, beyond the edge of the first view: the programs of the graphics are
 * made while the page opens, which without a graphics processor takes as long as to draw a
 * flight of 100 000 pulses.
 */
export const WARM: Record<string, GeoJSON.Feature> = {
  track: line,
  rays: line,
  regions: line,
  bulk: point,
  pulses: point,
  wedges: {
    type: "Feature",
    properties,
    geometry: { type: "Polygon", coordinates: [[[170, -60], [171, -60], [171, -61], [170, -60]]] },
  },
};

/** What can be shown and hidden. */
export interface Layers {
  track: boolean;
  pulses: boolean;
  rose: boolean;
  bearings: boolean;
  regions: boolean;
  strength: boolean;
  hindsight: boolean;
}

export const AT_FIRST: Layers = {
  track: true,
  pulses: true,
  rose: true,
  bearings: true,
  regions: true,
  strength: false,
  hindsight: true,
};

type Drawn = "fill" | "line" | "circle";
type Paint<T extends Drawn> = Extract<LayerSpecification, { type: T }>["paint"];

/** Lay the layers of a flight over what is there; their sources must exist. */
export function addFlightLayers(map: MapLibre): void {
  const add = <T extends Drawn>(type: T, id: string, paint: Paint<T>, more: { source?: string; filter?: never; layout?: object } = {}) =>
    map.addLayer({ id, type, source: id, paint, ...more } as LayerSpecification);
  const colour = ["get", "colour"] as never;
  const round = { "line-join": "round" };
  add("fill", "wedges", { "fill-color": colour, "fill-opacity": ["get", "opacity"] });
  add("line", "track", { "line-color": dark() ? "#cfd8dc" : "#37474f", "line-width": 1.6, "line-opacity": 0.75 }, { layout: round });
  const circle = {
    "circle-color": snrExpression(["get", "snr"]) as never,
    "circle-stroke-width": 0.8,
    "circle-stroke-color": "#1c272c",
  };
  add("circle", "bulk", { ...circle, "circle-radius": ["interpolate", ["linear"], ["log10", ["get", "count"]], 0, 3, 3, 10] });
  add("circle", "pulses", { ...circle, "circle-radius": ["interpolate", ["linear"], ["zoom"], 12, 3, 18, 6] });
  add("line", "rays", {
    "line-color": colour,
    "line-width": 2.4,
    "line-dasharray": ["case", ["get", "sure"], ["literal", [1, 0]], ["literal", [2, 2]]],
  });
  add("line", "regions", {
    "line-color": colour,
    "line-width": ["case", ["==", ["get", "share"], 50], 2.6, 1.6],
    "line-dasharray": ["case", ["==", ["get", "share"], 0], ["literal", [2, 3]], ["literal", [1, 0]]],
  });
  map.addLayer({
    id: "strongest",
    type: "symbol",
    source: "strongest",
    layout: {
      visibility: "none",
      "text-field": ["concat", "×\n", ["get", "label"]],
      "text-size": 14,
      "text-line-height": 1,
      "text-anchor": "top",
      "text-offset": [0, -0.55],
      "text-font": ["sans-serif"],
    },
    paint: { "text-color": "#111", "text-halo-color": "#fff", "text-halo-width": 1.6 },
  });
  const parts = (source: string, ...names: string[]) => ({ source, filter: ["in", ["get", "part"], ["literal", names]] as never });
  add("line", "hindsight-circle", { "line-color": colour, "line-width": 2, "line-dasharray": [4, 2, 1, 2] }, parts("hindsight", "circle"));
  add("circle", "hindsight-pulse", { "circle-radius": 5, "circle-color": "rgba(0,0,0,0)", "circle-stroke-width": 1.8, "circle-stroke-color": colour }, parts("hindsight", "pulse"));
  add("circle", "hindsight-place", { "circle-radius": 7, "circle-color": colour, "circle-stroke-width": 3, "circle-stroke-color": "#ffffff" }, parts("hindsight", "place"));
  add("line", "other-track", { "line-color": "#b5179e", "line-width": 1.8, "line-dasharray": [3, 2] }, { layout: round });
  add("line", "other-regions", { "line-color": colour, "line-width": 1.6, "line-dasharray": [2, 2] });
  add("circle", "other-fixes", { "circle-radius": 6, "circle-color": "#ffffff", "circle-stroke-width": 3, "circle-stroke-color": colour });
  const part = ["match", ["get", "part"], "keep", "#c62828", "area", "#7b1fa2", "corner", "#7b1fa2", "#00838f"] as never;
  add("fill", "motion-fill", { "fill-color": part, "fill-opacity": 0.1 }, parts("motion", "keep", "area"));
  add("line", "motion-line", { "line-color": part, "line-width": 2, "line-dasharray": [3, 2] }, parts("motion", "keep", "area"));
  add("line", "motion-way", { "line-color": part, "line-width": 3 }, { ...parts("motion", "way"), layout: round });
  add("circle", "motion-dots", { "circle-color": part, "circle-radius": 6, "circle-stroke-width": 2, "circle-stroke-color": "#ffffff" }, parts("motion", "corner", "end"));
  add("line", "measure", { "line-color": "#b5179e", "line-width": 2.5, "line-dasharray": [3, 2] });
}
