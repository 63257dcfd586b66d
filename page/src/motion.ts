/**
 * Moving the drone: what it is to do, what it would fly, the confirmation, and taking it back.
 * The drone decides; the ground station's server carries the words, as for `uavrt fly`.
 */

import { PAGE, reasonOf, send } from "./api";
import { beforeBox, openBefore, setPlan, type Plan } from "./before";
import { by, fill, h, say, svg } from "./dom";
import { metres } from "./format";
import type { LonLat } from "./geo";
import { toast } from "./notice";
import { store } from "./store";
import { catchTaps } from "./tap";
import type { Motion } from "./types";
import type { FlightMap, MotionDrawing } from "./view";

type Kind = "rotate" | "goto" | "survey" | "search" | "hold" | "return" | "takeoff";
type Place = [number, number];
/** A person or a building that came with an imported area. */
interface KeepOut {
  places: Place[];
  radius_m: number | null;
  outline: Place[];
}
interface Area {
  places: Place[];
  keep_out: KeepOut[];
}

const KINDS: [Kind, string][] = [
  ["rotate", "Turn here"],
  ["goto", "Go there"],
  ["survey", "Survey"],
  ["search", "Search"],
  ["hold", "Hold"],
  ["return", "Return"],
  ["takeoff", "Take off"],
];
const HOLD_MS = 1000;
const UPLOAD = "As the vehicle's mission";
/** A second tap within this replaces the mission that the vehicle holds. */
const SURE_MS = 5000;
const MOST_CORNERS = 20;
/** A search keeps so far from where animals are; other motions only show it. */
const KEEP_AWAY_M = 30;
const STANDINGS: Record<Motion["standing"], string> = {
  out: "The pilot flies",
  confirmed: "Confirmed",
  "in command": "uavrt flies",
};

let view: FlightMap;
let kind: Kind = "rotate";
let open = false;
let goal: Place | null = null;
let area: Place[] = [];
let keepOut: KeepOut[] = [];
let way: Place[] = [];
let planTicket = 0;
let asking = false;

/** The strip below the header: who flies and why, what is left, and *Take back*, in every view. */
export function motionBar(): HTMLElement {
  return h(
    "div",
    { id: "motion-bar", class: "motion-bar", hidden: true, role: "region", "aria-label": "Motion" },
    h("div", { id: "energy", class: "energy" }),
    h("div", { class: "motion-status" }, h("strong", { id: "motion-standing" }), h("span", { id: "motion-text", role: "status" })),
    h("button", { id: "take-back", class: "take-back", onclick: () => void takeBack() }, "Take back"),
  );
}

