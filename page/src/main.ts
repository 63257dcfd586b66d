/** The page: header, tabs, keys, and the views. */

import "maplibre-gl/dist/maplibre-gl.css";
import { buildCheck, showCheck } from "./check";
import { act, buildFly, mapView } from "./fly";
import { send } from "./api";
import { drawVehicles, unserved } from "./vehicles";
import { append, by, fill, h, say } from "./dom";
import { all, buildFlights } from "./flights";
import { dateTime, fixed, span } from "./format";
import { language, missing, translated } from "./i18n";
import { motionBar } from "./motion";
import { buildLog, showLog } from "./log";
import { buildPlots, recolourPlots, showPlots } from "./plots";
import { buildSetup } from "./setup";
import { setSpeaking, speaking } from "./speech";
import { store } from "./store";
import type { State } from "./types";
import { offerSetUp } from "./wizard";

const VIEWS: [string, string][] = [
  ["fly", "Fly"],
  ["plots", "Plots"],
  ["setup", "Set-up"],
  ["log", "Log"],
  ["flights", "Flights"],
  ["check", "Check"],
];
const STATES: Record<string, string> = {
  idle: "Idle",
  receiving_tags: "Receiving tags",
  has_tags: "Ready",
  detecting: "Detecting",
  capturing: "Capturing",
};

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
  const list = h("div", { class: "tabs", role: "tablist", "aria-label": "Views" }, ...tabs);
  list.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = tabs.findIndex((tab) => tab.getAttribute("aria-selected") === "true");
    const next = tabs[(at + step + tabs.length) % tabs.length]!;
    next.focus();
    next.click();
  });
  append(by("top"), [
    h("h1", { class: "brand", translate: "no" }, "uavrt"),
    list,
    h(
      "div",
      { class: "chips", role: "group", "aria-label": "State" },
      h("nav", { id: "vehicles", class: "vehicles", "aria-label": "Vehicles", hidden: true }),
      h("button", { id: "take-command", class: "chip warn", hidden: true, onclick: () => void send("POST", "/commander", {}) }, "View only: take command"),
      h(
        "div",
        { class: "states" },
        h("span", { id: "chip-state", class: "chip" }),
        h("span", { id: "chip-computer", class: "chip", title: "Processor load of the drone's computer" }),
        h("span", { id: "chip-link", class: "chip" }),
        h("span", { id: "chip-drone", class: "chip" }),
        h("span", { id: "chip-flight", class: "chip" }),
      ),
    ),
    h(
      "div",
      { class: "tools" },
      h("button", { id: "voice", class: "tool", "aria-pressed": "false", title: "Speak warnings (V)", onclick: toggleVoice }, "Voice"),
      h("button", { id: "theme", class: "tool", title: "Dark or light (D)", onclick: toggleTheme }, document.documentElement.dataset.theme === "dark" ? "Light" : "Dark"),
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
  showCheck(name === "check");
  if (name === "flights") void all();
  if (name === "fly") mapView().resize();
}

function drawHeader(): void {
  const state = store.state;
  const offline = by("banner");
  const silent = store.online && !store.review && droneSilent(state);
  const others = store.online && !!state && (state.drone.foreign || (!state.drone.present && unserved().length > 0));
  offline.hidden = store.online && !store.review && !state?.flight.fault && !state?.connection.error && !silent && !others;
  if (!store.online) say(offline, "The ground station does not answer. Received data are safe; this page reconnects by itself.");
  else if (state?.flight.fault) say(offline, state.flight.fault);
  else if (state?.connection.error) say(offline, state.connection.error);
  else if (others && state) drawOthers(offline, state);
  else if (silent) say(offline, "No contact with the drone. It keeps recording and sends when contact returns.");
  else if (store.review) say(offline, `Past flight of ${dateTime(store.review.start_time_ns)}${store.other ? `; dashed: flight of ${dateTime(store.other.summary.start_time_ns)}` : ""}`);
  offline.className = store.online && store.review && !state?.flight.fault ? "info" : "";
  if (!state) return;
  drawVehicles();
  by("take-command").hidden = !store.looksOn();
  const mode = state.drone.present ? (STATES[state.drone.state ?? ""] ?? "Drone connected") : "No drone";
  chip("state", mode, state.drone.present ? (state.drone.state === "detecting" ? "live" : "good") : "bad");
  const loss = state.link.loss;
  const delay = state.link.round_trip_s;
  const radio = state.link.radio ? ` · radio ${state.link.radio.rssi}/${state.link.radio.remote_rssi}` : "";
  const link = loss === null ? "no link" : `loss ${fixed(loss * 100, 0, "%")} · ${fixed(delay === null ? null : delay * 1000, 0, "ms")}${radio}`;
  chip("link", link, loss === null ? "bad" : loss > 0.25 ? "warn" : "good");
  // The drone flies on while a past flight is looked at.
  const pose = store.review ? state.vehicle : store.pose;
  const battery = state.battery_percent === null ? "" : ` · ${state.battery_percent}\u202f%`;
  chip("drone", pose ? `${fixed(pose.altitude_relative_m, 0, "m")} · ${fixed(pose.heading_deg, 0)}°${battery}` : "no position", pose ? "good" : "warn");
  const flight = state.flight;
  const length = (store.nowNs() - flight.start_time_ns) / 1e9;
  chip("flight", flight.flight_id ? `${flight.ended ? "ended" : span(length)} · ${flight.pulses} pulses` : "no flight", flight.flight_id && !flight.ended ? "live" : "");
  const warm = state.drone.cpu_temperature_c;
  by("chip-computer").hidden = warm === null;
  // A Raspberry Pi 5 slows itself down from 80 °C on, and more from 85 °C on.
  if (warm !== null) chip("computer", fixed(warm, 0, "°C"), warm >= 85 ? "bad" : warm >= 75 ? "warn" : "good");
}

/** Another vehicle is heard: it is named, and taken only when the operator says so. */
function drawOthers(banner: HTMLElement, state: State): void {
  const ours = state.drone.system_id;
  const choices = state.drone.foreign ? [ours!] : unserved();
  const text = state.drone.foreign
    ? `Another autopilot answers as vehicle ${ours}. Give each a number of its own (MAV_SYS_ID).`
    : `No contact with vehicle ${ours}. This page stays with it.`;
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
        state.drone.foreign ? "Use this one" : `Change to vehicle ${number}`,
      ),
    ),
  );
}

