/** The map: whatever file the user has below it, or none, and everything of the flight on it. */

import {
  AttributionControl,
  GeoJSONSource,
  Map as MapLibre,
  Marker,
  NavigationControl,
  ScaleControl,
  addProtocol,
  setWorkerUrl,
  type LngLatBounds,
} from "maplibre-gl";
import workerUrl from "maplibre-gl/dist/maplibre-gl-worker.mjs?worker&url";
import { PMTiles, Protocol } from "pmtiles";
import { tagColour } from "../shared/colour";
import {
  clusterFeatures,
  collection,
  hindsightFeatures,
  lineOf,
  motionFeatures,
  point,
  pulseFeatures,
  rayOf,
  regionsOf,
  stationOf,
  strongestSignal,
  wedgeOf,
} from "./features";
import type { LonLat } from "../shared/geo";
import { Graticule } from "./graticule";
import { vectorLayers } from "./basemap";
import { t } from "../shared/i18n";
import { droneElement, fixElement, markElement, max, meElement, min, onBoardElement, otherElement, rgb, roseElement } from "./markers";
import { AT_FIRST, type Layers, WARM, WARM_MS, addFlightLayers, blank, dark, ground } from "./maplayers";
import { Pace } from "./smooth_pan";
import { bearingsShown, herePlace, isTelling, lineFlown, othersPlaced, paddingIn, placesOf } from "./map_content";
import { vehicleName } from "../shared/format";
import { isPlaced, store } from "../store";
import { StrengthLayer } from "./surface";
import type { HeardMap, MapFile, PositionRecord } from "../types";
import type { FlightMap, MotionDrawing, Tap } from "./map_view";

/** Above this many, pulses are drawn in clusters: one for each cell of the screen. */
const CLUSTER_FROM = 4000;
/** Size of a cell below zoom 15, where a circle stands for several pulses, and from there on. */
const CELL_PX = 14;
const FINE_CELL_PX = 4;
const FINE_ZOOM = 15;
/** Pulses newer than the last clustering, drawn one by one. */
const RECENT = 1500;
const FULL_RATIO = Math.min(window.devicePixelRatio, 2);

setWorkerUrl(workerUrl);

const SOURCES = [
  ...["measure", "motion"],
  ...["track", "pulses", "bulk", "wedges", "rays", "regions", "strongest"],
  ...["hindsight", "other-track", "other-regions", "other-fixes"],
];
const EMPTY: GeoJSON.FeatureCollection = { type: "FeatureCollection", features: [] };