/** The panel next to the map. */
export function motionPanel(made: FlightMap): HTMLElement {
  view = made;
  const kinds = KINDS.map(([name, label]) =>
    h("button", { id: `move-${name}`, class: "kind", "aria-pressed": String(name === kind), onclick: () => choose(name) }, label),
  );
  const number = (id: string, label: string, start: string, empty = "") =>
    h("label", { id: `${id}-row` }, h("span", {}, label), h("input", { id, value: start, placeholder: empty, inputmode: "decimal", autocomplete: "off", onchange: () => void replan() }));
  const panel = h(
    "div",
    { id: "move", class: "move", hidden: true },
    h("p", { id: "move-none", class: "note" }, "This drone does not offer motion. Set guidance.enabled = true in its uavrt.toml. Without a key only the simulator moves."),
    h(
      "div",
      { id: "move-form", class: "move-form" },
      h("div", { class: "kinds", role: "group", "aria-label": "What to fly" }, ...kinds),
      h("p", { class: "note" }, h("span", { id: "move-hint" }), " ", h("span", { id: "move-plan", class: "move-plan" })),
      h("p", { id: "move-fault", class: "fault-line", role: "alert" }),
      h(
        "div",
        { id: "area-row", class: "area-row" },
        h("button", { id: "area-draw", "aria-pressed": "false", onclick: () => draw() }, "Draw"),
        h("button", { id: "area-circle", "aria-pressed": "false", onclick: () => drawCircle() }, "Circle"),
        areaImport(),
        h("button", { id: "area-clear", onclick: () => clearArea() }, "Clear"),
      ),
      h("div", { class: "fields" },
      h(
        "label",
        { id: "move-pattern-row" },
        "How",
        h(
          "select",
          { id: "move-pattern", onchange: () => void replan() },
          h("option", { value: "lines" }, "line by line"),
          h("option", { value: "around" }, "around the area"),
          h("option", { value: "points" }, "turns at places"),
        ),
      ),
      number("move-spacing", "Spacing, m", "60"),
      number("move-seconds", "Time of a full turn, s", "60"),
      h(
        "label",
        { id: "move-left-row" },
        "To the",
        h("select", { id: "move-left" }, h("option", { value: "right" }, "right"), h("option", { value: "left" }, "left")),
      ),
      number("move-radius", "Radius around the drone, m", "300"),
      number("move-minutes", "Time limit, minutes", "15"),
      number("move-wish", "Target accuracy, m", "25"),
      number("move-height", "Height, m", "", "unchanged"),
      ),
      beforeBox(view),
      h("button", { id: "move-ask", class: "primary", onclick: () => void ask() }, "Ask the drone"),
      h("button", { id: "move-upload", onclick: () => void upload() }, UPLOAD),
    ),
    h(
      "div",
      { id: "offer", class: "offer", hidden: true, role: "group", "aria-label": "The drone's offer" },
      h("strong", {}, "The drone will"),
      h("p", { id: "offer-text" }),
      h("p", { class: "note" }, "To take over, choose Pause, Position, Return or Land. On PX4, choosing Hold changes nothing."),
      h("label", { class: "check" }, h("input", { id: "sticks-unseen", type: "checkbox" }), "No RC link: I understand"),
      holdButton(),
      h("button", { id: "offer-leave", onclick: () => leave() }, "Cancel"),
    ),
  );
  store.on(["state", "online"], drawMotion);
  store.on(["estimates", "selection"], drawOnMap);
  return panel;
}

/** Show the panel, or the tags in its place. */
export function openMotion(shown: boolean): void {
  open = shown;
  by("move").hidden = !shown;
  openBefore(shown);
  if (!shown) catchTaps(null);
  else choose(kind === "search" || area.length || goal ? kind : "rotate");
  drawOnMap();
}

// ------------------------------------------------------------------- what to fly

function choose(name: Kind): void {
  kind = name;
  for (const [other] of KINDS) by(`move-${other}`).setAttribute("aria-pressed", String(other === name));
  const survey = name === "survey";
  by("area-row").hidden = !survey && name !== "search";
  by("move-pattern-row").hidden = !survey;
  by("move-height-row").hidden = name === "return";
  say(by("move-fault"), "");
  catchTaps(null);
  if (name === "goto") catchTaps((at) => setGoal(at));
  if ((survey || name === "search") && area.length === 0) draw();
  drawShape();
  void replan();
}

function drawShape(): void {
  const survey = kind === "survey";
  const pattern = value("move-pattern");
  by("move-upload").hidden = !survey || pattern === "points";
  by("move-spacing-row").hidden = !survey || pattern === "around";
  const turns = kind === "rotate" || (survey && pattern === "points");
  by("move-seconds-row").hidden = by("move-left-row").hidden = !turns;
  by("move-minutes-row").hidden = by("move-wish-row").hidden = kind !== "search";
  by("move-radius-row").hidden = kind !== "search" || area.length > 0;
  const hints: Record<Kind, string> = {
    rotate: "A full turn where it is.",
    goto: goal ? `To ${goal[0].toFixed(6)}, ${goal[1].toFixed(6)}` : "Tap the destination on the map.",
    survey: area.length < 3 ? `Tap corners (${area.length} of 3 or more), or import.` : `${area.length} corners${kept()}.`,
    search: area.length ? `Within ${area.length} corners${kept()}.` : "Around the drone, or tap corners.",
    hold: "Stay where it is.",
    return: "Home, by the autopilot's own mode.",
    takeoff: "Straight up to the height below, after the pilot has armed.",
  };
  say(by("move-hint"), hints[kind]);
}

