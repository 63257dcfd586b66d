/** Position of the chosen tag, in large digits and the coordinate format that the user chose. */

import { get } from "../shared/api";
import { by, h, say } from "../shared/dom";
import { strongestSignal } from "../map/features";
import { ago, fixed, metres } from "../shared/format";
import { bearingDeg, compass, distanceM, type LonLat } from "../shared/geo";
import { fromServer, t, type TextId, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { speak } from "../shared/speech";
import { store } from "../store";
import { myPlace } from "../map/my_place";
import type { Readout } from "../types";

let format: keyof Readout = "decimal";
/** Age from which a position is shown with its age [s]. */
const OLD_S = 60;
let strongest: { key: string; readout: Readout } | null = null;

export function positionCard(): HTMLElement {
  const formats = (["decimal", "dms", "utm", "mgrs"] as const).map((name) =>
    h(
      "button",
      {
        class: "format",
        translate: "no",
        "data-format": name,
        "aria-pressed": String(name === format),
        onclick: () => {
          format = name;
          drawPositionCard();
        },
      },
      verbatim({ decimal: "°", dms: "° ′ ″", utm: "UTM", mgrs: "MGRS" }[name]),
    ),
  );
  return h(
    "div",
    { id: "walk", class: "walk folded", hidden: true, role: "region", "aria-label": t("walk.title") },
    h("div", { class: "walk-head" }, h("span", { id: "walk-title" }), h("span", { id: "walk-sure" })),
    h("div", { id: "walk-place", class: "walk-place" }),
    h("button", { id: "walk-unfold", class: "walk-unfold", "aria-expanded": "false", "aria-label": t("walk.details"), onclick: unfold }, verbatim("▾")),
    h("div", { id: "walk-way", class: "walk-way" }),
    h("ul", { id: "walk-remarks", class: "walk-remarks", tabindex: "0", "aria-label": t("walk.remarks") }),
    h(
      "div",
      { class: "walk-formats", role: "group", "aria-label": t("walk.formats") },
      ...formats,
      h("button", { id: "walk-speak", class: "format", onclick: () => speak(spelled()) }, t("walk.read_aloud")),
      h("button", { id: "walk-copy", class: "format", onclick: copyPlace }, t("walk.copy")),
    ),
  );
}

/** On a phone the card is one line above the map, until it is pressed. */
function unfold(): void {
  const folded = by("walk").classList.toggle("folded");
  by("walk-unfold").setAttribute("aria-expanded", String(!folded));
}

export function drawPositionCard(): void {
  const box = by("walk");
  const id = store.selected;
  const fix = store.placed().find((one) => one.tag_id === id);
  if (id === null || (!fix && !store.pulses.count)) {
    box.hidden = true;
    return;
  }
  document.querySelectorAll<HTMLElement>("[data-format]").forEach((button) => {
    button.setAttribute("aria-pressed", String(button.dataset.format === format));
  });
  if (fix) {
    box.hidden = false;
    say(by("walk-title"), t("common.tag_named", { tag: store.tagName(id) }));
    const age = store.age(id);
    const old = age !== null && age >= OLD_S;
    say(by("walk-sure"), sureWithin(metres(store.radiusNow(fix)), fix.at_edge, old ? ago(age) : null));
    box.classList.toggle("old", old);
    say(by("walk-place"), readoutOf(fix.readout));
    say(by("walk-way"), wayTo([fix.longitude_deg, fix.latitude_deg]));
    showRemarks(fix.remarks, fix.cautions.length);
    return;
  }
  const best = strongestSignal(id);
  if (best === null) {
    box.hidden = true;
    return;
  }
  box.hidden = false;
  showRemarks([], 0);
  const turns = store.bearings.filter(
    (one) => one.tag_id === id && one.accepted && one.start_time_ns <= store.until,
  );
  const last = turns.at(-1);
  say(by("walk-title"), t("walk.strongest_signal", { tag: store.tagName(id) }));
  say(
    by("walk-sure"),
    last
      ? t(last.from_drone ? "walk.drones_bearing" : "walk.bearing", { bearing: fixed(last.bearing_deg, 0), direction: compass(last.bearing_deg) })
      : store.settings?.antenna === "monopole"
        ? t("walk.fly_on")
        : t("walk.turn"),
  );
  const key = best.join();
  if (strongest?.key === key) {
    say(by("walk-place"), readoutOf(strongest.readout));
  } else {
    void get<Readout>(`/readout?latitude_deg=${best[1]}&longitude_deg=${best[0]}`).then((readout) => {
      strongest = { key, readout };
      drawPositionCard(); // meanwhile there may be a position, or another tag
    }, () => undefined); // the server is away: the page asks again when it is back
  }
  say(by("walk-way"), wayTo(best));
}

function readoutOf(readout: Readout): Words {
  return verbatim(readout[format] ?? readout.decimal);
}

function sureWithin(radius: Words, atEdge: boolean, age: Words | null): Words {
  if (age) return t(atEdge ? "walk.within_or_farther_heard" : "walk.within_heard", { radius, age });
  return t(atEdge ? "walk.within_or_farther" : "walk.within", { radius });
}

/** Remarks on the position: the cautions first. */
function showRemarks(remarks: string[], cautions: number): void {
  const list = by("walk-remarks");
  if (list.dataset.shown === remarks.join("\n")) return;
  list.dataset.shown = remarks.join("\n");
  list.replaceChildren(
    ...remarks.map((text, number) => h("li", { class: number < cautions ? "caution" : "" }, fromServer(text))),
  );
}

/** From where the people stand: their own place if it is known, or else where the drone took off. */
function wayTo(place: LonLat): Words | "" {
  const me = myPlace();
  const from = me ? ({ at: me, named: "walk.from_me" } as const) : takeOff();
  if (!from) return "";
  const way = bearingDeg(from.at, place);
  return t(from.named, { distance: metres(distanceM(from.at, place)), direction: compass(way), degrees: fixed(way, 0) });
}

const ON_GROUND_M = 3;

/** The autopilot's home; or else where the track leaves the ground; or else its beginning, called that. */
export function takeOff(): { at: LonLat; named: TextId } | null {
  const { track, review, state } = store;
  const home = review ? review.home : state?.home;
  if (home) return { at: [home.longitude_deg, home.latitude_deg], named: "walk.from_take_off" };
  if (!track.count) return null;
  let last = -1;
  for (let place = 0; place < track.count && track.height[place]! < ON_GROUND_M; place += 1) last = place;
  const at = Math.max(0, last);
  return { at: [track.lon[at]!, track.lat[at]!], named: last >= 0 ? "walk.from_take_off" : "walk.from_first_place" };
}

function spelled(): Words {
  const said = (id: string) => verbatim(by(id).textContent ?? "");
  const letters = said("walk-place").split("").join(" ").replaceAll(".", t("walk.point")).replaceAll("-", t("walk.minus"));
  return verbatim(`${said("walk-title")}. ${letters}. ${said("walk-way")}`);
}

function copyPlace(): void {
  const text = by("walk-place").textContent ?? "";
  const refused = () => toast(t("walk.no_copy"), 5);
  // Over plain HTTP from another computer there is no clipboard.
  if (!navigator.clipboard) refused();
  else void navigator.clipboard.writeText(text).then(() => toast(t("walk.copied"), 6), refused);
}
