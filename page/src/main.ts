/** The page: header, tabs, keys, and the views. */

import "maplibre-gl/dist/maplibre-gl.css";
import { buildCheck, showCheck } from "./settings/checklist";
import { act, buildFly, mapView } from "./flying/fly";
import { send } from "./shared/api";
import { fromServer, language, listed, missing, t, verbatim, type Words } from "./shared/i18n";
import { drawVehicles, STATES, unserved } from "./flying/vehicles";
import { append, by, fill, h, say } from "./shared/dom";
import { all, buildFlights } from "./past/flights";
import { dateTime, fixed, percent, span } from "./shared/format";
import { motionBar } from "./flying/motion";
import { buildLog, showLog } from "./flying/log";
import { buildPlots, recolourPlots, showPlots } from "./flying/plots";
import { buildSetup } from "./settings/setup";
import { recall, remember } from "./shared/remembered";
import { setSpeaking, speaking } from "./shared/speech";
import { store } from "./store";
import type { State } from "./types";
import { offerSetUp } from "./settings/wizard";

const VIEWS: [string, Words][] = [
  ["fly", t("common.fly")],
  ["plots", t("main.plots")],
  ["setup", t("main.set_up")],
  ["log", t("common.log")],
  ["flights", t("common.flights")],
  ["check", t("main.check")],
];

function buildHeader(): void {
  const tabs = VIEWS.map(([name, label], place) =>
    h(
      "button",
      {
        id: `tab-${name}`,
        role: "tab",
        class: "tab",
        "aria-controls": `view-${name}`,
        "aria-keyshortcuts": String(place + 1),
        onclick: () => show(name),
      },
      label,
    ),
  );
  const list = h("div", { class: "tabs", role: "tablist", "aria-label": t("main.views") }, ...tabs);
  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = tabs.findIndex((tab) => tab.getAttribute("aria-selected") === "true");
    const next = tabs[(at + step + tabs.length) % tabs.length]!;
    next.focus();
    next.click();
  });
  append(by("top"), [
    h("h1", { class: "brand", translate: "no" }, verbatim("uavrt")),
    list,
    h(
      "div",
      { class: "chips", role: "group", "aria-label": t("main.state") },
      h("nav", { id: "vehicles", class: "vehicles", "aria-label": t("main.vehicles"), hidden: true }),
      h("button", { id: "take-command", class: "chip warn", hidden: true, onclick: () => void send("POST", "/commander", {}) }, t("main.take_command")),
      h(
        "div",
        { class: "states" },
        h("span", { id: "chip-state", class: "chip" }),
        h("span", { id: "chip-computer", class: "chip", title: t("main.computer_hint") }),
        h("span", { id: "chip-link", class: "chip" }),
        h("span", { id: "chip-drone", class: "chip" }),
        h("span", { id: "chip-flight", class: "chip" }),
      ),
    ),
    h(
      "div",
      { class: "tools" },
      h("button", { id: "voice", class: "tool", "aria-pressed": "false", title: t("main.voice_hint"), onclick: toggleVoice }, t("main.voice")),
      h("button", { id: "theme", class: "tool", title: t("main.theme_hint"), onclick: toggleTheme }, document.documentElement.dataset.theme === "dark" ? t("main.light") : t("main.dark")),
    ),
  ]);
}

export function show(name: string): void {
  for (const [other] of VIEWS) {
    const chosen = other === name;
    by(`view-${other}`).hidden = !chosen;
    by(`tab-${other}`).setAttribute("aria-selected", String(chosen));
    by(`tab-${other}`).tabIndex = chosen ? 0 : -1;
  }
  if (location.hash !== `#${name}`) history.replaceState(null, "", `#${name}`);
  showPlots(name === "plots");
  showLog(name === "log");
  void showCheck(name === "check");
  if (name === "flights") void all();
  if (name === "fly") mapView().resize();
}

function drawHeader(): void {
  const state = store.state;
  const offline = by("banner");
  const silent = store.online && !store.review && droneSilent(state);
  const others = store.online && !!state && (state.drone.foreign || (!state.drone.present && unserved().length > 0));
  offline.hidden = store.online && !store.review && !state?.flight.fault && !state?.connection.error && !silent && !others;
  if (!store.online) say(offline, t("main.station_silent"));
  else if (state?.flight.fault) say(offline, fromServer(state.flight.fault));
  else if (state?.connection.error) say(offline, fromServer(state.connection.error));
  else if (others && state) drawOthers(offline, state);
  else if (silent) say(offline, t("main.no_contact"));
  else if (store.review) say(offline, pastFlight(store.review, store.other));
  offline.className = store.online && store.review && !state?.flight.fault ? "info" : "";
  if (!state) return;
  drawVehicles();
  by("take-command").hidden = !store.looksOn();
  const mode = state.drone.present ? (STATES[state.drone.state ?? ""] ?? t("main.drone_connected")) : t("main.no_drone");
  chip("state", mode, state.drone.present ? (state.drone.state === "detecting" ? "live" : "good") : "bad");
  const loss = state.link.loss;
  const delay = state.link.round_trip_s;
  const radio = state.link.radio;
  const link = loss === null
    ? t("main.no_link")
    : listed(
        t("main.loss", { share: percent(loss) }),
        fixed(delay === null ? null : delay * 1000, 0, "ms"),
        radio && t("main.radio", { here: radio.rssi, there: radio.remote_rssi }),
      );
  chip("link", link, loss === null ? "bad" : loss > 0.25 ? "warn" : "good");
  // The drone flies on while a past flight is looked at.
  const pose = store.review ? state.vehicle : store.pose;
  const battery = state.battery_percent === null ? "" : fixed(state.battery_percent, 0, "%");
  const place = pose ? listed(fixed(pose.altitude_relative_m, 0, "m"), verbatim(`${fixed(pose.heading_deg, 0)}°`), battery) : t("main.no_position");
  chip("drone", place, pose ? "good" : "warn");
  const flight = state.flight;
  const length = flight.ended ? t("main.ended") : span((store.nowNs() - flight.start_time_ns) / 1e9);
  const pulses = t("common.pulse_count", { pulses: flight.pulses });
  chip("flight", flight.flight_id ? listed(length, pulses) : t("main.no_flight"), flight.flight_id && !flight.ended ? "live" : "");
  const warm = state.drone.cpu_temperature_c;
  by("chip-computer").hidden = warm === null;
  // A Raspberry Pi 5 slows itself down from 80 °C on, and more from 85 °C on.
  if (warm !== null) chip("computer", fixed(warm, 0, "°C"), warm >= 85 ? "bad" : warm >= 75 ? "warn" : "good");
}