/** Nothing comes from a drone that is in flight as far as is known here. */
function droneSilent(state: State | null): boolean {
  return !!state?.connection.open && !state.drone.present && !!state.flight.flight_id && !state.flight.ended;
}

function chip(name: string, text: string, kind: string): void {
  const element = by(`chip-${name}`);
  say(element, text);
  element.className = `chip ${kind}`;
}

function toggleTheme(): void {
  setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
}

function setTheme(chosen: string): void {
  document.documentElement.dataset.theme = chosen;
  try {
    localStorage.setItem("theme", chosen);
  } catch {
    // Private windows keep nothing; it is only a colour.
  }
  say(by("theme"), chosen === "dark" ? "Light" : "Dark");
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

let theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
try {
  theme = localStorage.getItem("theme") ?? theme;
} catch {
  // As above.
}
// Before the map is made: its ground has the theme's colour.
document.documentElement.dataset.theme = theme;
document.documentElement.lang = language;
document.title = translated(document.title);
say(document.querySelector(".skip")!, "Skip to the view");
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
fill(by("banner"), "Connecting …");
by("banner").hidden = false;
store.connect();
void offerSetUp();
// For the tests, which look at the map's frames.
(window as unknown as { uavrt: unknown }).uavrt = { store, translated, missing, map: () => (mapView() as unknown as { map: unknown }).map };
