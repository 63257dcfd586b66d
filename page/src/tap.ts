/** A tap on the map: where that is, how far from me and the drone; marks and measuring. */

import { get, reasonOf, send } from "./api";
import { mayCommand } from "./commands";
import { by, fill, h } from "./dom";
import { metres } from "./format";
import { bearingDeg, distanceM, type LonLat } from "./geo";
import { t, verbatim, type Words } from "./i18n";
import { toast } from "./notice";
import { herePlace } from "./shown";
import { store } from "./store";
import type { Readout } from "./types";
import type { FlightMap, Tap } from "./view";
import { drawWalk } from "./walk";

let view: FlightMap;
/** As the browser knows it. */
let browsers: LonLat | null = null;
let from: LonLat | null = null;
let watching: number | null = null;

export function tapBox(made: FlightMap): HTMLElement {
  view = made;
  store.on(["state"], drawMe);
  view.onTap = (tap) => void show(tap);
  return h("div", { id: "tap", class: "tap", hidden: true, role: "dialog", "aria-label": t("tap.title") });
}

let catcher: ((at: LonLat) => void) | null = null;

/** Whoever draws on the map takes the taps; null gives them back. */
export function catchTaps(taker: ((at: LonLat) => void) | null): void {
  catcher = taker;
  if (taker) by("tap").hidden = true;
}

async function show(tap: Tap): Promise<void> {
  if (catcher) {
    catcher(tap.at);
    return;
  }
  if (from) {
    view.setMeasure([from, tap.at]);
    say(tap.at, t("tap.from_first", { way: way(from, tap.at) }));
    from = null;
    return;
  }
  view.setMeasure([]);
  say(tap.at, "");
}

function way(a: LonLat, b: LonLat): Words {
  return verbatim(`${metres(distanceM(a, b))}, ${Math.round(bearingDeg(a, b))}°`);
}

function say(at: LonLat, measured: Words | ""): void {
  const box = by("tap");
  const here = herePlace();
  const me = myPlace();
  const place = h("div", { id: "tap-place", class: "tap-place" }, verbatim(`${at[1].toFixed(6)}, ${at[0].toFixed(6)}`));
  const close = () => {
    box.hidden = true;
    from = null;
    view.setMeasure([]);
  };
  fill(
    box,
    place,
    h("div", { id: "tap-mgrs", class: "note" }),
    measured ? h("div", { id: "tap-measured" }, measured) : null,
    here ? h("div", { id: "tap-drone", class: "note" }, t("tap.from_drone", { way: way(here.at, at) })) : null,
    me ? h("div", { id: "tap-me", class: "note" }, t("tap.from_me", { way: way(me, at) })) : null,
    h(
      "div",
      { class: "row" },
      h("button", { id: "tap-mark", onclick: () => void mark(at, close) }, t("tap.mark")),
      h("button", { id: "tap-measure", onclick: () => { from = at; toast(t("tap.second_place"), 6); box.hidden = true; } }, t("tap.measure")),
      h("button", { onclick: close, "aria-label": t("common.close") }, verbatim("×")),
    ),
  );
  box.hidden = false;
  void get<Readout>(`/readout?latitude_deg=${at[1]}&longitude_deg=${at[0]}`).then((readout) => {
    const line = document.getElementById("tap-mgrs");
    if (line) line.textContent = readout.mgrs ?? readout.dms;
  }, () => undefined);
}

async function mark([longitude, latitude]: LonLat, close: () => void): Promise<void> {
  // It would go into the flight that goes on, not into the past one that is shown.
  if (!(await mayCommand("mark", () => undefined))) return;
  const text = prompt(t("common.remark"));
  if (text === null) return;
  try {
    await send("POST", "/commands/mark", { text, latitude_deg: latitude, longitude_deg: longitude });
    close();
  } catch (error) {
    toast(reasonOf(error), 4);
  }
}

/** Show where this computer is, as its browser knows it; again to end it. */
export function toggleMe(button: HTMLElement): void {
  if (watching !== null) {
    navigator.geolocation.clearWatch(watching);
    [watching, browsers] = [null, null];
  } else if (!("geolocation" in navigator)) {
    toast(t("tap.no_position"), 5);
    return;
  } else {
    watching = navigator.geolocation.watchPosition(
      (found) => {
        browsers = [found.coords.longitude, found.coords.latitude];
        drawMe();
      },
      (fault) => toast(t("tap.position_unknown", { reason: verbatim(fault.message) }), 5),
      { enableHighAccuracy: true, maximumAge: 5000 },
    );
  }
  drawMe();
  button.setAttribute("aria-pressed", String(watching !== null));
}

/** Where the people stand: by the ground station's own receiver, or else by the browser. */
export function myPlace(): LonLat | null {
  const me = store.state?.me;
  if (me && me.latitude_deg !== null && me.longitude_deg !== null) return [me.longitude_deg, me.latitude_deg];
  return browsers;
}

let drawn = "";

function drawMe(): void {
  const me = myPlace();
  if (drawn === String(me)) return;
  drawn = String(me);
  view.setMe(me);
  drawWalk();
}