function pastFlight(review: NonNullable<typeof store.review>, other: typeof store.other): Words {
  const start = dateTime(review.start_time_ns);
  return other ? t("main.past_flight_and_other", { start, other: dateTime(other.summary.start_time_ns) }) : t("main.past_flight", { start });
}

/** Another vehicle is heard: it is named, and taken only when the operator says so. */
function drawOthers(banner: HTMLElement, state: State): void {
  const ours = state.drone.system_id ?? 0;
  const choices = state.drone.foreign ? [ours] : unserved();
  const text = state.drone.foreign
    ? t("main.foreign_autopilot", { number: ours })
    : t("main.no_contact_with_vehicle", { number: ours });
  const key = `${text}${choices.join()}`;
  if (banner.dataset.key === key && banner.querySelector("button")) return;
  banner.dataset.key = key;
  fill(
    banner,
    text,
    ...choices.map((number) =>
      h(
        "button",
        { class: "take-vehicle", "data-vehicle": number, onclick: () => void send("POST", "/vehicle", { system_id: number }) },
        state.drone.foreign ? t("main.use_this_vehicle") : t("main.change_to_vehicle", { number }),
      ),
    ),
  );
}

/** Nothing comes from a drone that is in flight as far as is known here. */
function droneSilent(state: State | null): boolean {
  return !!state?.connection.open && !state.drone.present && !!state.flight.flight_id && !state.flight.ended;
}

function chip(name: string, words: Words, kind: string): void {
  const element = by(`chip-${name}`);
  say(element, words);
  element.className = `chip ${kind}`;
}

function toggleTheme(): void {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
}

function setTheme(chosen: string): void {
  document.documentElement.dataset.theme = chosen;
  remember("theme", chosen);
  say(by("theme"), chosen === "dark" ? t("main.light") : t("main.dark"));
  mapView().recolour();
  recolourPlots();
  store.emit("selection"); // the tags' colours are others
}

function toggleVoice(): void {
  setSpeaking(!speaking());
  by("voice").setAttribute("aria-pressed", String(speaking()));
}

/** With Shift held, which Caps Lock is not; but for a mark, which harms nothing. */
const ACTION_KEYS: Record<string, string> = { T: "send_tags", S: "start", X: "stop", C: "capture" };

function keys(event: KeyboardEvent): void {
  const target = event.target as HTMLElement;
  if (event.ctrlKey || event.metaKey || event.altKey || target.matches("input, select, textarea")) return;
  const place = Number(event.key);
  // Caps Lock changes the reported letter, not the key.
  const key = event.key.length === 1 ? (event.shiftKey ? event.key.toUpperCase() : event.key.toLowerCase()) : event.key;
  if (place >= 1 && place <= VIEWS.length) show(VIEWS[place - 1]![0]);
  else if (event.shiftKey && key in ACTION_KEYS) void act(ACTION_KEYS[key]!);
  else if (key === "m") void act("mark");
  else if (key === "d") toggleTheme();
  else if (key === "v") toggleVoice();
  else if (key === "f") mapView().fit();
  else return;
  event.preventDefault();
}

// Before the map is made: its ground has the theme's colour.
document.documentElement.dataset.theme = recall("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
document.documentElement.lang = language;
document.title = t("main.title");
say(document.querySelector(".skip")!, t("main.skip"));
buildHeader();
by("banner").after(motionBar());
buildFly(show);
buildPlots();
buildSetup();
buildLog();
buildFlights(show);
buildCheck();
store.on(["state", "online", "pose", "reset", "other"], drawHeader);
document.addEventListener("keydown", keys);
const wanted = location.hash.slice(1);
show(VIEWS.some(([name]) => name === wanted) ? wanted : "fly");
fill(by("banner"), t("main.connecting"));
by("banner").hidden = false;
store.connect();
void offerSetUp();
// For the tests, which look at the map's frames.
(window as unknown as { uavrt: unknown }).uavrt = { store, fromServer, missing, map: () => (mapView() as unknown as { map: unknown }).map };
