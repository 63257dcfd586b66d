/** The map: whatever file the user has below it, or none, and everything of the flight on it. */

import {
  GeoJSONSource,
  Map as MapLibre,
  Marker,
  NavigationControl,
  ScaleControl,
  addProtocol,
  setWorkerUrl,
  type LngLatBounds,
  type StyleSpecification,
} from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?worker&url";
import { PMTiles, Protocol } from "pmtiles";
import { snrColour, snrExpression, tagColour } from "./colour";
import { h, svg } from "./dom";
import { type LonLat, destination, distanceM, wedge } from "./geo";
import { Graticule } from "./graticule";
import { vectorLayers } from "./basemap";
import { Pace } from "./pace";
import { store } from "./store";
import type { BearingRecord, MapFile, PositionRecord } from "./types";

type Feature = GeoJSON.Feature;

/** Above this many, pulses are drawn in clusters: one for each cell of the screen. */
const CLUSTER_FROM = 4000;
/** Size of a cell below zoom 15, where a circle stands for several pulses, and from there on. */
const CELL_PX = 14;
const FINE_CELL_PX = 4;
const FINE_ZOOM = 15;
/** Pulses newer than the last clustering, drawn one by one. */
const RECENT = 1500;
const RAY_M = 900;
const ROSE_PX = 116;
const FULL_RATIO = Math.min(window.devicePixelRatio, 2);

setWorkerUrl(workerUrl);

const EMPTY: GeoJSON.FeatureCollection = { type: "FeatureCollection", features: [] };

export interface Layers {
  track: boolean;
  pulses: boolean;
  rose: boolean;
  bearings: boolean;
  regions: boolean;
  strength: boolean;
}

export class MapView {
  readonly map: MapLibre;
  readonly layers: Layers = {
    track: true,
    pulses: true,
    rose: true,
    bearings: true,
    regions: true,
    strength: false,
  };
  private ready = false;
  private clustered = 0;
  private drawn: { bounds: LngLatBounds; zoom: number } | null = null;
  private markers: Marker[] = [];
  private drone: Marker;
  private droneShown = false;
  private framed: string | null = null;
  private basemap: MapFile | null = null;
  private graticule: Graticule;
  private heat = document.createElement("canvas");
  follow = true;

  constructor(container: HTMLElement) {
    const protocol = new Protocol();
    addProtocol("pmtiles", protocol.tile);
    this.map = new MapLibre({
      container,
      style: blank(),
      center: [0, 20],
      zoom: 1.2,
      attributionControl: false,
      dragRotate: true,
      fadeDuration: 0,
      maxPitch: 0,
      pixelRatio: FULL_RATIO,
    });
    new Pace(this.map, FULL_RATIO);
    this.map.addControl(new NavigationControl({ showZoom: true, showCompass: true }), "top-right");
    this.map.addControl(new ScaleControl({ maxWidth: 140, unit: "metric" }), "bottom-left");
    this.drone = new Marker({ element: droneElement(), rotationAlignment: "map" });
    this.graticule = new Graticule(this.map, container);
    this.map.on("load", () => this.addLayers());
    this.map.on("dragstart", () => {
      this.follow = false;
      container.dispatchEvent(new CustomEvent("follow"));
    });
    this.map.getCanvas().setAttribute("aria-label", "Map of the flight");
  }

  /** Redraw everything that depends on the pulses. */
  drawPulses(all: boolean): void {
    if (!this.ready) return;
    const count = store.shown();
    // Before the clusters: they are made for the view.
    this.frame();
    if (all || count < this.clustered) this.clustered = 0;
    if (count >= CLUSTER_FROM && (this.clustered === 0 || count - this.clustered > RECENT)) {
      this.clustered = count;
      this.drawClusters();
    } else if (this.clustered === 0) this.source("bulk").setData(EMPTY);
    this.source("pulses").setData(pulseFeatures(this.clustered, count));
    this.drawStrongest(count);
  }

  /** Draw the many pulses around the view as one for each cell, with count and best SNR. */
  private drawClusters(): void {
    if (this.clustered === 0) return;
    const zoom = this.map.getZoom();
    const size = zoom >= FINE_ZOOM ? FINE_CELL_PX : CELL_PX;
    const bounds = this.map.getBounds();
    this.drawn = { bounds, zoom };
    this.source("bulk").setData(clusterFeatures(this.clustered, bounds, zoom, size));
  }

