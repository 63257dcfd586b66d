/**
 * Moving the drone: what it is to do, what it would fly, the confirmation, and taking it back.
 * The drone decides; the ground station's server carries the words, as for `uavrt fly`.
 */

import { PAGE, reasonOf, send } from "../shared/api";
import { beforeBox, openBefore, setPlan, type Plan } from "./planned_coverage";
import { by, fill, h, numberOf, say, svg, valueOf } from "../shared/dom";
import { fixed, metres } from "../shared/format";
import { distanceM, type LonLat } from "../shared/geo";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";
import { catchTaps } from "./map_tap";
import type { Motion } from "../types";
import type { FlightMap, MotionDrawing } from "../map/map_view";

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

const KINDS: [Kind, Words][] = [
  ["rotate", t("motion.turn_here")],
  ["goto", t("motion.goto")],
  ["survey", t("motion.survey")],
  ["search", t("motion.search")],
  ["hold", t("motion.hold")],
  ["return", t("motion.return")],
  ["takeoff", t("motion.take_off")],
];
const HOLD_MS = 1000;
const UPLOAD = t("motion.upload");
/** A second tap within this replaces the mission that the vehicle holds. */
const SURE_MS = 5000;
const MOST_CORNERS = 20;
/** A search keeps so far from where animals are; other motions only show it. */
const KEEP_AWAY_M = 30;
const STANDINGS: Record<Motion["standing"], Words> = {
  out: t("motion.pilot_flies"),
  confirmed: t("motion.confirmed"),
  "in command": t("motion.uavrt_flies"),
};

let view: FlightMap;
let kind: Kind = "rotate";
let open = false;
let goal: Place | null = null;
let area: Place[] = [];
let keepOut: KeepOut[] = [];
let way: Place[] = [];
let planTicket = 0;
/** The last change of the area: one that was asked for before it is not taken. */
let areaTicket = 0;
let asking = false;

/** The strip below the header: who flies and why, what is left, and *Take back*, in every view. */
export function motionBar(): HTMLElement {
  return h(
    "div",
    { id: "motion-bar", class: "motion-bar", hidden: true, role: "region", "aria-label": t("motion.title") },
    h("div", { id: "energy", class: "energy" }),
    h("div", { class: "motion-status" }, h("strong", { id: "motion-standing" }), h("span", { id: "motion-text", role: "status" })),
    h("button", { id: "take-back", class: "take-back", onclick: () => void takeBack() }, t("motion.take_back")),
  );
}