/** Kept out of by every motion until the area is cleared. */
function kept(): string {
  return keepOut.length ? `, ${keepOut.length} excluded` : "";
}

function setGoal(at: LonLat): void {
  goal = [at[1], at[0]];
  drawShape();
  void replan();
}

function draw(): void {
  by("area-draw").setAttribute("aria-pressed", "true");
  by("area-circle").setAttribute("aria-pressed", "false");
  catchTaps((at) => {
    if (area.length >= MOST_CORNERS) toast(`An area has ${MOST_CORNERS} corners at most`, 5);
    else setArea([...area, [at[1], at[0]]]);
  });
}

/** Its middle, then a place on it. */
function drawCircle(): void {
  by("area-draw").setAttribute("aria-pressed", "false");
  by("area-circle").setAttribute("aria-pressed", "true");
  toast("Tap the middle, then a place on the circle", 6);
  let middle: LonLat | null = null;
  catchTaps((at) => {
    if (middle === null) {
      middle = at;
      setArea([[at[1], at[0]]]);
      return;
    }
    const radius = metresBetween(middle, at);
    void take(() => send<Area>("POST", "/motion/area", { center: [middle![1], middle![0]], radius_m: radius }));
    draw();
  });
}

function metresBetween(a: LonLat, b: LonLat): number {
  const east = (b[0] - a[0]) * Math.cos((a[1] * Math.PI) / 180);
  return Math.hypot(b[1] - a[1], east) * 111_195;
}

function areaImport(): HTMLElement {
  const input = h("input", {
    id: "area-import",
    type: "file",
    accept: ".geojson,.json,.kml,.plan",
    onchange: () => {
      const file = input.files?.[0];
      input.value = "";
      if (file) void take(async () => send<Area>("POST", "/motion/area", { name: file.name, text: await file.text() }), true);
    },
  });
  return h("label", { class: "file" }, "Import", input);
}

async function take(get: () => Promise<Area>, frame = false): Promise<void> {
  try {
    const got = await get();
    if (frame) keepOut = got.keep_out;
    setArea(got.places);
    if (frame) view.show(area.map(([lat, lon]) => [lon, lat]));
  } catch (error) {
    say(by("move-fault"), reasonOf(error));
  }
}

function clearArea(): void {
  keepOut = [];
  setArea([]);
}

function setArea(places: Place[]): void {
  area = places;
  if (!places.length && (kind === "survey" || kind === "search")) draw();
  drawShape();
  void replan();
}

function wish(): Record<string, unknown> {
  const height = value("move-height").trim();
  return {
    action: kind,
    places: kind === "goto" ? (goal ? [goal] : []) : kind === "survey" || kind === "search" ? area : [],
    height_m: height === "" ? null : numberIn("move-height"),
    duration_s: kind === "search" ? 60 * (numberIn("move-minutes") ?? NaN) : numberIn("move-seconds"),
    clockwise: value("move-left") === "right",
    spacing_m: numberIn("move-spacing"),
    pattern: value("move-pattern"),
    keep_out: keepOut.map(({ places, radius_m }) => ({ places, radius_m })),
    ...(kind === "search" ? { radius_m: area.length ? null : numberIn("move-radius"), wish_m: numberIn("move-wish") } : {}),
  };
}

function ready(): boolean {
  if (kind === "takeoff") return numberIn("move-height") !== null;
  if (kind === "search") return area.length === 0 || area.length >= 3;
  return kind === "goto" ? goal !== null : kind !== "survey" || area.length >= 3;
}

/** Where it would lead, by the functions that the drone plans with. */
async function replan(): Promise<void> {
  drawShape();
  const ticket = ++planTicket;
  way = [];
  tellPlan();
  say(by("move-plan"), "");
  say(by("move-fault"), "");
  drawOnMap();
  if (!ready() || !open) return;
  try {
    const found = await send<{ way: Place[]; length_m: number; farthest_m: number | null }>("POST", "/motion/plan", wish());
    if (ticket !== planTicket) return;
    way = found.way;
    const far = found.farthest_m === null ? "" : `, ${metres(found.farthest_m)} from home`;
    say(by("move-plan"), way.length > 1 ? `${metres(found.length_m)}${far}` : "");
    tellPlan();
  } catch (error) {
    if (ticket === planTicket) say(by("move-fault"), reasonOf(error));
  }
  drawOnMap();
}

