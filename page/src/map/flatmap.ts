/**
 * The map without WebGL: a plain canvas, for tablets and browsers that have nothing else. It
 * shows what the other shows but vector maps, turned views and the strength over the ground.
 */

import { PMTiles } from "pmtiles";
import { snrColour, tagColour } from "../shared/colour";
import { h } from "../shared/dom";
import { collection, hindsightFeatures, motionFeatures, pulseFeatures, rayOf, regionsOf, stationOf, wedgeOf } from "./features";
import { destination, type LonLat } from "../shared/geo";
import { t, verbatim } from "../shared/i18n";
import { AT_FIRST, type Layers, dark, ground } from "./maplayers";
import { droneElement, fixElement, markElement, max, meElement, min, onBoardElement, otherElement, roseElement } from "./markers";
import { bearingsShown, frameKey, herePlace, isTelling, lineFlown, othersPlaced, paddingIn, placesOf } from "./map_content";
import { vehicleName } from "../shared/format";
import { isPlaced, store } from "../store";
import type { FlightMap, MotionDrawing, Tap } from "./map_view";
import type { HeardMap, MapFile } from "../types";

const TILE = 256;
/** Pixels that an arrow key shifts the map by. */
const KEY_STEP = 60;
const MOST_PULSES = 4000;

export class FlatMap implements FlightMap {
  readonly layers: Layers = { ...AT_FIRST };
  readonly flat = true;
  follow = true;
  onTap: (tap: Tap) => void = () => undefined;
  private canvas = h("canvas", { class: "flat-map", tabindex: "0", "aria-label": t("common.map_label") });
  private over = h("div", { class: "flat-over" });
  private note = h("div", { class: "flat-attribution" });
  private zoom = 2;
  private middle: LonLat = [0, 20];
  private due = false;
  private framed: string | null = null;
  private basemap: MapFile | null = null;
  private archive: PMTiles | null = null;
  private tiles = new Map<string, HTMLImageElement | null>();
  private pointers = new Map<number, [number, number]>();
  private moved = 0;
  private me: LonLat | null = null;
  private heard: HeardMap | null = null;
  private picture: HTMLImageElement | null = null;
  private line: LonLat[] = [];
  private motion: MotionDrawing = { area: [], way: [], keepAway: [], keepOut: [] };

