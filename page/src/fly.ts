/** The view of a flight: buttons, tags, map, and where to walk. */

import { ApiError, get, send } from "./api";
import { snrColour, gradient, SNR_HIGH, SNR_LOW, tagColour } from "./colour";
import { by, fill, h, say } from "./dom";
import { ago, fixed, metres, UNKNOWN } from "./format";
import { bearingDeg, compass, distanceM, type LonLat } from "./geo";
import { MapView, type Layers } from "./map";
import { toast } from "./notice";
import { speak } from "./speech";
import { store } from "./store";
import type { Choices, Readout, TagRow } from "./types";

const ACTIONS = ["send_tags", "start", "stop", "capture", "mark"];
const KEYS: Record<string, string> = { send_tags: "T", start: "S", stop: "X", capture: "C", mark: "M" };
const DETECTOR_LOST_S = 15;
const RATE_WINDOW_NS = 60e9;

type Freshness = "live" | "stale" | "lost" | "never";

interface Card {
  root: HTMLElement;
  bar: HTMLElement;
  snr: HTMLElement;
  facts: HTMLElement;
  fresh: HTMLElement;
  eye: HTMLButtonElement;
}

let view: MapView;
const cards = new Map<number, Card>();
const buttons = new Map<string, HTMLButtonElement>();
let format: keyof Readout = "decimal";
let strongest: { key: string; readout: Readout } | null = null;

export function mapView(): MapView {
  return view;
}

export function buildFly(): void {
  const actions = h("div", { class: "actions", role: "group", "aria-label": "Flight" });
  for (const name of ACTIONS) {
    const button = h("button", {
      id: `act-${name}`,
      class: `act act-${name}`,
      "aria-describedby": "act-reason",
      "aria-keyshortcuts": KEYS[name],
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
    h("div", { id: "progress", hidden: true }, h("progress", { id: "progress-bar" }), h("span", { id: "progress-text" })),
    h("div", { id: "cards", class: "cards", role: "list", "aria-label": "Tags" }),
  );
  const map = h("div", { id: "map", class: "map" });
  const side = h("div", { class: "map-wrap" }, map, walkBox(), legend(), layerBox(), replayBar());
  fill(by("view-fly"), panel, side);
  view = new MapView(map);
  map.addEventListener("follow", () => drawFollow());
  store.on(["state"], drawActions);
  store.on(["tags", "reset", "selection"], buildCards);
  store.on(["pulses", "reset", "state", "selection"], drawCards);
  store.on(["pulses"], () => view.drawPulses(false));
  store.on(["reset", "selection"], () => view.drawPulses(true));
  store.on(["pose", "reset", "selection", "state"], () => view.drawTrack());
  store.on(["estimates", "selection", "reset", "tags"], () => view.drawEstimates());
  store.on(["estimates", "selection", "reset", "pulses", "tags"], drawWalk);
  store.on(["reset", "selection"], drawReplay);
  setInterval(drawCards, 1000);
  void get<Choices>("/choices").then(offerMaps, () => undefined);
}

// ------------------------------------------------------------------- actions

export async function act(name: string): Promise<void> {
  const button = buttons.get(name);
  const action = store.state?.actions[name];
  if (!button || !action) return;
  if (store.review) {
    toast("This is a past flight: go back to the live one first", 5);
    return;
  }
  if (!action.enabled) {
    toast(action.reason ?? "Not now", 5);
    return;
  }
  const body = name === "mark" ? { text: prompt("Remark (may stay empty)") ?? "" } : {};
  try {
    const answer = await send<{ message: string }>("POST", `/commands/${name}`, body);
    toast(`${action.label}: ${answer.message}`, 6);
  } catch (error) {
    toast(`${action.label} failed: ${error instanceof ApiError ? error.message : "the server is not reached"}`, 3);
  }
}

function drawActions(): void {
  const state = store.state;
  if (!state) return;
  for (const [name, button] of buttons) {
    const action = state.actions[name];
    if (!action) continue;
    const label = name === "send_tags" && state.tags_sent ? "Tags sent" : action.label;
    if (button.textContent !== label) fill(button, label, h("kbd", {}, KEYS[name]));
    const off = !action.enabled || store.review !== null;
    // Not "disabled": a button that can be focused can say why it does nothing.
    button.setAttribute("aria-disabled", String(off));
    button.title = action.reason ?? "";
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
    say(by("progress-text"), busy.text);
  }
}

/** The button that the operator most likely wants now. */
function nextStep(): string | null {
  const actions = store.state?.actions;
  if (!actions || store.review) return null;
  if (actions.send_tags?.enabled && !store.state?.tags_sent) return "send_tags";
  if (actions.start?.enabled) return "start";
  if (actions.stop?.enabled && store.state?.drone.state === "detecting") return "stop";
  return null;
}

function hint(): string {
  const actions = store.state?.actions;
  if (!actions) return "";
  if (store.review) return "A past flight is shown.";
  if (store.state?.drone.state === "detecting") return "Detecting. Turn slowly on the spot, then fly on.";
  return actions.start?.reason ?? actions.send_tags?.reason ?? "Ready to start.";
}

function showReason(name: string): void {
  const reason = by("act-reason");
  const why = store.state?.actions[name]?.reason;
  say(reason, why ?? hint());
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
    else fill(by("cards"), h("p", { class: "empty" }, "No tags yet. Type them in under Set-up."));
  }
  for (const [id, card] of cards) {
    const name = card.root.querySelector(".tag-name")!;
    say(name, store.tagName(id));
    card.root.classList.toggle("selected", id === store.selected);
    card.root.querySelector(".tag-pick")!.setAttribute("aria-pressed", String(id === store.selected));
    const hidden = store.hidden.has(id);
    card.root.classList.toggle("is-hidden", hidden);
    card.eye.setAttribute("aria-pressed", String(!hidden));
    say(card.eye, hidden ? "Show" : "Hide");
    (card.root.querySelector(".tag-dot") as HTMLElement).style.background = tagColour(store.tagOrder(id));
  }
}

function makeCard(id: number): Card {
  const bar = h("div", { class: "bar-fill" });
  const snr = h("span", { class: "snr" }, UNKNOWN);
  const facts = h("div", { class: "facts" });
  const fresh = h("span", { class: "fresh" });
  const eye = h("button", { class: "eye", "aria-label": `Show tag ${id} on the map`, onclick: () => store.toggle(id) });
  const root = h(
    "div",
    { class: "card", role: "listitem", "data-tag": id },
    h(
      "button",
      { class: "tag-pick", onclick: () => store.select(id) },
      h("span", { class: "tag-dot" }),
      h("span", { class: "tag-name" }, store.tagName(id)),
      fresh,
      snr,
    ),
    h("div", { class: "bar", role: "img", "aria-label": "Signal strength" }, bar),
    facts,
    eye,
  );
  return { root, bar, snr, facts, fresh, eye };
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
    say(card.fresh, { live: "live", stale: "stale", lost: "detector lost", never: "not heard" }[state]);
    const snr = one ? store.pulses.get("snr")[one.last]! : NaN;
    say(card.snr, fixed(snr, 1, "dB"));
    const part = Math.min(1, Math.max(0.02, snr / SNR_HIGH));
    card.bar.style.width = Number.isFinite(snr) ? `${part * 100}%` : "0";
    card.bar.style.background = snrColour(snr);
    say(card.facts, one ? factsOf(one, age, row, now) : nominal(row));
  }
}

