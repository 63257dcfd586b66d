/** Elements that stand on the map: the drone, pulse roses, positions. */

import { snrColour, tagColour } from "../shared/colour";
import { h, svg } from "../shared/dom";
import { t, verbatim, type Words } from "../shared/i18n";
import { store } from "../store";
import type { BearingRecord, PositionRecord } from "../types";

const ROSE_PX = 116;
const SILENCE_PX = 12;

export function droneElement(): HTMLElement {
  const shape = svg(
    "svg",
    { viewBox: "-16 -16 32 32", width: 34, height: 34, role: "img", "aria-label": t("common.drone") },
    svg("path", { d: "M0 -13 L9 11 L0 6 L-9 11 Z", class: "drone-shape" }),
  );
  const element = h("div", { class: "drone-marker" });
  element.appendChild(shape);
  return element;
}

/** Another vehicle of this station: smaller, with its name. */
export function otherElement(heading: number, name: Words): HTMLElement {
  const shape = svg(
    "svg",
    { viewBox: "-16 -16 32 32", width: 24, height: 24, role: "img", "aria-label": name },
    svg("path", { d: "M0 -13 L9 11 L0 6 L-9 11 Z", class: "drone-shape other", transform: `rotate(${heading})` }),
  );
  return h("div", { class: "other-vehicle", "data-name": name }, shape, h("span", { class: "fix-name", translate: "no" }, name));
}

/** The pulse rose: for each sixteenth of the turn, the strongest pulse heard there. */
export function roseElement(one: BearingRecord): HTMLElement {
  const heard = one.rose_snr_db.filter((value): value is number => value !== null);
  const top = max(heard);
  const low = Math.min(min(heard), top - 6);
  const half = ROSE_PX / 2;
  const shapes: SVGElement[] = [svg("circle", { r: half - 1, class: "rose-rim" })];
  const listened = listenedIn(one);
  one.rose_snr_db.forEach((value, sector) => {
    // Pointed there without a detection: a short grey petal; directions not pointed at have none.
    if (value === null && !listened.has(sector)) return;
    const radius = value === null ? SILENCE_PX : (half - 3) * (0.25 + (0.75 * (value - low)) / (top - low));
    const middle = (sector * 2 * Math.PI) / one.rose_snr_db.length;
    const wide = Math.PI / one.rose_snr_db.length;
    const at = (angle: number) => `${radius * Math.sin(angle)} ${-radius * Math.cos(angle)}`;
    const path = `M0 0L${at(middle - wide)}A${radius} ${radius} 0 0 1 ${at(middle + wide)}Z`;
    if (value === null) shapes.push(svg("path", { d: path, class: "rose-silence" }));
    else shapes.push(svg("path", { d: path, fill: snrColour(value), class: "rose-petal" }));
  });
  const label = t("markers.rose", { turn: one.turn + 1, bearing: Math.round(one.bearing_deg) });
  const element = h("div", { class: "rose", role: "img", "aria-label": label });
  element.appendChild(
    svg("svg", { viewBox: `${-half} ${-half} ${ROSE_PX} ${ROSE_PX}`, width: ROSE_PX, height: ROSE_PX }, ...shapes),
  );
  return element;
}

/** Sectors that the antenna looked to in a turn, by the track's headings. */
function listenedIn(one: BearingRecord): Set<number> {
  const { track } = store;
  const sectors = one.rose_snr_db.length;
  const offset = store.settings?.antenna_offset_deg ?? 0;
  const found = new Set<number>();
  for (let place = 0; place < track.count; place += 1) {
    if (track.time[place]! < one.start_time_ns || track.time[place]! > one.end_time_ns) continue;
    const turned = ((track.yaw[place]! + offset) % 360 + 360) % 360;
    found.add(Math.floor(turned / (360 / sectors) + 0.5) % sectors);
  }
  return found;
}

export function markElement(text: string): HTMLElement {
  return h("div", { class: "mark-place", title: verbatim(text) }, h("span", { class: "mark-flag" }, verbatim("⚑")), text ? h("span", { class: "fix-name", translate: "no" }, verbatim(text)) : null);
}

export function meElement(): HTMLElement {
  return h("div", { class: "me", role: "img", "aria-label": t("markers.you") });
}

/** In place of a rose, where the drone sent a bearing without its pulses: a square, with its ray's direction. */
export function onBoardElement(one: BearingRecord): HTMLElement {
  const label = t("markers.drones_bearing", { turn: one.turn + 1, bearing: Math.round(one.bearing_deg), pulses: one.pulses });
  const element = h("div", { class: "on-board", role: "img", "aria-label": label });
  const mark = svg(
    "svg",
    { viewBox: "-12 -12 24 24", width: 24, height: 24 },
    svg("rect", { x: -8, y: -8, width: 16, height: 16, class: "on-board-mark", stroke: tagColour(store.tagOrder(one.tag_id)) }),
    svg("path", { d: "M0 0V-8", class: "on-board-mark", stroke: tagColour(store.tagOrder(one.tag_id)), transform: `rotate(${one.bearing_deg})` }),
  );
  element.appendChild(mark);
  return element;
}

export function fixElement(one: PositionRecord): HTMLElement {
  const element = h("div", { class: "fix" }, h("span", { class: "fix-name", translate: "no" }, store.tagName(one.tag_id)));
  const pin = svg(
    "svg",
    { viewBox: "-9 -20 18 21", width: 18, height: 21, "aria-hidden": "true" },
    svg("path", { d: "M0 0C-8 -9 -8 -19 0 -19S8 -9 0 0Z", fill: tagColour(store.tagOrder(one.tag_id)), class: "fix-pin" }),
  );
  element.appendChild(pin);
  return element;
}

export function rgb(colour: string): [number, number, number] {
  return [1, 3, 5].map((place) => parseInt(colour.slice(place, place + 2), 16)) as [number, number, number];
}

export function min(values: number[]): number {
  return values.reduce((a, b) => Math.min(a, b), Infinity);
}

export function max(values: number[]): number {
  return values.reduce((a, b) => Math.max(a, b), -Infinity);
}