  constructor(private container: HTMLElement) {
    const buttons = h(
      "div",
      { class: "flat-zoom" },
      h("button", { "aria-label": t("map.zoom_in"), onclick: () => this.zoomBy(1) }, verbatim("+")),
      h("button", { "aria-label": t("map.zoom_out"), onclick: () => this.zoomBy(-1) }, verbatim("−")),
    );
    container.append(this.canvas, this.over, buttons, this.note);
    new ResizeObserver(() => this.redraw()).observe(container);
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoomBy(event.deltaY < 0 ? 0.5 : -0.5, [event.offsetX, event.offsetY]);
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (this.pointers.size === 1) this.moved = 0;
    });
    this.canvas.addEventListener("pointermove", (event) => this.drag(event));
    const up = (event: PointerEvent) => {
      if (!this.pointers.delete(event.pointerId) || event.type !== "pointerup" || this.moved > 6 || this.pointers.size) return;
      this.onTap({ at: this.placeAt([event.offsetX, event.offsetY]), x: event.offsetX, y: event.offsetY });
    };
    this.canvas.addEventListener("pointerup", up);
    this.canvas.addEventListener("pointercancel", up);
    this.canvas.addEventListener("keydown", (event) => this.press(event));
  }

  resize(): void {
    this.redraw();
  }
  recolour(): void {
    this.redraw();
  }
  drawPulses(): void {
    this.redraw();
  }
  drawTrack(): void {
    this.redraw();
  }
  drawEstimates(): void {
    this.redraw();
  }
  drawOther(): void {
    this.redraw();
  }
  drawFleet(): void {
    // With the track, which is drawn at each state, too.
  }
  drawMarks(): void {
    this.redraw();
  }
  setMe(at: LonLat | null): void {
    this.me = at;
    this.redraw();
  }
  setMeasure(line: LonLat[]): void {
    this.line = line;
    this.redraw();
  }
  setMotion(drawn: MotionDrawing): void {
    this.motion = drawn;
    this.redraw();
  }
  drawHindsight(): void {
    this.redraw();
  }
  setHeard(map: HeardMap | null): void {
    this.heard = map;
    this.picture = null;
    if (map) {
      const picture = new Image();
      picture.onload = () => this.redraw();
      picture.src = `data:image/png;base64,${map.picture}`;
      this.picture = picture;
    }
    this.redraw();
  }
  setLayer(name: keyof Layers, visible: boolean): void {
    this.layers[name] = visible;
    this.redraw();
  }

  setBasemap(file: MapFile | null): Promise<void> {
    this.basemap = file && !file.fault && file.tiles !== "mvt" ? file : null;
    this.tiles.clear();
    this.archive = this.basemap?.format === "pmtiles" ? new PMTiles(this.placeOf(this.basemap)) : null;
    this.note.textContent = file?.tiles === "mvt" ? t("map.needs_webgl2") : (this.basemap?.attribution ?? "");
    this.redraw();
    return Promise.resolve();
  }

  fit(): void {
    const places = placesOf();
    if (places.length) this.show(places);
  }

  show(places: LonLat[]): void {
    const [lons, lats] = [places.map((one) => one[0]), places.map((one) => one[1])];
    const [left, right, low, high] = [min(lons), max(lons), max(lats.map(mercator)), min(lats.map(mercator))];
    const { width, height } = this.size();
    const room = paddingIn(width, height);
    const wide = Math.max((right - left) / 360, 1e-7);
    const tall = Math.max(low - high, 1e-7);
    const free = [width - room.left - room.right, height - room.top - room.bottom] as const;
    this.zoom = Math.min(18, Math.log2(Math.min(free[0] / wide, free[1] / tall) / TILE));
    const scale = this.scale();
    const down = (room.top - room.bottom) / 2 / scale;
    const across = ((room.left - room.right) / 2 / scale) * 360;
    this.middle = [(left + right) / 2 - across, latitude((low + high) / 2 - down)];
    this.redraw();
  }

  private size(): { width: number; height: number } {
    return { width: this.container.clientWidth || 600, height: this.container.clientHeight || 400 };
  }

  private scale(): number {
    return TILE * 2 ** this.zoom;
  }

  private pixel([lon, lat]: LonLat): [number, number] {
    const { width, height } = this.size();
    const scale = this.scale();
    return [width / 2 + ((lon - this.middle[0]) / 360) * scale, height / 2 + (mercator(lat) - mercator(this.middle[1])) * scale];
  }

  private placeAt([x, y]: [number, number]): LonLat {
    const { width, height } = this.size();
    const scale = this.scale();
    return [this.middle[0] + ((x - width / 2) / scale) * 360, latitude(mercator(this.middle[1]) + (y - height / 2) / scale)];
  }

  private zoomBy(steps: number, at?: [number, number]): void {
    const { width, height } = this.size();
    const pixel = at ?? [width / 2, height / 2];
    const before = this.placeAt(pixel);
    this.zoom = Math.max(1, Math.min(21, this.zoom + steps));
    const after = this.placeAt(pixel);
    this.middle = [this.middle[0] + before[0] - after[0], latitude(mercator(this.middle[1]) + mercator(before[1]) - mercator(after[1]))];
    this.redraw();
  }

  private drag(event: PointerEvent): void {
    const was = this.pointers.get(event.pointerId);
    if (!was) return;
    const is: [number, number] = [event.offsetX, event.offsetY];
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId);
    this.pointers.set(event.pointerId, is);
    this.moved += Math.hypot(is[0] - was[0], is[1] - was[1]);
    if (others.length) {
      const fixed = others[0]![1];
      const ratio = Math.hypot(is[0] - fixed[0], is[1] - fixed[1]) / Math.max(1, Math.hypot(was[0] - fixed[0], was[1] - fixed[1]));
      this.zoomBy(Math.log2(Math.max(0.2, ratio)), fixed);
      return;
    }
    if (this.moved <= 6) return;
    this.shift(is[0] - was[0], is[1] - was[1]);
  }

  private shift(x: number, y: number): void {
    const scale = this.scale();
    this.middle = [this.middle[0] - (x / scale) * 360, latitude(mercator(this.middle[1]) - y / scale)];
    this.follow = false;
    this.container.dispatchEvent(new CustomEvent("follow"));
    this.redraw();
  }

  /** Keys of the other map: arrows shift, + and - zoom, Enter taps the middle. */
  private press(event: KeyboardEvent): void {
    const step = { ArrowLeft: [KEY_STEP, 0], ArrowRight: [-KEY_STEP, 0], ArrowUp: [0, KEY_STEP], ArrowDown: [0, -KEY_STEP] }[event.key];
    const { width, height } = this.size();
    if (step) this.shift(step[0]!, step[1]!);
    else if (event.key === "+" || event.key === "-") this.zoomBy(event.key === "+" ? 1 : -1);
    else if (event.key === "Enter") this.onTap({ at: this.middle, x: width / 2, y: height / 2 });
    else return;
    event.preventDefault();
  }

  private redraw(): void {
    if (this.due) return;
    this.due = true;
    setTimeout(() => {
      this.due = false;
      this.draw();
    }, 30);
  }

  private draw(): void {
    const key = frameKey();
    const here = herePlace();
    const moved = this.framed?.split(":")[0] === key.split(":")[0] && !this.follow;
    if (this.framed !== key && !moved && (store.pulses.count || here)) {
      this.framed = key;
      this.fit();
    }
    if (here && this.follow && this.framed) {
      const [x, y] = this.pixel(here.at);
      const { width, height } = this.size();
      if (x < 0 || y < 0 || x > width || y > height) this.middle = here.at;
    }
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const { width, height } = this.size();
    this.canvas.width = width * ratio;
    this.canvas.height = height * ratio;
    const pen = this.canvas.getContext("2d")!;
    pen.scale(ratio, ratio);
    pen.fillStyle = ground();
    pen.fillRect(0, 0, width, height);
    this.drawTiles(pen);
    this.drawHeard(pen);
    this.drawFlight(pen);
    this.drawOver(here);
  }

  private drawHeard(pen: CanvasRenderingContext2D): void {
    if (!this.heard || !this.picture?.naturalWidth) return;
    const [left, top] = this.pixel(this.heard.corners[0]);
    const [right, bottom] = this.pixel(this.heard.corners[2]);
    pen.globalAlpha = 0.7;
    pen.imageSmoothingEnabled = false;
    pen.drawImage(this.picture, left, top, right - left, bottom - top);
    pen.globalAlpha = 1;
  }

  private drawHindsightOn(pen: CanvasRenderingContext2D): void {
    for (const one of hindsightFeatures().features) {
      const colour = String(one.properties!.colour);
      if (one.geometry.type !== "Point") {
        for (const line of (one.geometry as GeoJSON.MultiLineString).coordinates) {
          this.path(pen, line as LonLat[]);
          this.stroke(pen, colour, 2, [8, 4, 2, 4]);
        }
        continue;
      }
      const place = one.properties!.part === "place";
      this.dot(pen, one.geometry.coordinates as LonLat, place ? 7 : 5, place ? colour : undefined);
      this.stroke(pen, place ? "#ffffff" : colour, place ? 3 : 1.8);
    }
  }

  private drawTiles(pen: CanvasRenderingContext2D): void {
    const map = this.basemap;
    if (!map) return;
    const level = Math.max(map.min_zoom ?? 0, Math.min(map.max_zoom ?? 14, Math.round(this.zoom)));
    const { width, height } = this.size();
    const [west, north] = this.placeAt([0, 0]);
    const [east, south] = this.placeAt([width, height]);
    const count = 2 ** level;
    const column = (lon: number) => Math.floor(((lon + 180) / 360) * count);
    const row = (lat: number) => Math.max(0, Math.min(count - 1, Math.floor(mercator(lat) * count)));
    for (let x = column(west); x <= column(east) && x - column(west) < 40; x += 1) {
      for (let y = row(north); y <= row(south); y += 1) {
        const image = this.tile(level, ((x % count) + count) % count, y);
        if (!image) continue;
        const [left, top] = this.pixel([(x / count) * 360 - 180, latitude(y / count)]);
        const side = this.scale() / count;
        pen.drawImage(image, left, top, side + 0.5, side + 0.5);
      }
    }
  }

  private placeOf(map: MapFile): string {
    return `${location.origin}/maps/${encodeURIComponent(map.name)}`;
  }

  private tile(z: number, x: number, y: number): HTMLImageElement | null {
    const key = `${z}/${x}/${y}`;
    const known = this.tiles.get(key);
    if (known !== undefined) return known?.complete && known.naturalWidth ? known : null;
    if (this.tiles.size > 400) this.tiles.clear();
    const image = new Image();
    image.onload = () => this.redraw();
    this.tiles.set(key, image);
    if (this.archive) {
      void this.archive.getZxy(z, x, y).then((found) => {
        if (found) image.src = URL.createObjectURL(new Blob([found.data]));
      }, () => undefined);
    } else image.src = `${this.placeOf(this.basemap!)}/${key}`;
    return null;
  }

  private path(pen: CanvasRenderingContext2D, line: LonLat[]): void {
    pen.beginPath();
    line.forEach((place, number) => {
      const [x, y] = this.pixel(place);
      if (number) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    });
  }

  /** A circle, filled or to be stroked. */
  private dot(pen: CanvasRenderingContext2D, at: LonLat, radius: number, filled?: string): void {
    pen.beginPath();
    pen.arc(...this.pixel(at), radius, 0, 2 * Math.PI);
    if (filled === undefined) return;
    pen.fillStyle = filled;
    pen.fill();
  }

  private drawFlight(pen: CanvasRenderingContext2D): void {
    const [bearings, positions] = bearingsShown();
    if (this.layers.bearings) {
      for (const one of collection(bearings.filter(isTelling).flatMap((each) => wedgeOf(each, positions))).features) {
        this.path(pen, (one.geometry as GeoJSON.Polygon).coordinates[0] as LonLat[]);
        pen.fillStyle = String(one.properties!.colour);
        pen.globalAlpha = Number(one.properties!.opacity);
        pen.fill();
      }
      pen.globalAlpha = 1;
      for (const each of bearings) {
        const one = rayOf(each, positions);
        this.path(pen, (one.geometry as GeoJSON.LineString).coordinates as LonLat[]);
        this.stroke(pen, String(one.properties!.colour), 2.4, one.properties!.sure ? [] : [5, 5]);
      }
    }
    if (this.layers.track) {
      this.path(pen, lineFlown(store.track, 3000, store.until));
      this.stroke(pen, dark() ? "#cfd8dc" : "#37474f", 1.6);
    }
    if (this.layers.pulses) {
      const count = store.shown();
      for (const one of pulseFeatures(Math.max(0, count - MOST_PULSES), count).features) {
        this.dot(pen, (one.geometry as GeoJSON.Point).coordinates as LonLat, 4, snrColour(Number(one.properties!.snr)));
      }
    }
    if (this.layers.regions) {
      for (const one of positions.flatMap(regionsOf)) {
        for (const line of (one.geometry as GeoJSON.MultiLineString).coordinates) {
          this.path(pen, line as LonLat[]);
          this.stroke(pen, String(one.properties!.colour), one.properties!.share === 50 ? 2.6 : 1.6, one.properties!.share === 0 ? [3, 5] : []);
        }
      }
    }
    if (this.layers.hindsight) this.drawHindsightOn(pen);
    const other = store.other;
    if (other) {
      this.path(pen, lineFlown(other.track, 3000));
      this.stroke(pen, "#b5179e", 1.8, [6, 4]);
      for (const one of other.positions.filter(isPlaced)) {
        this.dot(pen, [one.longitude_deg, one.latitude_deg], 6);
        this.stroke(pen, tagColour(store.tagOrder(one.tag_id)), 3);
      }
    }
    this.drawMotion(pen);
    if (this.line.length > 1) {
      this.path(pen, this.line);
      this.stroke(pen, "#b5179e", 2.5, [8, 4]);
    }
    this.drawScale(pen);
  }

  private stroke(pen: CanvasRenderingContext2D, colour: string, width: number, dashes: number[] = []): void {
    pen.setLineDash(dashes);
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.stroke();
    pen.setLineDash([]);
  }

  private drawMotion(pen: CanvasRenderingContext2D): void {
    for (const one of motionFeatures(this.motion).features) {
      const part = String(one.properties!.part);
      const colour = part === "keep" ? "#c62828" : part === "area" || part === "corner" ? "#7b1fa2" : "#00838f";
      if (one.geometry.type === "Point") {
        this.dot(pen, one.geometry.coordinates as LonLat, 6, colour);
        this.stroke(pen, "#ffffff", 2);
        continue;
      }
      const line = one.geometry.type === "Polygon" ? one.geometry.coordinates[0] : (one.geometry as GeoJSON.LineString).coordinates;
      this.path(pen, line as LonLat[]);
      this.stroke(pen, colour, part === "way" ? 3 : 2, part === "way" ? [] : [8, 5]);
    }
  }

  /** A bar of a round number of metres. */
  private drawScale(pen: CanvasRenderingContext2D): void {
    const { height } = this.size();
    const [x0] = this.pixel(this.middle);
    const [x1] = this.pixel(destination(this.middle, 90, 1000));
    const most = (140 / (x1 - x0)) * 1000;
    const power = 10 ** Math.floor(Math.log10(most));
    const round = [5, 2, 1].find((one) => one * power <= most)! * power;
    const wide = ((x1 - x0) * round) / 1000;
    pen.fillStyle = pen.strokeStyle = dark() ? "#e8eff2" : "#16232a";
    pen.strokeRect(12, height - 20, wide, 1);
    pen.font = "12px sans-serif";
    pen.fillText(round >= 1000 ? `${round / 1000} km` : `${round} m`, 14, height - 25);
  }

  private drawOver(here: { at: LonLat; heading: number } | null): void {
    const [bearings, positions] = bearingsShown();
    const put = (element: HTMLElement, at: LonLat, bottom = false) => {
      const [x, y] = this.pixel(at);
      const box = h("div", { class: bottom ? "flat-mark bottom" : "flat-mark" }, element);
      box.style.transform = `translate(${x}px, ${y}px) translate(-50%, ${bottom ? "-100%" : "-50%"})`;
      return box;
    };
    const boxes: HTMLElement[] = [];
    if (this.layers.rose) {
      for (const one of bearings) {
        if (one.tag_id === store.selected) boxes.push(put(one.from_drone ? onBoardElement(one) : roseElement(one), stationOf(one)));
      }
    }
    if (this.layers.regions) for (const one of positions) boxes.push(put(fixElement(one), [one.longitude_deg, one.latitude_deg], true));
    for (const one of store.marks()) boxes.push(put(markElement(one.text), [one.longitude_deg, one.latitude_deg], true));
    for (const one of othersPlaced()) boxes.push(put(otherElement(one.pose.heading_deg, vehicleName(one)), [one.pose.longitude_deg, one.pose.latitude_deg]));
    if (this.me) boxes.push(put(meElement(), this.me));
    if (here) {
      const drone = droneElement();
      drone.style.transform = `rotate(${here.heading}deg)`;
      boxes.push(put(drone, here.at));
    }
    this.over.replaceChildren(...boxes);
  }
}

/** Part of the world's height in the map, 0 in the north. */
function mercator(lat: number): number {
  const sine = Math.sin((Math.max(-85.05, Math.min(85.05, lat)) * Math.PI) / 180);
  return 0.5 - Math.log((1 + sine) / (1 - sine)) / (4 * Math.PI);
}

function latitude(part: number): number {
  return (Math.atan(Math.sinh(Math.PI * (1 - 2 * part))) * 180) / Math.PI;
}

export function hasWebGl2(): boolean {
  try {
    return document.createElement("canvas").getContext("webgl2") !== null;
  } catch {
    return false;
  }
}
