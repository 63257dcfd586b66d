/** The view of a flight: buttons, tags, map, and where to walk. */

import { afterPanel, openAfter } from "./after_landing";
import { getOnceThere, reasonOf, send } from "../shared/api";
import { beepBox, drawBeeps } from "./beeps";
import { snrColour, SNR_HIGH, tagColour } from "../shared/colour";
import { mayCommand } from "./commands";
import { append, by, describe, fill, h, say } from "../shared/dom";
import { ago, fixed, percent, UNKNOWN } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { drawFollow, drawLegend, layerBox, legend, offerMaps } from "../map/layers";
import { FlatMap, hasWebGl2 } from "../map/flatmap";
import { MapView } from "../map/map";
import { motionPanel, openMotion } from "./motion";
import { toast } from "../shared/notice";
import { recall } from "../shared/remembered";
import { drawReplay, replayBar } from "../past/replay";
import { fillRows, folded, type Row, rowList } from "../shared/rows";
import { tagsSent } from "../settings/setup";
import { store } from "../store";
import type { Choices, TagRow } from "../types";
import { tapBox } from "./map_tap";
import { toAllBox } from "./vehicles";
import type { FlightMap } from "../map/map_view";
import { drawPositionCard, positionCard } from "./position_card";

const ACTIONS = ["send_tags", "start", "stop", "capture", "mark"];
/** Shift with the letter: a key that is hit by chance must not end a search. */
const KEYS: Record<string, string> = { send_tags: "⇧T", start: "⇧S", stop: "⇧X", capture: "⇧C", mark: "M" };
const SHORTCUTS: Record<string, string> = { send_tags: "Shift+T", start: "Shift+S", stop: "Shift+X", capture: "Shift+C", mark: "M" };
const DETECTOR_LOST_S = 15;
const RATE_WINDOW_NS = 60e9;

type Freshness = "live" | "stale" | "lost" | "never";

interface Card {
  root: HTMLElement;
  bar: HTMLElement;
  snr: HTMLElement;
  facts: HTMLElement;
  details: HTMLElement;
  fresh: HTMLElement;
  eye: HTMLButtonElement;
}

let view: FlightMap;
const cards = new Map<number, Card>();
const buttons = new Map<string, HTMLButtonElement>();

export function mapView(): FlightMap {
  return view;
}

let openView: (name: string) => void = () => undefined;

export function buildFly(go: (name: string) => void): void {
  openView = go;
  const actions = h("div", { class: "actions", role: "group", "aria-label": t("fly.flight") });
  for (const name of ACTIONS) {
    const button = h("button", {
      id: `act-${name}`,
      class: `act act-${name}`,
      "aria-describedby": "act-reason",
      "aria-keyshortcuts": SHORTCUTS[name],
      "aria-disabled": "true", // until the first state comes: a press before it would do nothing
      onclick: () => void act(name),
    });
    button.addEventListener("pointerenter", () => showReason(name));
    button.addEventListener("focus", () => showReason(name));
    buttons.set(name, button);
    actions.appendChild(button);
  }
  const panel = h(
    "div",
    { class: "panel" },
    actions,
    h("p", { id: "act-reason", class: "reason", role: "status" }),
    toAllBox(),
    h("div", { id: "progress", hidden: true }, h("progress", { id: "progress-bar" }), h("span", { id: "progress-text" })),
    h(
      "div",
      { class: "segments", role: "group", "aria-label": t("fly.panel") },
      h("button", { id: "show-tags", "aria-pressed": "true", onclick: () => side("tags") }, t("common.tags")),
      h("button", { id: "show-move", "aria-pressed": "false", onclick: () => side("move") }, t("fly.move")),
      h("button", { id: "show-after", "aria-pressed": "false", hidden: true, onclick: () => side("after") }, t("fly.after")),
    ),
    h("div", { id: "cards", class: "cards", role: "list", "aria-label": t("common.tags") }),
    beepBox(),
  );
  const map = h("div", { id: "map", class: "map" });
  const mapArea = h("div", { class: "map-wrap" }, map, positionCard(), legend());
  fill(by("view-fly"), panel, mapArea);
  view = recall("plain") || !hasWebGl2() ? new FlatMap(map) : new MapView(map);
  append(mapArea, [layerBox(view), replayBar(), tapBox(view)]);
  panel.appendChild(motionPanel(view));
  panel.appendChild(afterPanel(view));
  map.addEventListener("follow", () => drawFollow());
  store.on(["state"], drawActions);
  store.on(["state", "reset"], drawBeeps);
  store.on(["tags", "reset", "selection"], buildCards);
  store.on(["pulses", "reset", "state", "selection"], drawCards);
  store.on(["pulses"], () => view.drawPulses(false));
  store.on(["reset", "selection"], () => view.drawPulses(true));
  store.on(["pose", "reset", "selection", "state"], () => view.drawTrack());
  store.on(["estimates", "selection", "reset", "tags"], () => view.drawEstimates());
  store.on(["estimates", "selection", "reset", "pulses", "tags", "state", "me"], drawPositionCard);
  store.on(["estimates", "selection"], drawLegend);
  store.on(["other", "selection"], () => view.drawOther());
  store.on(["state", "reset"], () => view.drawFleet());
  store.on(["reset", "selection"], drawReplay);
  store.on(["hindsight", "reset", "selection", "pulses"], () => view.drawHindsight());
  // Only what speaks of a past flight goes with it: a flight that begins leaves *Move* open.
  store.on(["reset"], () => {
    if (!store.review && !by("after").hidden) side("tags");
  });
  store.on(["state", "reset"], drawMarks);
  setInterval(drawCards, 1000);
  void getOnceThere<Choices>("/choices").then(offerMaps);
}

