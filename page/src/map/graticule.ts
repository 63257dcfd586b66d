/** Lines of latitude and longitude with their numbers: a map where there is no map. */

import type { GeoJSONSource, Map as MapLibre } from "maplibre-gl";
import { h, say } from "../shared/dom";
import { verbatim } from "../shared/i18n";

const STEPS_DEG = [
  30, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001,
];
/** Lines are at least so far apart: their numbers must not touch. */
const LAT_APART_PX = 80;
const LON_APART_PX = 120;

export class Graticule {
  private labels: HTMLElement;
  /** Of the map; read once, because reading it in each frame forces a new layout of the page. */
  private size: { width: number; height: number };
  private drawn: { west: number; east: number; south: number; north: number; zoom: number } | null = null;

  constructor(
    private map: MapLibre,
    container: HTMLElement,
  ) {
    this.labels = h("div", { class: "graticule-labels", "aria-hidden": "true" });
    container.appendChild(this.labels);
    this.size = { width: container.clientWidth, height: container.clientHeight };
    map.on("move", () => this.label());
    map.on("moveend", () => {
      if (!this.holds()) this.draw();
    });
    map.on("resize", () => {
      this.size = { width: container.clientWidth, height: container.clientHeight };
      // A coarser or finer canvas is the same view.
      if (!this.holds()) this.draw();
    });
  }

  addTo(): void {
    this.map.addSource("graticule", {
      type: "geojson",
      data: { type: "FeatureCollection", features: [] },
    });
    this.map.addLayer({
      id: "graticule",
      type: "line",
      source: "graticule",
      paint: {
        "line-color": document.documentElement.dataset.theme === "dark" ? "#4a5a63" : "#b9c4c9",
        "line-width": 0.8,
      },
    });
    this.draw();
  }

  /** Whether the lines that are drawn still reach beyond the view, at about its zoom. */
  private holds(): boolean {
    const drawn = this.drawn;
    const bounds = this.map.getBounds();
    return (
      drawn !== null &&
      Math.abs(drawn.zoom - this.map.getZoom()) < 0.3 &&
      bounds.getWest() >= drawn.west &&
      bounds.getEast() <= drawn.east &&
      bounds.getSouth() >= drawn.south &&
      bounds.getNorth() <= drawn.north
    );
  }

  private lines(area?: { west: number; east: number; south: number; north: number }): {
    lats: number[];
    lons: number[];
    digits: [number, number];
  } {
    const bounds = this.map.getBounds();
    const step = (spanDeg: number, pixels: number, apart: number) =>
      [...STEPS_DEG].reverse().find((one) => (one / spanDeg) * pixels >= apart) ?? STEPS_DEG[0]!;
    const latStep = step(bounds.getNorth() - bounds.getSouth(), this.size.height, LAT_APART_PX);
    const lonStep = step(bounds.getEast() - bounds.getWest(), this.size.width, LON_APART_PX);
    const between = (low: number, high: number, by: number) => {
      const found: number[] = [];
      for (let line = Math.ceil(low / by); line * by <= high && found.length < 90; line += 1) {
        found.push(line * by);
      }
      return found;
    };
    const digits = (by: number) => Math.max(0, Math.ceil(-Math.log10(by) - 1e-9));
    const { west, east, south, north } = area ?? {
      west: bounds.getWest(),
      east: bounds.getEast(),
      south: bounds.getSouth(),
      north: bounds.getNorth(),
    };
    return {
      lats: between(Math.max(-85, south), Math.min(85, north), latStep),
      lons: between(west, east, lonStep),
      digits: [digits(latStep), digits(lonStep)],
    };
  }

  private draw(): void {
    const source = this.map.getSource("graticule") as GeoJSONSource | undefined;
    if (!source) return;
    const bounds = this.map.getBounds();
    const wide = bounds.getEast() - bounds.getWest();
    const high = bounds.getNorth() - bounds.getSouth();
    const [west, east] = [bounds.getWest() - wide, bounds.getEast() + wide];
    const [south, north] = [Math.max(-85, bounds.getSouth() - high), Math.min(85, bounds.getNorth() + high)];
    this.drawn = { west, east, south, north, zoom: this.map.getZoom() };
    const { lats, lons } = this.lines({ west, east, south, north });
    source.setData({
      type: "Feature",
      properties: {},
      geometry: {
        type: "MultiLineString",
        coordinates: [
          ...lats.map((lat) => [
            [west, lat],
            [east, lat],
          ]),
          ...lons.map((lon) => [
            [lon, south],
            [lon, north],
          ]),
        ],
      },
    });
    this.label();
  }

  /** The numbers at the edges: at every frame of a pan, so elements are kept and only moved. */
  private label(): void {
    const texts: [string, string, number, number][] = [];
    if (Math.abs(this.map.getBearing()) <= 1) {
      const { lats, lons, digits } = this.lines();
      const { lng, lat: middle } = this.map.getCenter();
      for (const lat of lats) {
        const y = this.map.project([lng, lat]).y;
        if (y < 180 || y > this.size.height - 44) continue;
        texts.push(["lat", `${Math.abs(lat).toFixed(digits[0])}°${lat < 0 ? "S" : "N"}`, 0, y]);
      }
      for (const lon of lons) {
        const x = this.map.project([lon, middle]).x;
        if (x < 170 || x > this.size.width - 60) continue;
        const turned = ((((lon + 180) % 360) + 360) % 360) - 180;
        texts.push(["lon", `${Math.abs(turned).toFixed(digits[1])}°${turned < 0 ? "W" : "E"}`, x, 0]);
      }
    }
    texts.forEach(([kind, text, x, y], place) => {
      const known = this.labels.children[place] as HTMLElement | undefined;
      const element = known ?? this.labels.appendChild(h("span", {}));
      if (element.className !== kind) element.className = kind;
      say(element, verbatim(text));
      element.style.transform = `translate(${x}px, ${y}px)`;
    });
    while (this.labels.children.length > texts.length) this.labels.lastChild!.remove();
  }
}