export class MapView implements FlightMap {
  readonly flat = false;
  onTap: (tap: Tap) => void = () => undefined;
  private me: Marker | null = null;
  private motion: MotionDrawing = { area: [], way: [], keepAway: [], keepOut: [] };
  private heard: HeardMap | null = null;
  private marks: Marker[] = [];
  private attribution: AttributionControl | null = null;
  readonly map: MapLibre;
  readonly layers: Layers = { ...AT_FIRST };
  private ready = false;
  private clustered = 0;
  private drawn: { bounds: LngLatBounds; zoom: number } | null = null;
  private empty = new Set(SOURCES);
  private markers: Marker[] = [];
  private drone: Marker;
  private droneShown = false;
  private others: Marker[] = [];
  private framed: string | null = null;
  private placedIn: string | null = null;
  private basemap: MapFile | null = null;
  private graticule: Graticule;
  private heat = document.createElement("canvas");
  private strength: StrengthLayer;
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
      locale: {
        "NavigationControl.ZoomIn": t("map.zoom_in"),
        "NavigationControl.ZoomOut": t("map.zoom_out"),
        "NavigationControl.ResetBearing": t("map.reset_bearing"),
      },
      dragRotate: true,
      fadeDuration: 0,
      maxPitch: 0,
      pixelRatio: FULL_RATIO,
    });
    new Pace(this.map, FULL_RATIO);
    this.strength = new StrengthLayer(this.map);
    this.map.addControl(new NavigationControl({ showZoom: true, showCompass: true }), "top-right");
    this.map.addControl(new ScaleControl({ maxWidth: 140, unit: "metric" }), "bottom-left");
    this.drone = new Marker({ element: droneElement(), rotationAlignment: "map" });
    this.graticule = new Graticule(this.map, container);
    this.map.on("load", () => this.addLayers());
    this.map.on("dragstart", () => {
      this.follow = false;
      container.dispatchEvent(new CustomEvent("follow"));
    });
    this.map.on("click", (event) => this.onTap({ at: [event.lngLat.lng, event.lngLat.lat], x: event.point.x, y: event.point.y }));
    const canvas = this.map.getCanvas();
    canvas.setAttribute("aria-label", t("common.map_label"));
    canvas.addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      const [at, size] = [this.map.getCenter(), canvas.getBoundingClientRect()];
      this.onTap({ at: [at.lng, at.lat], x: size.width / 2, y: size.height / 2 });
    });
  }

  resize(): void {
    this.map.resize();
  }

  drawMarks(): void {
    for (const marker of this.marks) marker.remove();
    this.marks = store
      .marks()
      .map((one) => new Marker({ element: markElement(one.text), anchor: "bottom" }).setLngLat([one.longitude_deg, one.latitude_deg]).addTo(this.map));
  }

  setMe(at: LonLat | null): void {
    this.me?.remove();
    this.me = at && new Marker({ element: meElement() }).setLngLat(at).addTo(this.map);
  }

  setMeasure(line: LonLat[]): void {
    if (this.ready) this.put("measure", lineOf(line));
  }

  setMotion(drawn: MotionDrawing): void {
    this.motion = drawn;
    if (this.ready) this.put("motion", motionFeatures(drawn));
  }

  drawHindsight(): void {
    if (this.ready) this.put("hindsight", hindsightFeatures());
  }

  setHeard(map: HeardMap | null): void {
    this.heard = map;
    if (!this.ready) return;
    if (this.map.getLayer("heard")) this.map.removeLayer("heard");
    if (this.map.getSource("heard")) this.map.removeSource("heard");
    if (!map) return;
    // By a canvas: what MapLibre loads by itself the page's policy does not let come from data.
    const picture = new Image();
    picture.onload = () => {
      if (this.heard !== map) return;
      const canvas = document.createElement("canvas");
      [canvas.width, canvas.height] = [picture.naturalWidth, picture.naturalHeight];
      canvas.getContext("2d")!.drawImage(picture, 0, 0);
      this.map.addSource("heard", { type: "canvas", canvas, coordinates: map.corners, animate: false });
      this.map.addLayer({ id: "heard", type: "raster", source: "heard", paint: { "raster-fade-duration": 0, "raster-opacity": 0.7, "raster-resampling": "nearest" } }, "wedges");
    };
    picture.src = `data:image/png;base64,${map.picture}`;
  }

  show(places: LonLat[]): void {
    const [lons, lats] = [places.map((one) => one[0]), places.map((one) => one[1])];
    this.map.fitBounds([min(lons), min(lats), max(lons), max(lats)], { padding: this.padding(), maxZoom: 18, duration: 0 });
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
    } else if (this.clustered === 0) this.put("bulk", EMPTY);
    this.put("pulses", pulseFeatures(this.clustered, count));
    this.drawStrongest(all);
  }

  /** Draw the many pulses around the view as one for each cell, with count and best SNR. */
  private drawClusters(): void {
    if (this.clustered === 0) return;
    const zoom = this.map.getZoom();
    const size = zoom >= FINE_ZOOM ? FINE_CELL_PX : CELL_PX;
    const bounds = this.map.getBounds();
    this.drawn = { bounds, zoom };
    this.put("bulk", clusterFeatures(this.clustered, bounds, zoom, size));
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
    const line = lineFlown(store.track, 6000, store.until);
    const here = this.place();
    if (here) line.push(here.at);
    this.put("track", lineOf(line));
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

  /** The other vehicles of this station. */
  drawFleet(): void {
    if (!this.ready) return;
    for (const marker of this.others) marker.remove();
    this.others = othersPlaced().map((one) =>
      new Marker({ element: otherElement(one.pose.heading_deg, vehicleName(one)) })
        .setLngLat([one.pose.longitude_deg, one.pose.latitude_deg])
        .addTo(this.map),
    );
  }

  drawEstimates(): void {
    if (!this.ready) return;
    const [bearings, positions] = bearingsShown();
    this.reframe(positions);
    this.put("wedges", collection(bearings.filter(isTelling).flatMap((one) => wedgeOf(one, positions))));
    this.put("rays", collection(bearings.map((one) => rayOf(one, positions))));
    this.put("regions", collection(positions.flatMap(regionsOf)));
    this.drawHeat(positions.find((one) => one.tag_id === store.selected) ?? null);
    for (const marker of this.markers) marker.remove();
    this.markers = [];
    if (this.layers.rose) {
      for (const one of bearings) {
        if (one.tag_id !== store.selected) continue;
        this.mark(one.from_drone ? onBoardElement(one) : roseElement(one), stationOf(one));
      }
    }
    if (this.layers.regions) {
      for (const one of positions) {
        this.mark(fixElement(one), [one.longitude_deg, one.latitude_deg], "bottom");
      }
    }
  }

  /** The flight that is compared with the one shown: its track, and positions as rings. */
  drawOther(): void {
    if (!this.ready) return;
    const other = store.other;
    const placed = (other?.positions ?? []).filter((one) => isPlaced(one) && !store.hidden.has(one.tag_id));
    this.put("other-track", lineOf(other ? lineFlown(other.track, 3000) : []));
    this.put("other-regions", collection(placed.flatMap(regionsOf)));
    this.put("other-fixes", 
      collection(
        placed.map((one) =>
          point([one.longitude_deg, one.latitude_deg], { colour: tagColour(store.tagOrder(one.tag_id)) }),
        ),
      ),
    );
  }

  setLayer(name: keyof Layers, visible: boolean): void {
    this.layers[name] = visible;
    const ids: Record<keyof Layers, string[]> = {
      track: ["track"],
      pulses: ["bulk", "pulses"],
      rose: [],
      bearings: ["wedges", "rays"],
      regions: ["regions", "heat"],
      strength: ["strongest"],
      hindsight: ["hindsight-circle", "hindsight-pulse", "hindsight-place"],
    };
    for (const id of ids[name]) {
      if (this.map.getLayer(id)) {
        this.map.setLayoutProperty(id, "visibility", visible ? "visible" : "none");
      }
    }
    this.drawEstimates();
    this.strength.visible = this.layers.strength;
    this.strength.draw(true);
  }

  /** Lay a map file below, or none. */
  async setBasemap(file: MapFile | null): Promise<void> {
    this.basemap = file;
    if (!this.ready) return;
    for (const layer of this.map.getStyle().layers) {
      if (layer.id.startsWith("base-")) this.map.removeLayer(layer.id);
    }
    if (this.map.getSource("base")) this.map.removeSource("base");
    if (this.attribution) this.map.removeControl(this.attribution);
    this.attribution = null;
    if (file === null || file.fault) return;
    this.attribution = new AttributionControl({ compact: false, customAttribution: file.attribution ?? file.name });
    this.map.addControl(this.attribution, "bottom-right");
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
    const places = placesOf();
    if (!places.length) return;
    // The box with the coordinates covers the top.
    this.show(places);
  }

  /** Positions come after the pulses: show each tag's, once, unless the map was moved by hand. */
  private reframe(positions: PositionRecord[]): void {
    const id = store.flightId();
    const key = `${id}:${positions.map((one) => one.tag_id).join()}`;
    if (this.framed !== (id ?? "none") || this.placedIn === key || !positions.length || (!store.review && !this.follow)) return;
    this.placedIn = key;
    const view = this.map.getBounds();
    const ends = positions.flatMap((one) => [[one.longitude_deg, one.latitude_deg] as LonLat, ...one.region95.flat()]);
    if (!ends.every((one) => view.contains(one))) this.fit();
  }

  private frame(): void {
    const id = store.flightId() ?? "none";
    if (this.framed === id || (!store.pulses.count && !this.place())) return;
    this.framed = id;
    this.fit();
  }

  private place(): { at: LonLat; heading: number } | null {
    return herePlace();
  }

  private padding(): { top: number; left: number; right: number; bottom: number } {
    const { clientWidth, clientHeight } = this.map.getContainer();
    return paddingIn(clientWidth, clientHeight);
  }

  /** Give a source its data; nothing in place of nothing costs a drawing for nothing. */
  private put(id: string, data: GeoJSON.Feature | GeoJSON.FeatureCollection): void {
    const empty = data.type === "FeatureCollection" && data.features.length === 0;
    if (empty && this.empty.has(id)) return;
    if (empty) this.empty.add(id);
    else this.empty.delete(id);
    (this.map.getSource(id) as GeoJSONSource).setData(data);
  }

  private mark(element: HTMLElement, at: LonLat, anchor: "center" | "bottom" = "center"): void {
    this.markers.push(new Marker({ element, anchor }).setLngLat(at).addTo(this.map));
  }

  private drawStrongest(all: boolean): void {
    const best = store.selected === null ? null : strongestSignal(store.selected);
    const label = t("map.strongest_signal");
    if (this.strength.visible) this.strength.draw(all);
    this.put("strongest", collection(best === null ? [] : [point(best, { label })]));
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
    for (const id of SOURCES) map.addSource(id, { type: "geojson", data: EMPTY });
    map.on("moveend", () => {
      if (!this.drawnHolds()) this.drawClusters();
    });
    this.graticule.addTo();
    addFlightLayers(map);
    for (const [id, feature] of Object.entries(WARM)) this.put(id, feature);
    map.once("idle", () => this.begin());
    setTimeout(() => this.begin(), WARM_MS);
  }

  private begin(): void {
    if (this.ready) return;
    this.ready = true;
    void this.setBasemap(this.basemap);
    this.drawPulses(true);
    this.drawTrack();
    this.drawFleet();
    this.drawEstimates();
    this.drawOther();
    this.drawHindsight();
    this.setHeard(this.heard);
    this.setMotion(this.motion);
  }
}