/** Panel next to the map: the tags, the motion of the drone, or the results after landing. */
function side(name: "tags" | "move" | "after"): void {
  for (const one of ["tags", "move", "after"]) by(`show-${one}`).setAttribute("aria-pressed", String(name === one));
  by("cards").hidden = name !== "tags";
  by("beeps").classList.toggle("away", name !== "tags");
  openMotion(name === "move");
  openAfter(name === "after");
}

let marksDrawn = "";

/** Marks come with each state; they are drawn when they have changed. */
function drawMarks(): void {
  const key = JSON.stringify(store.marks());
  if (key === marksDrawn) return;
  marksDrawn = key;
  view.drawMarks();
}

// ------------------------------------------------------------------- actions

export async function act(name: string): Promise<void> {
  const button = buttons.get(name);
  const action = store.state?.actions[name];
  if (!button || !action) return;
  if (!(await mayCommand(name, () => openView("setup")))) return;
  if (!store.state?.actions[name]?.enabled && !(name === "send_tags" && action.reason?.startsWith("No tags"))) {
    toast(action.reason ? fromServer(action.reason) : t("common.not_now"), 5);
    return;
  }
  const body = name === "mark" ? { text: prompt(t("common.remark")) ?? "" } : {};
  try {
    const answer = await send<{ message: string }>("POST", `/commands/${name}`, body);
    toast(t("fly.answered", { action: fromServer(action.label), answer: fromServer(answer.message) }), 6);
  } catch (error) {
    toast(t("fly.failed", { action: fromServer(action.label), reason: reasonOf(error) }), 3);
  }
}

function drawActions(): void {
  const state = store.state;
  if (!state) return;
  for (const [name, button] of buttons) {
    const action = state.actions[name];
    if (!action) continue;
    const label = name === "send_tags" && tagsSent() ? t("fly.tags_sent") : fromServer(action.label);
    if (button.textContent !== label) fill(button, label, h("kbd", {}, verbatim(KEYS[name]!)));
    const off = !action.enabled || (store.review !== null && name !== "stop") || (store.looksOn() && name !== "stop" && name !== "mark");
    // Not "disabled": a button that can be focused can say why it does nothing.
    button.setAttribute("aria-disabled", String(off));
    describe(button, "title", fromServer(action.reason ?? ""));
    button.classList.toggle("busy", state.busy?.action === name);
  }
  const next = nextStep();
  buttons.forEach((button, name) => button.classList.toggle("next", name === next));
  const reason = by("act-reason");
  if (!reason.matches("[data-shown]")) say(reason, hint());
  const busy = state.busy;
  by("progress").hidden = !busy;
  if (busy) {
    const bar = by("progress-bar") as HTMLProgressElement;
    if (busy.whole) {
      bar.max = busy.whole;
      bar.value = busy.done;
    } else bar.removeAttribute("value");
    say(by("progress-text"), fromServer(busy.text));
  }
}

/** The button that the operator most likely wants now. */
function nextStep(): string | null {
  const actions = store.state?.actions;
  if (!actions) return null;
  if (store.review || store.looksOn()) return actions.stop?.enabled && store.state?.drone.state === "detecting" ? "stop" : null;
  if (actions.send_tags?.enabled && !tagsSent()) return "send_tags";
  if (actions.start?.enabled) return "start";
  if (actions.stop?.enabled && store.state?.drone.state === "detecting") return "stop";
  return null;
}