  /** Whether the view is still within what was drawn around it, at about its zoom. */
  private drawnHolds(): boolean {
    const drawn = this.drawn;
    if (!drawn || Math.abs(drawn.zoom - this.map.getZoom()) > 0.3) return false;
    const [was, is] = [drawn.bounds, this.map.getBounds()];
    const [wide, high] = [was.getEast() - was.getWest(), was.getNorth() - was.getSouth()];
    return (
      is.getWest() > was.getWest() - wide &&
      is.getEast() < was.getEast() + wide &&
      is.getSouth() > was.getSouth() - high &&
      is.getNorth() < was.getNorth() + high
    );
  }

  drawTrack(): void {
    if (!this.ready) return;
    const { track, until } = store;
    const line: LonLat[] = [];
    const step = Math.max(1, Math.floor(track.count / 6000));
    for (let place = 0; place < track.count; place += step) {
      if (track.time[place]! > until) break;
      line.push([track.lon[place]!, track.lat[place]!]);
    }
    const here = this.place();
    if (here) line.push(here.at);
    this.source("track").setData({
      type: "Feature",
      properties: {},
      geometry: { type: "LineString", coordinates: line },
    });
    if (here) {
      this.drone.setLngLat(here.at).setRotation(here.heading);
      if (!this.droneShown) this.drone.addTo(this.map);
      this.droneShown = true;
      this.frame();
      const inside = this.map.getBounds().contains(here.at);
      if (this.follow && this.framed && !inside) this.map.panTo(here.at, { duration: 300 });
    } else if (this.droneShown) {
      this.drone.remove();
      this.droneShown = false;
    }
  }

  drawEstimates(): void {
    if (!this.ready) return;
    const shown = (id: number) => !store.hidden.has(id);
    const bearings = store.bearings.filter(
      (one) => shown(one.tag_id) && one.start_time_ns <= store.until,
    );
    // In a replay, a position stands only when all its turns have been flown.
    const last = Math.max(...store.bearings.map((one) => one.end_time_ns), 0);
    // One bearing gives a wedge, not a place.
    const placed = store.positions.filter((one) => one.stations > 1 && shown(one.tag_id));
    const positions = store.until >= last ? placed : [];
    this.source("wedges").setData(collection(bearings.flatMap((one) => wedgeOf(one, positions))));
    this.source("rays").setData(collection(bearings.map((one) => rayOf(one, positions))));
    this.source("regions").setData(collection(positions.flatMap(regionsOf)));
    this.drawHeat(positions.find((one) => one.tag_id === store.selected) ?? null);
    for (const marker of this.markers) marker.remove();
    this.markers = [];
    if (this.layers.rose) {
      for (const one of bearings) {
        if (one.tag_id === store.selected) this.mark(roseElement(one), stationOf(one));
      }
    }
    if (this.layers.regions) {
      for (const one of positions) {
        this.mark(fixElement(one), [one.longitude_deg, one.latitude_deg], "bottom");
      }
    }
  }

  setLayer(name: keyof Layers, visible: boolean): void {
    this.layers[name] = visible;
    const ids: Record<keyof Layers, string[]> = {
      track: ["track"],
      pulses: ["bulk", "pulses"],
      rose: [],
      bearings: ["wedges", "rays"],
      regions: ["regions", "heat"],
      strength: ["strength", "strongest"],
    };
    for (const id of ids[name]) {
      if (this.map.getLayer(id)) {
        this.map.setLayoutProperty(id, "visibility", visible ? "visible" : "none");
      }
    }
    this.drawEstimates();
  }

  /** Lay a map file below, or none. */
  async setBasemap(file: MapFile | null): Promise<void> {
    this.basemap = file;
    if (!this.ready) return;
    for (const layer of this.map.getStyle().layers) {
      if (layer.id.startsWith("base-")) this.map.removeLayer(layer.id);
    }
    if (this.map.getSource("base")) this.map.removeSource("base");
    if (file === null || file.fault) return;
    const range = { minzoom: file.min_zoom ?? 0, maxzoom: file.max_zoom ?? 14 };
    const place = `${location.origin}/maps/${encodeURIComponent(file.name)}`;
    const where =
      file.format === "pmtiles"
        ? { url: `pmtiles://${place}` }
        : { tiles: [`${place}/{z}/{x}/{y}`], bounds: file.bounds, ...range };
    if (file.tiles === "mvt") {
      let names: string[] | null = null;
      if (file.format === "pmtiles") {
        const facts = (await new PMTiles(place).getMetadata()) as { vector_layers?: { id: string }[] };
        names = facts.vector_layers?.map((one) => one.id) ?? null;
      }
      this.map.addSource("base", { type: "vector", ...where });
      for (const layer of vectorLayers(names, dark())) this.map.addLayer(layer, "graticule");
    } else {
      this.map.addSource("base", { type: "raster", tileSize: 256, ...where });
      this.map.addLayer({ id: "base-raster", type: "raster", source: "base" }, "graticule");
    }
  }