/** What a map of where a tag would be heard is made of. */
function tellPlan(): void {
  const pattern = value("move-pattern");
  const turns = kind === "survey" && pattern === "points";
  setPlan(planned(pattern), kind === "search" ? "search" : turns ? "turns" : "", numberIn("move-height"));
}

function planned(pattern: string): Plan | null {
  if (kind === "goto" || (kind === "survey" && pattern === "points")) return way.length > 1 ? { way } : null;
  if (area.length < 3) return null;
  if (kind === "search") return { outline: area };
  if (kind !== "survey") return null;
  return pattern === "around" ? { way: [...area, area[0]!] } : { outline: area, spacing_m: numberIn("move-spacing") };
}

// ------------------------------------------------------------------- ask, confirm, take back

async function ask(): Promise<void> {
  if (store.looksOn()) {
    say(by("move-fault"), "Another page has command. Take command first");
    return;
  }
  if (!ready()) {
    say(by("move-fault"), kind === "goto" ? "Tap the destination on the map" : kind === "takeoff" ? "Give a height" : "An area has three corners or more");
    return;
  }
  asking = true;
  drawMotion();
  say(by("move-fault"), "");
  (by("sticks-unseen") as HTMLInputElement).checked = false;
  try {
    await send("POST", "/motion/ask", wish());
  } catch (error) {
    say(by("move-fault"), reasonOf(error));
  } finally {
    asking = false;
    drawMotion();
  }
}

let sure: ReturnType<typeof setTimeout> | null = null;

/** The survey into the autopilot: nothing moves, a pilot starts it. */
async function upload(): Promise<void> {
  const button = by("move-upload");
  if (store.looksOn()) {
    say(by("move-fault"), "Another page has command. Take command first");
    return;
  }
  if (numberIn("move-height") === null || !ready()) {
    say(by("move-fault"), "A mission needs an area and a height");
    return;
  }
  if (sure === null) {
    say(button, "Replace the mission in the autopilot?");
    sure = setTimeout(() => {
      sure = null;
      say(button, UPLOAD);
    }, SURE_MS);
    return;
  }
  clearTimeout(sure);
  sure = null;
  say(by("move-fault"), "");
  say(button, "Sending …");
  button.classList.add("busy");
  try {
    const done = await send<{ items: number }>("POST", "/motion/upload", wish());
    toast(`The autopilot holds the survey: ${done.items} items, verified. A pilot starts it.`, 5);
  } catch (error) {
    say(by("move-fault"), reasonOf(error));
  } finally {
    button.classList.remove("busy");
    say(button, UPLOAD);
  }
}

let left = 0;

function leave(): void {
  left = store.state?.motion?.offer?.order_id ?? 0;
  drawMotion();
}

async function confirm(): Promise<void> {
  const offer = store.state?.motion?.offer;
  if (!offer) return;
  const unseen = (by("sticks-unseen") as HTMLInputElement).checked;
  left = offer.order_id;
  drawMotion();
  try {
    await send("POST", "/motion/confirm", { order_id: offer.order_id, sticks_unseen: unseen });
    catchTaps(null);
  } catch (error) {
    say(by("move-fault"), reasonOf(error));
  }
}

async function takeBack(): Promise<void> {
  const button = by("take-back");
  button.classList.add("busy");
  try {
    await send("POST", "/motion/stop", {});
    toast("Taken back: the drone stops. The pilot flies.", 5);
  } catch (error) {
    toast(`Not taken back: ${reasonOf(error)}. Use the remote control.`, 2);
  } finally {
    button.classList.remove("busy");
  }
}