function hint(): Words | "" {
  const actions = store.state?.actions;
  if (!actions) return "";
  if (store.review) return t("fly.past_flight");
  if (store.state?.drone.state === "detecting") return t("fly.detecting");
  if (store.looksOn()) return t("common.another_page_commands");
  const why = actions.start?.reason ?? actions.send_tags?.reason;
  return why ? fromServer(why) : t("fly.ready");
}

function showReason(name: string): void {
  const reason = by("act-reason");
  const why = store.state?.actions[name]?.reason;
  say(reason, why ? fromServer(why) : hint());
}

// ------------------------------------------------------------------- tags

function buildCards(): void {
  const ids = new Set(store.tagRows().map((row) => Number(row.id)).filter(Number.isFinite));
  for (let place = 0; place < store.pulses.count; place += 1) ids.add(store.pulses.get("tag")[place]!);
  if (store.selected === null || !ids.has(store.selected)) {
    const first = [...ids][0];
    if (first !== undefined && store.selected !== first) {
      store.selected = first;
      store.emit("selection");
    }
  }
  const known = [...cards.keys()];
  if (known.length !== ids.size || known.some((id) => !ids.has(id))) {
    cards.clear();
    for (const id of ids) cards.set(id, makeCard(id));
    if (ids.size) fill(by("cards"), ...[...cards.values()].map((card) => card.root));
    else fill(by("cards"), h("p", { class: "empty" }, t("fly.no_tags_yet")));
  }
  for (const [id, card] of cards) {
    const name = card.root.querySelector(".tag-name")!;
    say(name, store.tagName(id));
    card.root.classList.toggle("selected", id === store.selected);
    card.root.querySelector(".tag-pick")!.setAttribute("aria-pressed", String(id === store.selected));
    const hidden = store.hidden.has(id);
    card.root.classList.toggle("is-hidden", hidden);
    say(card.eye, hidden ? t("fly.show") : t("fly.hide"));
    describe(card.eye, "aria-label", hidden ? t("fly.show_tag", { id }) : t("fly.hide_tag", { id }));
    (card.root.querySelector(".tag-dot") as HTMLElement).style.background = tagColour(store.tagOrder(id));
  }
}

function makeCard(id: number): Card {
  const bar = h("div", { class: "bar-fill" });
  const snr = h("span", { class: "snr" }, UNKNOWN);
  const [facts, details] = [rowList(), rowList()];
  const fresh = h("span", { class: "fresh" });
  const eye = h("button", { class: "eye", onclick: () => store.toggle(id) });
  const root = h(
    "div",
    { class: "card", role: "listitem", "data-tag": id },
    h(
      "button",
      { class: "tag-pick", onclick: () => store.select(id) },
      h("span", { class: "tag-dot" }),
      h("span", { class: "tag-name", translate: "no" }, store.tagName(id)),
      fresh,
      snr,
    ),
    h("div", { class: "bar", role: "img", "aria-label": t("fly.signal_strength") }, bar),
    h("div", { class: "facts" }, facts, folded(details)),
    eye,
  );
  return { root, bar, snr, facts, details, fresh, eye };
}

interface Latest {
  last: number;
  minute: number;
  all: number;
}

function latest(now: number): Map<number, Latest> {
  const found = new Map<number, Latest>();
  const [tag, time] = [store.pulses.get("tag"), store.pulses.get("time")];
  for (let place = 0; place < store.shown(); place += 1) {
    let one = found.get(tag[place]!);
    if (!one) found.set(tag[place]!, (one = { last: place, minute: 0, all: 0 }));
    one.all += 1;
    if (time[place]! >= time[one.last]!) one.last = place;
    if (time[place]! > now - RATE_WINDOW_NS) one.minute += 1;
  }
  return found;
}

function drawCards(): void {
  const now = store.pulseNowNs();
  const found = latest(now);
  for (const [id, card] of cards) {
    const one = found.get(id);
    const row = store.tagRows().find((each) => Number(each.id) === id);
    const age = one ? (now - store.pulses.get("time")[one.last]!) / 1e9 : Infinity;
    const state = freshness(id, age, row);
    card.root.dataset.fresh = state;
    say(card.fresh, freshWord(state));
    const snr = one ? store.pulses.get("snr")[one.last]! : NaN;
    const clipped = one !== undefined && store.pulses.get("clipped")[one.last]! > 0;
    const strength = fixed(snr, 1, "dB");
    say(card.snr, clipped ? verbatim(`≥\u202f${strength}`) : strength);
    const part = Math.min(1, Math.max(0.02, snr / SNR_HIGH));
    card.bar.style.width = Number.isFinite(snr) ? `${part * 100}%` : "0";
    card.bar.style.background = snrColour(snr);
    fillRows(card.facts, one ? factsOf(one, age, row, now) : nominal(row));
    fillRows(card.details, [...(one ? detailsOf(one, row) : []), ...usable(id)]);
  }
}