function factsOf(one: Latest, age: number, row: TagRow | undefined, now: number): string {
  const frequency = store.pulses.get("frequency")[one.last]! / 1e6;
  const rate = store.pulses.get("rate")[one.last]!;
  const interval = Number(rate === 2 ? row?.second_interval_ms : row?.interval_ms);
  const start = store.review ? store.review.start_time_ns : (store.state?.flight.start_time_ns ?? now);
  const minutes = Math.min(1, Math.max(1 / 60, (now - start) / RATE_WINDOW_NS));
  const parts = [
    ago(age),
    `${Math.round(one.minute / minutes)}/min`,
    `${frequency.toFixed(4)}\u202fMHz`,
    row?.second_interval_ms ? `rate ${rate}${interval ? ` (${interval}\u202fms)` : ""}` : null,
    `${one.all} pulses`,
  ];
  return parts.filter(Boolean).join(" · ");
}

function nominal(row: TagRow | undefined): string {
  return row ? `${row.frequency_mhz}\u202fMHz · every ${row.interval_ms}\u202fms` : "";
}

function freshness(id: number, age: number, row: TagRow | undefined): Freshness {
  const detecting = store.state?.drone.state === "detecting" && !store.review;
  const heard = store.state?.detectors[String(id)];
  if (detecting && heard !== undefined && heard > DETECTOR_LOST_S) return "lost";
  if (!Number.isFinite(age)) return "never";
  const longest = Math.max(Number(row?.interval_ms ?? 0), Number(row?.second_interval_ms ?? 0)) / 1000;
  return age < Math.max(5, 3 * longest + 2) ? "live" : "stale";
}

// ------------------------------------------------------------------- where to walk