  recolour(): void {
    if (!this.ready) return;
    this.map.setPaintProperty("background", "background-color", ground());
    this.map.setPaintProperty("graticule", "line-color", dark() ? "#4a5a63" : "#b9c4c9");
    this.map.setPaintProperty("track", "line-color", dark() ? "#cfd8dc" : "#37474f");
    void this.setBasemap(this.basemap);
  }

  /** Show the whole flight. */
  fit(): void {
    const places: LonLat[] = [];
    const [lat, lon] = [store.pulses.get("lat"), store.pulses.get("lon")];
    const step = Math.max(1, Math.floor(store.pulses.count / 3000));
    for (let place = 0; place < store.pulses.count; place += step) {
      if (Number.isFinite(lat[place]!)) places.push([lon[place]!, lat[place]!]);
    }
    for (let place = 0; place < store.track.count; place += 20) {
      places.push([store.track.lon[place]!, store.track.lat[place]!]);
    }
    for (const one of store.positions) places.push([one.longitude_deg, one.latitude_deg]);
    const here = this.place();
    if (here) places.push(here.at);
    if (!places.length) return;
    const lons = places.map((one) => one[0]);
    const lats = places.map((one) => one[1]);
    this.map.fitBounds(
      [
        [min(lons), min(lats)],
        [max(lons), max(lats)],
      ],
      // The box with the coordinates covers the top.
      { padding: { top: 165, left: 60, right: 95, bottom: 55 }, maxZoom: 18, duration: 0 },
    );
  }

  private frame(): void {
    const id = store.flightId() ?? "none";
    if (this.framed === id || (!store.pulses.count && !this.place())) return;
    this.framed = id;
    this.fit();
  }

  private place(): { at: LonLat; heading: number } | null {
    const { track, pose, review, until } = store;
    if (!review) {
      return pose && { at: [pose.longitude_deg, pose.latitude_deg], heading: pose.heading_deg };
    }
    let at = track.count - 1;
    while (at > 0 && track.time[at]! > until) at -= 1;
    if (at < 0) return null;
    return { at: [track.lon[at]!, track.lat[at]!], heading: track.yaw[at]! };
  }

  private source(id: string): GeoJSONSource {
    return this.map.getSource(id) as GeoJSONSource;
  }

  private mark(element: HTMLElement, at: LonLat, anchor: "center" | "bottom" = "center"): void {
    this.markers.push(new Marker({ element, anchor }).setLngLat(at).addTo(this.map));
  }

  private drawStrongest(count: number): void {
    const [lat, lon, snr, tag] = (["lat", "lon", "snr", "tag"] as const).map((name) =>
      store.pulses.get(name),
    ) as [Float64Array, Float64Array, Float64Array, Float64Array];
    let best = -1;
    for (let place = 0; place < count; place += 1) {
      if (tag[place] !== store.selected || !Number.isFinite(lat[place]!)) continue;
      if (best < 0 || snr[place]! > snr[best]!) best = place;
    }
    const features: Feature[] = best < 0 ? [] : [point([lon[best]!, lat[best]!], { label: "strongest signal" })];
    this.source("strongest").setData(collection(features));
  }

  private drawHeat(position: PositionRecord | null): void {
    if (this.map.getLayer("heat")) this.map.removeLayer("heat");
    if (this.map.getSource("heat")) this.map.removeSource("heat");
    const heat = position?.heat;
    if (!heat || !this.layers.regions) return;
    const bytes = Uint8Array.from(atob(heat.values), (letter) => letter.charCodeAt(0));
    this.heat.width = heat.width;
    this.heat.height = heat.height;
    const context = this.heat.getContext("2d")!;
    const image = context.createImageData(heat.width, heat.height);
    const [red, green, blue] = rgb(tagColour(store.tagOrder(position.tag_id)));
    bytes.forEach((value, place) => image.data.set([red, green, blue, value * 0.55], place * 4));
    context.putImageData(image, 0, 0);
    this.map.addSource("heat", {
      type: "canvas",
      canvas: this.heat,
      coordinates: heat.corners,
      animate: false,
    });
    this.map.addLayer(
      { id: "heat", type: "raster", source: "heat", paint: { "raster-fade-duration": 0 } },
      "track",
    );
  }

