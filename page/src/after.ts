/** After the landing: what a whole flight's samples say, where a tag would have been heard, and where it is not. */

import { ApiError, reasonOf, send } from "./api";
import { by, fill, h, say } from "./dom";
import { askForMap, forgetHeard, heardElements, numberOf, tellHeard } from "./heard";
import { isPlace } from "./features";
import { fixed, metres } from "./format";
import type { LonLat } from "./geo";
import { store } from "./store";
import { catchTaps } from "./tap";
import type { Absence, IntegrationAnswer, SilenceMap, Verdict } from "./types";
import type { FlightMap } from "./view";

const AGAIN_MS = 700;
const MOST_CORNERS = 20;

let view: FlightMap;
let asked = 0;
let outline: LonLat[] = [];
let drawing = false;
let shown: SilenceMap | null = null;
let flight: string | null = null;

export function afterPanel(made: FlightMap): HTMLElement {
  view = made;
  store.on(["reset", "hindsight", "selection"], drawAfter);
  return h(
    "div",
    { id: "after", class: "after", hidden: true },
    h("h3", {}, "In the whole flight"),
    h("ul", { id: "verdicts", class: "verdicts" }),
    h("button", { id: "integrate-begin", hidden: true, onclick: () => void lookBelow() }, "Search below the noise"),
    h("p", { id: "integrate-status", class: "status-line", role: "status" }),
    h("h3", {}, "Where it would have been detected"),
    h(
      "div",
      { class: "fields" },
      h("label", {}, h("span", {}, "Tag"), h("select", { id: "silence-tag", onchange: () => void forget() })),
      h("label", {}, h("span", {}, "Radiated power, dBm"), h("input", { id: "silence-power", value: "-25", inputmode: "decimal", autocomplete: "off", onchange: () => void forget() })),
    ),
    h("button", { id: "silence-make", class: "primary", onclick: () => void make() }, "Make the map"),
    ...heardElements("silence"),
    h(
      "div",
      { class: "area-row" },
      h("button", { id: "absence-draw", "aria-pressed": "false", onclick: () => draw() }, "Draw an area"),
      h("button", { id: "absence-clear", onclick: () => clear() }, "Clear"),
    ),
    h("p", { id: "absence-status", class: "status-line absence", role: "status" }),
    h("div", { id: "silence-status", class: "status-line", role: "status" }),
  );
}

/** Show or hide the panel; taps belong to the map again. */
export function openAfter(open: boolean): void {
  by("after").hidden = !open;
  if (open && shown) view.setHeard(shown);
  if (!open && drawing) draw();
}

function drawAfter(): void {
  const review = store.review;
  by("show-after").hidden = review === null;
  const now = review?.flight_id ?? null;
  if (now !== flight) {
    flight = now;
    forget();
    const tags = review?.rows ?? [];
    fill(by("silence-tag"), ...tags.map((tag) => h("option", { value: String(tag.id), translate: "no" }, [tag.id, tag.name].filter(Boolean).join(" "))));
  }
  const tags = store.hindsight?.tags ?? [];
  fill(
    by("verdicts"),
    ...(tags.length ? tags.map(verdict) : [h("li", { class: "note" }, "Not searched below the noise yet. Run uavrt integrate FLIGHT where the samples are.")]),
  );
  by("integrate-begin").hidden = review === null || tags.length > 0;
}

/** Let the ground station judge the whole flight from the samples that it kept. */
async function lookBelow(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id) return;
  const button = by("integrate-begin") as HTMLButtonElement;
  button.disabled = true;
  say(by("integrate-status"), "Searching; this takes seconds to minutes.");
  let fault = "";
  try {
    for (;;) {
      const answer = await send<IntegrationAnswer>("POST", `/flights/${encodeURIComponent(id)}/integrate`, {});
      if (answer.state === "failed") throw new ApiError(answer.error, 500);
      if (answer.state === "done" || store.review?.flight_id !== id) break;
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
    await store.hindsightAgain();
  } catch (error) {
    fault = reasonOf(error);
  }
  say(by("integrate-status"), fault);
  button.disabled = false;
}

function fold(one: Verdict): HTMLElement | string {
  const picture = store.folds[one.tag_id];
  if (!picture) return "";
  return h("img", {
    class: "fold",
    src: `data:image/png;base64,${picture.picture}`,
    alt: "The flight folded at the interval: time downwards, phase to the right. A tag is a line in the middle.",
  });
}