function walkBox(): HTMLElement {
  const formats = (["decimal", "dms", "utm", "mgrs"] as const).map((name) =>
    h(
      "button",
      {
        class: "format",
        "data-format": name,
        "aria-pressed": String(name === format),
        onclick: () => {
          format = name;
          drawWalk();
        },
      },
      { decimal: "°", dms: "° ′ ″", utm: "UTM", mgrs: "MGRS" }[name],
    ),
  );
  return h(
    "div",
    { id: "walk", class: "walk", hidden: true, role: "region", "aria-label": "Where to go" },
    h("div", { class: "walk-head" }, h("span", { id: "walk-title" }), h("span", { id: "walk-sure" })),
    h("div", { id: "walk-place", class: "walk-place" }),
    h("div", { id: "walk-way", class: "walk-way" }),
    h(
      "div",
      { class: "walk-formats", role: "group", "aria-label": "Form of the coordinates" },
      ...formats,
      h("button", { id: "walk-speak", class: "format", onclick: () => speak(spelled()) }, "Read aloud"),
      h("button", { id: "walk-copy", class: "format", onclick: copyPlace }, "Copy"),
    ),
  );
}

function drawWalk(): void {
  const box = by("walk");
  const id = store.selected;
  const fix = store.positions.find((one) => one.tag_id === id && one.stations >= 2);
  if (id === null || (!fix && !store.pulses.count)) {
    box.hidden = true;
    return;
  }
  document.querySelectorAll<HTMLElement>("[data-format]").forEach((button) => {
    button.setAttribute("aria-pressed", String(button.dataset.format === format));
  });
  if (fix) {
    box.hidden = false;
    say(by("walk-title"), `Tag ${store.tagName(id)}`);
    const edge = fix.at_edge ? ", perhaps farther" : "";
    say(by("walk-sure"), `within ${metres(fix.radius95_m)} (95\u202f%)${edge}`);
    say(by("walk-place"), fix.readout[format] ?? fix.readout.decimal);
    say(by("walk-way"), wayTo([fix.longitude_deg, fix.latitude_deg]));
    return;
  }
  const best = strongestPulse(id);
  if (best === null) {
    box.hidden = true;
    return;
  }
  box.hidden = false;
  const turns = store.bearings.filter((one) => one.tag_id === id && one.accepted);
  const last = turns.at(-1);
  say(by("walk-title"), `Tag ${store.tagName(id)}: strongest signal`);
  say(
    by("walk-sure"),
    last
      ? `bearing ${Math.round(last.bearing_deg)}° ${compass(last.bearing_deg)}; turn at another place to cross it`
      : "turn on the spot for a bearing",
  );
  const key = best.join();
  if (strongest?.key === key) {
    say(by("walk-place"), strongest.readout[format] ?? strongest.readout.decimal);
  } else {
    void get<Readout>(`/readout?latitude_deg=${best[1]}&longitude_deg=${best[0]}`).then((readout) => {
      strongest = { key, readout };
      say(by("walk-place"), readout[format] ?? readout.decimal);
    }, () => undefined); // the server is away: the page asks again when it is back
  }
  say(by("walk-way"), wayTo(best));
}

function strongestPulse(id: number): LonLat | null {
  const [tag, snr, lat, lon] = (["tag", "snr", "lat", "lon"] as const).map((name) => store.pulses.get(name)) as [
    Float64Array,
    Float64Array,
    Float64Array,
    Float64Array,
  ];
  let best = -1;
  for (let place = 0; place < store.shown(); place += 1) {
    if (tag[place] !== id || !Number.isFinite(lat[place]!)) continue;
    if (best < 0 || snr[place]! > snr[best]!) best = place;
  }
  return best < 0 ? null : [lon[best]!, lat[best]!];
}

/** From where the drone took off: there the people stand. */
function wayTo(place: LonLat): string {
  const { track } = store;
  if (!track.count) return "";
  const start: LonLat = [track.lon[0]!, track.lat[0]!];
  const far = distanceM(start, place);
  const way = bearingDeg(start, place);
  return `${metres(far)} ${compass(way)} (${Math.round(way)}°) of the take-off`;
}

function spelled(): string {
  const place = by("walk-place").textContent ?? "";
  return `${by("walk-title").textContent}. ${place.split("").join(" ").replaceAll(".", "point").replaceAll("-", "minus")}. ${by("walk-way").textContent}`;
}

function copyPlace(): void {
  const text = by("walk-place").textContent ?? "";
  void navigator.clipboard?.writeText(text).then(
    () => toast("Copied", 6),
    () => toast("This browser does not let the page copy", 5),
  );
}