  private addLayers(): void {
    const map = this.map;
    for (const id of ["track", "pulses", "bulk", "wedges", "rays", "regions", "strongest"]) {
      map.addSource(id, { type: "geojson", data: EMPTY });
    }
    map.on("moveend", () => {
      if (!this.drawnHolds()) this.drawClusters();
    });
    this.graticule.addTo();
    map.addLayer({
      id: "strength",
      type: "heatmap",
      source: "pulses",
      layout: { visibility: "none" },
      paint: {
        "heatmap-weight": ["interpolate", ["linear"], ["get", "snr"], 5, 0.02, 40, 1],
        "heatmap-radius": 42,
        "heatmap-opacity": 0.6,
      },
    });
    map.addLayer({
      id: "wedges",
      type: "fill",
      source: "wedges",
      paint: { "fill-color": ["get", "colour"], "fill-opacity": ["get", "opacity"] },
    });
    map.addLayer({
      id: "track",
      type: "line",
      source: "track",
      layout: { "line-join": "round" },
      paint: { "line-color": dark() ? "#cfd8dc" : "#37474f", "line-width": 1.6, "line-opacity": 0.75 },
    });
    const circle = {
      "circle-color": snrExpression(["get", "snr"]) as never,
      "circle-stroke-width": 0.8,
      "circle-stroke-color": "#1c272c",
    };
    map.addLayer({
      id: "bulk",
      type: "circle",
      source: "bulk",
      paint: {
        ...circle,
        "circle-radius": ["interpolate", ["linear"], ["log10", ["get", "count"]], 0, 3, 3, 10],
      },
    });
    map.addLayer({
      id: "pulses",
      type: "circle",
      source: "pulses",
      paint: { ...circle, "circle-radius": ["interpolate", ["linear"], ["zoom"], 12, 3, 18, 6] },
    });
    map.addLayer({
      id: "rays",
      type: "line",
      source: "rays",
      paint: {
        "line-color": ["get", "colour"],
        "line-width": 2.4,
        "line-dasharray": ["case", ["get", "sure"], ["literal", [1, 0]], ["literal", [2, 2]]],
      },
    });
    map.addLayer({
      id: "regions",
      type: "line",
      source: "regions",
      paint: {
        "line-color": ["get", "colour"],
        "line-width": ["case", ["==", ["get", "share"], 50], 2.6, 1.6],
      },
    });
    map.addLayer({
      id: "strongest",
      type: "symbol",
      source: "strongest",
      layout: {
        visibility: "none",
        "text-field": ["get", "label"],
        "text-size": 13,
        "text-offset": [0, 1.2],
        "text-font": ["sans-serif"],
      },
      paint: { "text-color": "#111", "text-halo-color": "#fff", "text-halo-width": 1.6 },
    });
    this.ready = true;
    void this.setBasemap(this.basemap);
    this.drawPulses(true);
    this.drawTrack();
    this.drawEstimates();
  }
}

function blank(): StyleSpecification {
  return {
    version: 8,
    sources: {},
    layers: [{ id: "background", type: "background", paint: { "background-color": ground() } }],
  };
}

export function dark(): boolean {
  return document.documentElement.dataset.theme === "dark";
}

function ground(): string {
  return dark() ? "#1b2429" : "#eef2f3";
}