function factsOf(one: Latest, age: number, row: TagRow | undefined, now: number): Row[] {
  const start = store.review ? store.review.start_time_ns : (store.state?.flight.start_time_ns ?? now);
  const minutes = Math.min(1, Math.max(1 / 60, (now - start) / RATE_WINDOW_NS));
  const also = store.pulses.get("also")[one.last]!;
  const ghost = store.pulses.get("ghost")[one.last]!;
  const id = store.pulses.get("tag")[one.last]!;
  return [
    [t("fly.caution"), Number.isFinite(ghost) ? t("fly.image_of", { ghost }) : Number.isFinite(also) && t("fly.either_tag", { id, also })],
    [t("fly.last_pulse"), !store.review && ago(age)],
    [row?.gaps_ms ? t("fly.bursts") : t("common.pulses"), t("fly.count_and_rate", { count: one.all, rate: Math.round(one.minute / minutes) })],
  ];
}

function detailsOf(one: Latest, row: TagRow | undefined): Row[] {
  const rate = store.pulses.get("rate")[one.last]!;
  const interval = Number(rate === 2 ? row?.second_interval_ms : row?.interval_ms);
  return [
    [t("common.frequency"), fixed(store.pulses.get("frequency")[one.last]! / 1e6, 4, "MHz")],
    [t("fly.rate"), !!row?.second_interval_ms && (interval ? t("fly.rate_of", { rate, interval }) : verbatim(String(rate)))],
    [t("common.gaps"), !!row?.gaps_ms && codeOf(store.pulses.get("tag")[one.last]!, row)],
  ];
}

/** How much of the time the tag's frequency is usable now, and from which strength on. */
function usable(id: number): Row[] {
  const report = store.review ? undefined : store.searched.get(id);
  if (typeof report?.usable_share !== "number") return [];
  const weakest = report.weakest_enr_db;
  return [
    [t("fly.usable"), percent(report.usable_share)],
    [t("fly.detectable"), weakest !== null && fixed(weakest, 0, "dB")],
  ];
}

/** The code: its gaps as measured in the last burst, or as listed. */
function codeOf(id: number, row: TagRow): Words {
  const starts = store.review ? undefined : store.bursts.get(id)?.burst_starts_ns;
  const inList = String(row.gaps_ms).trim().split(/\s+/);
  if (!starts || starts.length !== inList.length + 1) return inMilliseconds(inList);
  const gaps = starts.slice(1).map((start, place) => ((start - starts[place]!) / 1e6).toFixed(1));
  return inMilliseconds(gaps);
}

function inMilliseconds(values: string[]): Words {
  return t("fly.milliseconds", { values: verbatim(values.join(" ")) });
}

function nominal(row: TagRow | undefined): Row[] {
  if (!row) return [];
  return [
    [t("common.frequency"), fixed(Number(row.frequency_mhz), 4, "MHz")],
    [t("common.interval"), inMilliseconds([String(row.interval_ms)])],
    [t("common.gaps"), !!row.gaps_ms && inMilliseconds([String(row.gaps_ms)])],
  ];
}

/** Of a past flight nothing is live: a tag was heard by then, or not. */
function freshWord(state: Freshness): Words {
  if (state === "never") return t("fly.not_detected");
  if (store.review) return t("fly.detected");
  return { live: t("fly.live"), stale: t("fly.stale"), lost: t("fly.detector_lost") }[state];
}

function freshness(id: number, age: number, row: TagRow | undefined): Freshness {
  const detecting = store.state?.drone.state === "detecting" && !store.review;
  const heard = store.state?.detectors[String(id)];
  if (detecting && heard !== undefined && heard > DETECTOR_LOST_S) return "lost";
  if (!Number.isFinite(age)) return "never";
  const longest = Math.max(Number(row?.interval_ms ?? 0), Number(row?.second_interval_ms ?? 0)) / 1000;
  return age < Math.max(5, 3 * longest + 2) ? "live" : "stale";
}