// ------------------------------------------------------------------- legend, layers, replay

function legend(): HTMLElement {
  const ramp = h("div", { class: "ramp" });
  ramp.style.background = `linear-gradient(to right, ${gradient().join(",")})`;
  return h(
    "div",
    { class: "legend", role: "img", "aria-label": `Pulse strength from ${SNR_LOW} to ${SNR_HIGH} decibel` },
    h("span", {}, `${SNR_LOW}`),
    ramp,
    h("span", {}, `${SNR_HIGH}\u202fdB`),
  );
}

function layerBox(): HTMLElement {
  const names: [keyof Layers, string][] = [
    ["track", "Track"],
    ["pulses", "Pulses"],
    ["rose", "Pulse rose"],
    ["bearings", "Bearings, 90\u202f%"],
    ["regions", "Position, 50/95\u202f%"],
    ["strength", "Strongest signal"],
  ];
  const boxes = names.map(([name, label]) => {
    const box = h("input", {
      type: "checkbox",
      id: `layer-${name}`,
      checked: name !== "strength",
      onchange: () => view.setLayer(name, box.checked),
    });
    return h("label", {}, box, label);
  });
  return h(
    "details",
    { class: "layers" },
    h("summary", {}, "Layers"),
    ...boxes,
    h("label", { class: "basemap" }, "Map", h("select", { id: "basemap" }, h("option", { value: "" }, "none: grid"))),
    h(
      "div",
      { class: "layer-actions" },
      h("button", { id: "fit", onclick: () => view.fit() }, "Whole flight"),
      h("button", { id: "follow", onclick: toggleFollow, "aria-pressed": "true" }, "Follow"),
    ),
  );
}

function toggleFollow(): void {
  view.follow = !view.follow;
  drawFollow();
  view.drawTrack();
}

function drawFollow(): void {
  by("follow").setAttribute("aria-pressed", String(view.follow));
}

function offerMaps(choices: Choices): void {
  const select = by("basemap") as HTMLSelectElement;
  for (const file of choices.maps) {
    select.append(h("option", { value: file.name, disabled: file.fault !== null }, file.fault ? `${file.name}: ${file.fault}` : file.name));
  }
  select.onchange = () => void view.setBasemap(choices.maps.find((one) => one.name === select.value) ?? null);
  const first = choices.maps.find((one) => !one.fault);
  if (first) {
    select.value = first.name;
    void view.setBasemap(first);
  }
}

function replayBar(): HTMLElement {
  const slider = h("input", {
    id: "replay-slider",
    type: "range",
    min: "0",
    max: "1000",
    value: "1000",
    "aria-label": "Time in the flight",
    oninput: () => seek(Number(slider.value) / 1000),
  });
  return h(
    "div",
    { id: "replay", class: "replay", hidden: true },
    h("button", { id: "replay-play", onclick: togglePlay }, "Play"),
    slider,
    h("span", { id: "replay-time" }),
    h("button", { id: "replay-live", onclick: backToLive }, "Back to live"),
  );
}

let playing: ReturnType<typeof setInterval> | null = null;

function seek(part: number): void {
  const review = store.review;
  if (!review) return;
  const whole = review.end_time_ns - review.start_time_ns;
  store.seek(part >= 1 ? Infinity : review.start_time_ns + part * whole);
}

function togglePlay(): void {
  if (playing !== null) {
    stopPlaying();
    return;
  }
  const slider = by("replay-slider") as HTMLInputElement;
  if (Number(slider.value) >= 1000) slider.value = "0";
  say(by("replay-play"), "Pause");
  // A whole flight in 20 s, ten steps a second.
  playing = setInterval(() => {
    slider.value = String(Number(slider.value) + 5);
    seek(Number(slider.value) / 1000);
    if (Number(slider.value) >= 1000) stopPlaying();
  }, 100);
}

function stopPlaying(): void {
  if (playing !== null) clearInterval(playing);
  playing = null;
  say(by("replay-play"), "Play");
}

function backToLive(): void {
  stopPlaying();
  store.backToLive();
  store.emit("selection");
  store.emit("state");
}

function drawReplay(): void {
  const review = store.review;
  by("replay").hidden = review === null;
  if (!review) return;
  const now = Math.min(store.until, review.end_time_ns);
  const past = (now - review.start_time_ns) / 1e9;
  say(by("replay-time"), `${Math.floor(past / 60)}:${String(Math.floor(past % 60)).padStart(2, "0")}`);
  if (!Number.isFinite(store.until)) (by("replay-slider") as HTMLInputElement).value = "1000";
}