/** The panel next to the map. */
export function motionPanel(made: FlightMap): HTMLElement {
  view = made;
  const kinds = KINDS.map(([name, label]) =>
    h("button", { id: `move-${name}`, class: "kind", "aria-pressed": String(name === kind), onclick: () => choose(name) }, label),
  );
  const number = (id: string, label: Words, start: string, empty: Words | "" = "") =>
    h("label", { id: `${id}-row` }, h("span", {}, label), h("input", { id, value: start, placeholder: empty, inputmode: "decimal", autocomplete: "off", onchange: () => void replan() }));
  const panel = h(
    "div",
    { id: "move", class: "move", hidden: true },
    h("p", { id: "move-none", class: "note" }, t("motion.not_offered")),
    h(
      "div",
      { id: "move-form", class: "move-form" },
      h("div", { class: "kinds", role: "group", "aria-label": t("motion.what_to_fly") }, ...kinds),
      h("p", { class: "note" }, h("span", { id: "move-hint" }), verbatim(" "), h("span", { id: "move-plan", class: "move-plan" })),
      h("p", { id: "move-fault", class: "fault-line", role: "alert" }),
      h(
        "div",
        { id: "area-row", class: "area-row" },
        h("button", { id: "area-draw", "aria-pressed": "false", onclick: () => draw() }, t("motion.draw")),
        h("button", { id: "area-circle", "aria-pressed": "false", onclick: () => drawCircle() }, t("motion.circle")),
        areaImport(),
        h("button", { id: "area-clear", onclick: () => clearArea() }, t("common.clear")),
      ),
      h("div", { class: "fields" },
      h(
        "label",
        { id: "move-pattern-row" },
        t("motion.pattern"),
        h(
          "select",
          { id: "move-pattern", onchange: () => void replan() },
          h("option", { value: "lines" }, t("motion.pattern_lines")),
          h("option", { value: "around" }, t("motion.pattern_around")),
          h("option", { value: "points" }, t("motion.pattern_points")),
        ),
      ),
      number("move-spacing", t("motion.spacing"), "60"),
      number("move-seconds", t("motion.turn_time"), "60"),
      h(
        "label",
        { id: "move-left-row" },
        t("motion.direction"),
        h("select", { id: "move-left" }, h("option", { value: "right" }, t("motion.right")), h("option", { value: "left" }, t("motion.left"))),
      ),
      number("move-radius", t("motion.radius"), "300"),
      number("move-minutes", t("motion.time_limit"), "15"),
      number("move-accuracy", t("motion.target_accuracy"), "25"),
      number("move-height", t("motion.height"), "", t("motion.unchanged")),
      ),
      beforeBox(view),
      h("button", { id: "move-ask", class: "primary", onclick: () => void ask() }, t("motion.ask")),
      h("button", { id: "move-upload", onclick: () => void upload() }, UPLOAD),
    ),
    h(
      "div",
      { id: "offer", class: "offer", hidden: true, role: "group", "aria-label": t("motion.offer_label") },
      h("strong", {}, t("motion.drone_will")),
      h("p", { id: "offer-text" }),
      h("p", { class: "note" }, t("motion.how_to_take_over")),
      h("label", { class: "check" }, h("input", { id: "sticks-unseen", type: "checkbox" }), t("motion.no_rc_link")),
      holdButton(),
      h("button", { id: "offer-leave", onclick: () => leave() }, t("motion.cancel")),
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
  const pattern = valueOf("move-pattern");
  by("move-upload").hidden = !survey || pattern === "points";
  by("move-spacing-row").hidden = !survey || pattern === "around";
  const turns = kind === "rotate" || (survey && pattern === "points");
  by("move-seconds-row").hidden = by("move-left-row").hidden = !turns;
  by("move-minutes-row").hidden = by("move-accuracy-row").hidden = kind !== "search";
  by("move-radius-row").hidden = kind !== "search" || area.length > 0;
  // What is kept out of is so for every motion until the area is cleared.
  const facts = { corners: area.length, excluded: keepOut.length };
  const hints: Record<Kind, Words> = {
    rotate: t("motion.hint_turn"),
    goto: goal ? t("motion.goal", { latitude: fixed(goal[0], 6), longitude: fixed(goal[1], 6) }) : t("motion.hint_goto"),
    survey: area.length < 3 ? t("motion.hint_survey", { corners: area.length }) : t(keepOut.length ? "motion.corners_excluded" : "motion.corners", facts),
    search: area.length ? t(keepOut.length ? "motion.corners_excluded" : "motion.corners", facts) : t("motion.hint_search"),
    hold: t("motion.hint_hold"),
    return: t("motion.hint_return"),
    takeoff: t("motion.hint_take_off"),
  };
  say(by("move-hint"), hints[kind]);
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
    if (area.length >= MOST_CORNERS) toast(t("motion.too_many_corners", { most: MOST_CORNERS }), 5);
    else setArea([...area, [at[1], at[0]]]);
  });
}

/** Its middle, then a place on it. */
function drawCircle(): void {
  by("area-draw").setAttribute("aria-pressed", "false");
  by("area-circle").setAttribute("aria-pressed", "true");
  toast(t("motion.tap_circle"), 6);
  let middle: LonLat | null = null;
  catchTaps((at) => {
    if (middle === null) {
      middle = at;
      setArea([[at[1], at[0]]]);
      return;
    }
    const radius = distanceM(middle, at);
    void take(() => send<Area>("POST", "/motion/area", { center: [middle![1], middle![0]], radius_m: radius }));
    draw();
  });
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
  return h("label", { class: "file" }, t("common.import"), input);
}

async function take(get: () => Promise<Area>, frame = false): Promise<void> {
  const ticket = ++areaTicket;
  try {
    const got = await get();
    if (ticket !== areaTicket) return;
    if (frame) keepOut = got.keep_out;
    setArea(got.places);
    if (frame) view.show(area.map(([lat, lon]) => [lon, lat]));
  } catch (error) {
    if (ticket === areaTicket) say(by("move-fault"), reasonOf(error));
  }
}

function clearArea(): void {
  keepOut = [];
  setArea([]);
}

function setArea(places: Place[]): void {
  areaTicket += 1;
  area = places;
  if (!places.length && (kind === "survey" || kind === "search")) draw();
  drawShape();
  void replan();
}

