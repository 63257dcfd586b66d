/** Lines of latitude and longitude with their numbers: a map where there is no map. */

import type { GeoJSONSource, Map as MapLibre } from "maplibre-gl";
import { fill, h } from "./dom";

const STEPS_DEG = [
  30, 10, 5, 2, 1, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001,
];
const WANTED_LINES = 5;

export class Graticule {
  private labels: HTMLElement;

  constructor(
    private map: MapLibre,
    container: HTMLElement,
  ) {
    this.labels = h("div", { class: "graticule-labels", "aria-hidden": "true" });
    container.appendChild(this.labels);
    map.on("move", () => this.label());
    map.on("moveend", () => this.draw());
    map.on("resize", () => this.draw());
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

  private lines(): { lats: number[]; lons: number[]; digits: number } {
    const bounds = this.map.getBounds();
    const height = bounds.getNorth() - bounds.getSouth();
    const step = STEPS_DEG.find((one) => height / one >= WANTED_LINES - 1) ?? STEPS_DEG.at(-1)!;
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const between = (low: number, high: number) => {
      const found: number[] = [];
      for (let line = Math.ceil(low / step); line * step <= high && found.length < 60; line += 1) {
        found.push(line * step);
      }
      return found;
    };
    return {
      lats: between(Math.max(-85, bounds.getSouth()), Math.min(85, bounds.getNorth())),
      lons: between(bounds.getWest(), bounds.getEast()),
      digits,
    };
  }

  private draw(): void {
    const source = this.map.getSource("graticule") as GeoJSONSource | undefined;
    if (!source) return;
    const bounds = this.map.getBounds();
    const { lats, lons } = this.lines();
    const wide = bounds.getEast() - bounds.getWest();
    const high = bounds.getNorth() - bounds.getSouth();
    const [west, east] = [bounds.getWest() - wide, bounds.getEast() + wide];
    const [south, north] = [Math.max(-85, bounds.getSouth() - high), Math.min(85, bounds.getNorth() + high)];
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

  private label(): void {
    if (Math.abs(this.map.getBearing()) > 1) {
      fill(this.labels);
      return;
    }
    const { lats, lons, digits } = this.lines();
    const box = this.map.getCanvas().getBoundingClientRect();
    const texts: HTMLElement[] = [];
    for (const lat of lats) {
      const y = this.map.project([this.map.getCenter().lng, lat]).y;
      if (y < 60 || y > box.height - 44) continue;
      const text = h("span", { class: "lat" }, `${Math.abs(lat).toFixed(digits)}°${lat < 0 ? "S" : "N"}`);
      text.style.top = `${y}px`;
      texts.push(text);
    }
    for (const lon of lons) {
      const x = this.map.project([lon, this.map.getCenter().lat]).x;
      if (x < 170 || x > box.width - 60) continue;
      const turned = ((((lon + 180) % 360) + 360) % 360) - 180;
      const text = h("span", { class: "lon" }, `${Math.abs(turned).toFixed(digits)}°${turned < 0 ? "W" : "E"}`);
      text.style.left = `${x}px`;
      texts.push(text);
    }
    fill(this.labels, ...texts);
  }
}
