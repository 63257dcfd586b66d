/** A tap on the map: where that is, how far from me and the drone; marks and measuring. */

import { get, send } from "./api";
import { by, fill, h } from "./dom";
import { metres } from "./format";
import { bearingDeg, distanceM, type LonLat } from "./geo";
import { toast } from "./notice";
import { herePlace } from "./shown";
import type { Readout } from "./types";
import type { FlightMap, Tap } from "./view";

let view: FlightMap;
let me: LonLat | null = null;
let from: LonLat | null = null;
let watching: number | null = null;

export function tapBox(made: FlightMap): HTMLElement {
  view = made;
  view.onTap = (tap) => void show(tap);
  return h("div", { id: "tap", class: "tap", hidden: true, role: "dialog", "aria-label": "This place" });
}

async function show(tap: Tap): Promise<void> {
  if (from) {
    view.setMeasure([from, tap.at]);
    say(tap.at, `${way(from, tap.at)} from the first place`);
    from = null;
    return;
  }
  view.setMeasure([]);
  say(tap.at, "");
}

function way(a: LonLat, b: LonLat): string {
  return `${metres(distanceM(a, b))}, ${Math.round(bearingDeg(a, b))}°`;
}

function say(at: LonLat, measured: string): void {
  const box = by("tap");
  const here = herePlace();
  const place = h("div", { id: "tap-place", class: "tap-place" }, `${at[1].toFixed(6)}, ${at[0].toFixed(6)}`);
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
    here ? h("div", { id: "tap-drone", class: "note" }, `${way(here.at, at)} from the drone`) : null,
    me ? h("div", { id: "tap-me", class: "note" }, `${way(me, at)} from me`) : null,
    h(
      "div",
      { class: "row" },
      h("button", { id: "tap-mark", onclick: () => void mark(at, close) }, "Mark"),
      h("button", { id: "tap-measure", onclick: () => { from = at; toast("Tap the second place", 6); box.hidden = true; } }, "Measure"),
      h("button", { onclick: close, "aria-label": "Close" }, "×"),
    ),
  );
  box.hidden = false;
  void get<Readout>(`/readout?latitude_deg=${at[1]}&longitude_deg=${at[0]}`).then((readout) => {
    const line = document.getElementById("tap-mgrs");
    if (line) line.textContent = readout.mgrs ?? readout.dms;
  }, () => undefined);
}

async function mark([longitude, latitude]: LonLat, close: () => void): Promise<void> {
  const text = prompt("Remark (may stay empty)");
  if (text === null) return;
  try {
    await send("POST", "/commands/mark", { text, latitude_deg: latitude, longitude_deg: longitude });
    close();
  } catch (error) {
    toast(error instanceof Error ? error.message : "the server is not reached", 4);
  }
}

/** Show where this computer is, as its browser knows it; again to end it. */
export function toggleMe(button: HTMLElement): void {
  if (watching !== null) {
    navigator.geolocation.clearWatch(watching);
    [watching, me] = [null, null];
  } else if (!("geolocation" in navigator)) {
    toast("This browser does not know where it is", 5);
    return;
  } else {
    watching = navigator.geolocation.watchPosition(
      (found) => {
        me = [found.coords.longitude, found.coords.latitude];
        view.setMe(me);
      },
      (fault) => toast(`Your place is not known: ${fault.message}`, 5),
      { enableHighAccuracy: true, maximumAge: 5000 },
    );
  }
  view.setMe(me);
  button.setAttribute("aria-pressed", String(watching !== null));
}

export function myPlace(): LonLat | null {
  return me;
}