function verdict(one: Verdict): HTMLElement {
  const row = store.review?.rows.find((each) => Number(each.id) === one.tag_id);
  const name = `Tag ${[one.tag_id, row?.name].filter(Boolean).join(" ")}`;
  if (!one.found) return h("li", {}, h("strong", {}, name), ` not found: noise alone shows as much ${often(one.false_alarm_probability)}`, one.silent ? "." : "", silent(one), remarks(one), fold(one));
  const where = isPlace(one)
    ? h("span", { class: "place" }, ` ${fixed(one.latitude_deg!, 5)}, ${fixed(one.longitude_deg!, 5)}, within ${metres(one.radius95_m!)} (95\u202f%)`)
    : one.places > 1
      ? ` In one of ${one.places} places that this flight cannot distinguish: ${one.parts.map(partOf).join("; ")}`
      : one.bearing_deg !== null
        ? ` At ${fixed(one.bearing_deg, 0)}°, ±\u202f${fixed((one.arc95_deg ?? 360) / 2, 0)}° (95\u202f%), from the middle of the flight`
        : "";
  return h(
    "li",
    {},
    h("strong", {}, name),
    ` found, every ${fixed(one.interval_s, 4)} s; noise alone shows as much ${often(one.false_alarm_probability)}. ${one.pulses} pulses in hindsight (rings), ${one.heard_live} heard in flight.`,
    where,
    remarks(one),
    fold(one),
  );
}

function partOf(one: Verdict["parts"][number]): string {
  return `${fixed(one.latitude_deg, 5)}, ${fixed(one.longitude_deg, 5)}, within ${metres(one.radius95_m)} (${Math.round(100 * one.probability)}\u202f%)`;
}

function silent(one: Verdict): string {
  if (!one.silent) return "";
  const { tag_power_dbm, probability, within_m } = one.silent;
  return within_m === null
    ? ` No area around the flight would have detected a tag of ${fixed(tag_power_dbm, 0)} dBm with p ≥ ${fixed(probability, 1)}.`
    : ` Within ${metres(within_m)} of the flight, a tag of ${fixed(tag_power_dbm, 0)} dBm would have been detected with p ≥ ${fixed(probability, 1)}.`;
}

function remarks(one: Verdict): HTMLElement | string {
  // Each has its own words.
  return one.remarks ? h("p", { class: "note" }, ...one.remarks.split("; ").flatMap((text, place) => (place ? ["; ", text] : [text]))) : "";
}

function often(probability: number): string {
  if (probability >= 0.01) return `in ${Math.round(100 * probability)} of 100 flights`;
  return probability < 1e-9 ? "in fewer than one of a billion flights" : `in one of ${Number((1 / probability).toPrecision(1)).toLocaleString("en")} flights`;
}

// ------------------------------------------------------------------- the map of silence

function question(): { tag_id: number; tag_power_dbm: number } {
  return { tag_id: Number((by("silence-tag") as HTMLSelectElement).value), tag_power_dbm: numberOf("silence-power") };
}

function forget(): void {
  asked += 1;
  if (shown) view.setHeard(null);
  shown = null;
  forgetHeard("silence");
  say(by("absence-status"), "");
  clear();
}

async function make(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id) return;
  const ticket = ++asked;
  const map = await askForMap<SilenceMap>("silence", `/flights/${encodeURIComponent(id)}/silence`, question(), () => ticket === asked);
  if (map) {
    shown = map;
    view.setHeard(map);
    tellHeard("silence", map, [`The drone's noise: ${map.noise}.`]);
  }
  await judge();
}

// ------------------------------------------------------------------- not here

function draw(): void {
  drawing = !drawing;
  by("absence-draw").setAttribute("aria-pressed", String(drawing));
  catchTaps(drawing ? corner : null);
  if (drawing) say(by("absence-status"), "Tap the corners of the area on the map.");
}

function corner(at: LonLat): void {
  if (outline.length >= MOST_CORNERS) return;
  outline.push(at);
  view.setMeasure(outline.length > 2 ? [...outline, outline[0]!] : outline);
  void judge();
}

function clear(): void {
  outline = [];
  view.setMeasure([]);
  if (drawing) draw();
  say(by("absence-status"), "");
}

async function judge(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id || outline.length < 3) return;
  if (!shown) {
    say(by("absence-status"), "Make the map first.");
    return;
  }
  const ticket = asked;
  try {
    const found = await send<Absence>("POST", `/flights/${encodeURIComponent(id)}/absence`, { ...question(), outline });
    if (ticket !== asked) return;
    say(
      by("absence-status"),
      `Not here, p ${found.not_here > 0.9995 ? "> 0.999" : `= ${found.not_here.toFixed(3)}`}. There it would have been heard with ${Math.round(100 * found.heard)}\u202f%; before the flight it was there with ${found.prior.toFixed(3)}, were it anywhere on the map alike.`,
    );
  } catch (error) {
    if (ticket === asked) say(by("absence-status"), reasonOf(error));
  }
}