function pulseFeatures(from: number, to: number): GeoJSON.FeatureCollection {
  const [lat, lon, snr, tag] = (["lat", "lon", "snr", "tag"] as const).map((name) =>
    store.pulses.get(name),
  ) as [Float64Array, Float64Array, Float64Array, Float64Array];
  const features: Feature[] = [];
  for (let place = from; place < to; place += 1) {
    if (!Number.isFinite(lat[place]!) || store.hidden.has(tag[place]!)) continue;
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
function clusterFeatures(count: number, bounds: LngLatBounds, zoom: number, cellPx: number): GeoJSON.FeatureCollection {
  const [lat, lon, snr, tag] = (["lat", "lon", "snr", "tag"] as const).map((name) =>
    store.pulses.get(name),
  ) as [Float64Array, Float64Array, Float64Array, Float64Array];
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
  for (let place = 0; place < count; place += 1) {
    const column = Math.floor((lon[place]! - west + wide) / lonStep);
    const row = Math.floor((lat[place]! - south + high) / latStep);
    if (!(column >= 0 && column < columns && row >= 0 && row < rows)) continue;
    if (hidden?.has(tag[place]!)) continue;
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

function point(coordinates: LonLat, properties: Record<string, unknown>): Feature {
  return { type: "Feature", properties, geometry: { type: "Point", coordinates } };
}

function collection(features: Feature[]): GeoJSON.FeatureCollection {
  return { type: "FeatureCollection", features };
}

function stationOf(one: BearingRecord): LonLat {
  return [one.longitude_deg, one.latitude_deg];
}

/** Rays reach a little beyond the position where there is one. */
function reach(one: BearingRecord, positions: PositionRecord[]): number {
  const fix = positions.find((position) => position.tag_id === one.tag_id);
  if (!fix || fix.stations < 2) return RAY_M;
  return Math.max(80, 1.35 * distanceM(stationOf(one), [fix.longitude_deg, fix.latitude_deg]));
}

function wedgeOf(one: BearingRecord, positions: PositionRecord[]): Feature[] {
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

function rayOf(one: BearingRecord, positions: PositionRecord[]): Feature {
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

function regionsOf(one: PositionRecord): Feature[] {
  const colour = tagColour(store.tagOrder(one.tag_id));
  return ([50, 95] as const).map((share) => ({
    type: "Feature",
    properties: { colour, share },
    geometry: {
      type: "MultiLineString",
      coordinates: share === 50 ? one.region50 : one.region95,
    },
  }));
}

function droneElement(): HTMLElement {
  const shape = svg(
    "svg",
    { viewBox: "-16 -16 32 32", width: 34, height: 34, role: "img", "aria-label": "Drone" },
    svg("path", { d: "M0 -13 L9 11 L0 6 L-9 11 Z", class: "drone-shape" }),
  );
  const element = h("div", { class: "drone-marker" });
  element.appendChild(shape);
  return element;
}

/** The pulse rose: for each sixteenth of the turn, the strongest pulse heard there. */
function roseElement(one: BearingRecord): HTMLElement {
  const heard = one.rose_snr_db.filter((value): value is number => value !== null);
  const top = max(heard);
  const low = Math.min(min(heard), top - 6);
  const half = ROSE_PX / 2;
  const shapes: SVGElement[] = [svg("circle", { r: half - 1, class: "rose-rim" })];
  one.rose_snr_db.forEach((value, sector) => {
    if (value === null) return;
    const radius = (half - 3) * (0.25 + (0.75 * (value - low)) / (top - low));
    const middle = (sector * 2 * Math.PI) / one.rose_snr_db.length;
    const wide = Math.PI / one.rose_snr_db.length;
    const at = (angle: number) => `${radius * Math.sin(angle)} ${-radius * Math.cos(angle)}`;
    const path = `M0 0L${at(middle - wide)}A${radius} ${radius} 0 0 1 ${at(middle + wide)}Z`;
    shapes.push(svg("path", { d: path, fill: snrColour(value), class: "rose-petal" }));
  });
  const label = `Pulse rose of turn ${one.turn + 1}, bearing ${Math.round(one.bearing_deg)} degrees`;
  const element = h("div", { class: "rose", role: "img", "aria-label": label });
  element.appendChild(
    svg("svg", { viewBox: `${-half} ${-half} ${ROSE_PX} ${ROSE_PX}`, width: ROSE_PX, height: ROSE_PX }, ...shapes),
  );
  return element;
}

function fixElement(one: PositionRecord): HTMLElement {
  const element = h("div", { class: "fix" }, h("span", { class: "fix-name" }, store.tagName(one.tag_id)));
  const pin = svg(
    "svg",
    { viewBox: "-9 -20 18 21", width: 18, height: 21, "aria-hidden": "true" },
    svg("path", { d: "M0 0C-8 -9 -8 -19 0 -19S8 -9 0 0Z", fill: tagColour(store.tagOrder(one.tag_id)), class: "fix-pin" }),
  );
  element.appendChild(pin);
  return element;
}

function rgb(colour: string): [number, number, number] {
  return [1, 3, 5].map((place) => parseInt(colour.slice(place, place + 2), 16)) as [number, number, number];
}

function min(values: number[]): number {
  return values.reduce((a, b) => Math.min(a, b), Infinity);
}

function max(values: number[]): number {
  return values.reduce((a, b) => Math.max(a, b), -Infinity);
}