/** A button that counts only when it is held for a second: nothing moves by a slip. */
function holdButton(): HTMLElement {
  const button = h("button", { id: "hold-to-fly", class: "hold" }, h("span", { class: "hold-fill" }), h("span", { class: "hold-text" }, "Hold to fly"));
  let timer: ReturnType<typeof setTimeout> | null = null;
  const end = () => {
    if (timer !== null) clearTimeout(timer);
    timer = null;
    button.classList.remove("held");
  };
  const begin = () => {
    if (timer !== null) return;
    button.classList.add("held");
    timer = setTimeout(() => {
      end();
      void confirm();
    }, HOLD_MS);
  };
  button.addEventListener("pointerdown", (event) => {
    button.setPointerCapture(event.pointerId);
    begin();
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(name, end);
  button.addEventListener("contextmenu", (event) => event.preventDefault());
  button.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener("keyup", end);
  return button;
}

// ------------------------------------------------------------------- what is seen

function drawMotion(): void {
  const motion = store.state?.motion ?? null;
  by("motion-bar").hidden = motion === null;
  by("move-none").hidden = motion !== null;
  by("move-form").hidden = motion === null;
  if (!motion) {
    by("offer").hidden = true;
    return;
  }
  const bar = by("motion-bar");
  bar.dataset.standing = motion.standing;
  say(by("motion-standing"), motion.heard && store.online ? STANDINGS[motion.standing] : "No contact with the drone");
  say(by("motion-text"), motion.text);
  drawEnergy();
  const offer = motion.offer && motion.offer.page === PAGE && motion.offer.order_id !== left ? motion.offer : null;
  by("offer").hidden = offer === null;
  by("move-form").hidden = offer !== null;
  const button = by("move-ask");
  button.setAttribute("aria-disabled", String(store.looksOn() || asking));
  say(button, asking ? "Waiting for the answer …" : store.looksOn() ? "Another page has command" : "Ask the drone");
  if (offer) say(by("offer-text"), `${offer.text}. Holds for ${Math.max(0, Math.ceil(offer.left_s))}\u202fs.`);
  drawOnMap();
}

/** What is left in the battery: a ring that empties, red below the usual reserve. */
function drawEnergy(): void {
  const percent = store.state?.battery_percent ?? null;
  const box = by("energy");
  const key = String(percent);
  if (box.dataset.shown === key) return;
  box.dataset.shown = key;
  const round = 2 * Math.PI * 18;
  const part = (percent ?? 0) / 100;
  const low = percent !== null && percent <= 30;
  fill(
    box,
    svg(
      "svg",
      { viewBox: "-22 -22 44 44", width: 44, height: 44, role: "img", "aria-label": percent === null ? "Energy left: unknown" : `Energy left: ${percent} percent` },
      svg("circle", { r: 18, class: "energy-rim" }),
      svg("circle", { r: 18, class: low ? "energy-left low" : "energy-left", "stroke-dasharray": `${part * round} ${round}`, transform: "rotate(-90)" }),
    ),
    h("span", { class: "energy-text" }, percent === null ? "?" : `${percent}`),
  );
}

let drawn = "";

function drawOnMap(): void {
  const motion = store.state?.motion ?? null;
  const flown = motion?.way ?? [];
  const offered = motion?.offer?.page === PAGE ? motion.offer.way : [];
  const shown: MotionDrawing = {
    area: open && (kind === "survey" || kind === "search") ? area.map(lonLat) : [],
    way: (flown.length ? flown : open ? (offered.length ? offered : way) : []).map(lonLat),
    keepAway: open ? store.placed().map((one) => ({ at: [one.longitude_deg, one.latitude_deg], radiusM: KEEP_AWAY_M })) : [],
    keepOut: open ? keepOut.map((one) => one.outline.map(lonLat)) : [],
  };
  const key = JSON.stringify(shown);
  if (key === drawn) return;
  drawn = key;
  view.setMotion(shown);
}

function lonLat([lat, lon]: Place): LonLat {
  return [lon, lat];
}

function value(id: string): string {
  return (by(id) as HTMLInputElement | HTMLSelectElement).value;
}

function numberIn(id: string): number | null {
  const number = Number(value(id).replace(",", "."));
  return Number.isFinite(number) && value(id).trim() !== "" ? number : null;
}