function request(): Record<string, unknown> {
  const height = valueOf("move-height").trim();
  return {
    action: kind,
    places: kind === "goto" ? (goal ? [goal] : []) : kind === "survey" || kind === "search" ? area : [],
    height_m: height === "" ? null : numberIn("move-height"),
    duration_s: kind === "search" ? 60 * (numberIn("move-minutes") ?? NaN) : numberIn("move-seconds"),
    clockwise: valueOf("move-left") === "right",
    spacing_m: numberIn("move-spacing"),
    pattern: valueOf("move-pattern"),
    keep_out: keepOut.map(({ places, radius_m }) => ({ places, radius_m })),
    ...(kind === "search" ? { radius_m: area.length ? null : numberIn("move-radius"), accuracy_m: numberIn("move-accuracy") } : {}),
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
    const found = await send<{ way: Place[]; length_m: number; farthest_m: number | null }>("POST", "/motion/plan", request());
    if (ticket !== planTicket) return;
    way = found.way;
    const length = metres(found.length_m);
    const there = found.farthest_m === null ? length : t("motion.length_and_farthest", { length, farthest: metres(found.farthest_m) });
    say(by("move-plan"), way.length > 1 ? there : "");
    tellPlan();
  } catch (error) {
    if (ticket === planTicket) say(by("move-fault"), reasonOf(error));
  }
  drawOnMap();
}

/** What a map of where a tag would be heard is made of. */
function tellPlan(): void {
  const pattern = valueOf("move-pattern");
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
  if (asking) return;
  if (store.looksOn()) {
    say(by("move-fault"), t("common.another_page_commands"));
    return;
  }
  if (!ready()) {
    say(by("move-fault"), kind === "goto" ? t("motion.goal_missing") : kind === "takeoff" ? t("motion.height_missing") : t("motion.too_few_corners"));
    return;
  }
  asking = true;
  drawMotion();
  say(by("move-fault"), "");
  (by("sticks-unseen") as HTMLInputElement).checked = false;
  try {
    await send("POST", "/motion/ask", request());
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
  if (button.classList.contains("busy")) return;
  if (store.looksOn()) {
    say(by("move-fault"), t("common.another_page_commands"));
    return;
  }
  if (numberIn("move-height") === null || !ready()) {
    say(by("move-fault"), t("motion.mission_needs"));
    return;
  }
  if (sure === null) {
    say(button, t("motion.replace_mission"));
    sure = setTimeout(() => {
      sure = null;
      say(button, UPLOAD);
    }, SURE_MS);
    return;
  }
  clearTimeout(sure);
  sure = null;
  say(by("move-fault"), "");
  say(button, t("motion.sending"));
  button.classList.add("busy");
  try {
    const done = await send<{ items: number }>("POST", "/motion/upload", request());
    toast(t("motion.uploaded", { items: done.items }), 5);
  } catch (error) {
    say(by("move-fault"), reasonOf(error));
  } finally {
    button.classList.remove("busy");
    say(button, UPLOAD);
  }
}

/** The offer that the operator has answered, and the one that is shown. */
let left = 0;
let offered = 0;

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
  left = store.state?.motion?.offer?.order_id ?? 0;
  const button = by("take-back");
  button.classList.add("busy");
  try {
    await send("POST", "/motion/stop", {});
    toast(t("motion.taken_back"), 5);
  } catch (error) {
    toast(t("motion.not_taken_back", { reason: reasonOf(error) }), 2);
  } finally {
    button.classList.remove("busy");
  }
}

/** A button that counts only when it is held for a second: nothing moves by a slip. */
function holdButton(): HTMLElement {
  const button = h("button", { id: "hold-to-fly", class: "hold" }, h("span", { class: "hold-fill" }), h("span", { class: "hold-text" }, t("motion.hold_to_fly")));
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
  say(by("motion-standing"), motion.heard && store.online ? STANDINGS[motion.standing] : t("motion.no_contact"));
  say(by("motion-text"), fromServer(motion.text));
  drawEnergy();
  const offer = motion.offer && motion.offer.page === PAGE && motion.offer.order_id !== left ? motion.offer : null;
  if (!motion.offer && offered && offered !== left) say(by("move-fault"), t("motion.offer_expired"));
  offered = offer?.order_id ?? 0;
  by("offer").hidden = offer === null;
  by("move-form").hidden = offer !== null;
  const button = by("move-ask");
  button.setAttribute("aria-disabled", String(store.looksOn() || asking));
  say(button, asking ? t("motion.asking") : store.looksOn() ? t("motion.another_page_commands") : t("motion.ask"));
  if (offer) say(by("offer-text"), t("motion.offer", { offer: fromServer(offer.text), seconds: Math.max(0, Math.ceil(offer.left_s)) }));
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
      { viewBox: "-22 -22 44 44", width: 44, height: 44, role: "img", "aria-label": percent === null ? t("motion.energy_unknown") : t("motion.energy", { percent }) },
      svg("circle", { r: 18, class: "energy-rim" }),
      svg("circle", { r: 18, class: low ? "energy-left low" : "energy-left", "stroke-dasharray": `${part * round} ${round}`, transform: "rotate(-90)" }),
    ),
    h("span", { class: "energy-text" }, percent ?? verbatim("?")),
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

function numberIn(id: string): number | null {
  const number = numberOf(id);
  return Number.isFinite(number) ? number : null;
}
