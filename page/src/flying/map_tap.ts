/** A tap on the map: where that is, how far from me and the drone; marks and measuring. */

import { get, reasonOf, send } from "../shared/api";
import { mayCommand } from "./commands";
import { by, fill, h } from "../shared/dom";
import { metres } from "../shared/format";
import { bearingDeg, distanceM, type LonLat } from "../shared/geo";
import { t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { herePlace } from "../map/map_content";
import { myPlace } from "../map/my_place";
import { store } from "../store";
import type { Readout } from "../types";
import type { FlightMap, Tap } from "../map/map_view";

let view: FlightMap;
let from: LonLat | null = null;

export function tapBox(made: FlightMap): HTMLElement {
  view = made;
  store.on(["state", "me"], drawMe);
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
  const mgrs = h("div", { id: "tap-mgrs", class: "note" });
  fill(
    box,
    place,
    mgrs,
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
    mgrs.textContent = readout.mgrs ?? readout.dms; // of this tap, whatever is tapped meanwhile
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

let drawn = "";

function drawMe(): void {
  const me = myPlace();
  if (drawn === String(me)) return;
  drawn = String(me);
  view.setMe(me);
}
