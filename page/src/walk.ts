/** Where to go: the position of the chosen tag, large, in the form that the people use. */

import { translated } from "./i18n";
import { get } from "./api";
import { by, h, say } from "./dom";
import { strongestSignal } from "./features";
import { ago, metres } from "./format";
import { bearingDeg, compass, distanceM, type LonLat } from "./geo";
import { toast } from "./notice";
import { speak } from "./speech";
import { store } from "./store";
import { myPlace } from "./tap";
import type { Readout } from "./types";

let format: keyof Readout = "decimal";
/** Age from which a position is shown with its age [s]. */
const OLD_S = 60;
let strongest: { key: string; readout: Readout } | null = null;

export function walkBox(): HTMLElement {
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
    h("ul", { id: "walk-remarks", class: "walk-remarks", tabindex: "0", "aria-label": "Remarks on the place" }),
    h(
      "div",
      { class: "walk-formats", role: "group", "aria-label": "Form of the coordinates" },
      ...formats,
      h("button", { id: "walk-speak", class: "format", onclick: () => speak(spelled()) }, "Read aloud"),
      h("button", { id: "walk-copy", class: "format", onclick: copyPlace }, "Copy"),
    ),
  );
}

export function drawWalk(): void {
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
    say(by("walk-title"), `Tag ${store.tagName(id)}`);
    const edge = fix.at_edge ? ", perhaps farther" : "";
    const age = store.age(id);
    const old = age !== null && age >= OLD_S ? `, heard ${ago(age)}` : "";
    say(by("walk-sure"), `within ${metres(store.radiusNow(fix))} (95\u202f%)${edge}${old}`);
    box.classList.toggle("old", old !== "");
    say(by("walk-place"), fix.readout[format] ?? fix.readout.decimal);
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
  say(by("walk-title"), `Tag ${store.tagName(id)}: strongest signal`);
  say(
    by("walk-sure"),
    last
      ? `bearing ${Math.round(last.bearing_deg)}° ${compass(last.bearing_deg)}${last.from_drone ? ", from the drone" : ""}: now turn at another place`
      : store.settings?.antenna === "monopole"
        ? "fly on: with a monopole the flight path locates it"
        : "turn on the spot for a bearing",
  );
  const key = best.join();
  if (strongest?.key === key) {
    say(by("walk-place"), strongest.readout[format] ?? strongest.readout.decimal);
  } else {
    void get<Readout>(`/readout?latitude_deg=${best[1]}&longitude_deg=${best[0]}`).then((readout) => {
      strongest = { key, readout };
      drawWalk(); // meanwhile there may be a position, or another tag
    }, () => undefined); // the server is away: the page asks again when it is back
  }
  say(by("walk-way"), wayTo(best));
}

/** Remarks on the position: the cautions first. */
function showRemarks(remarks: string[], cautions: number): void {
  const list = by("walk-remarks");
  if (list.dataset.shown === remarks.join("\n")) return;
  list.dataset.shown = remarks.join("\n");
  list.replaceChildren(
    ...remarks.map((text, number) => h("li", { class: number < cautions ? "caution" : "" }, text)),
  );
}

/** From where the people stand: their own place if it is known, or else where the drone took off. */
function wayTo(place: LonLat): string {
  const me = myPlace();
  const from = me ? { at: me, named: "me" } : takeOff();
  if (!from) return "";
  const far = distanceM(from.at, place);
  const way = bearingDeg(from.at, place);
  return `${metres(far)} ${compass(way)} (${Math.round(way)}°) of ${from.named}`;
}

const ON_GROUND_M = 3;

/** The autopilot's home; or else where the track leaves the ground; or else its beginning, called that. */
export function takeOff(): { at: LonLat; named: string } | null {
  const { track, review, state } = store;
  const home = review ? review.home : state?.home;
  if (home) return { at: [home.longitude_deg, home.latitude_deg], named: "the take-off" };
  if (!track.count) return null;
  let last = -1;
  for (let place = 0; place < track.count && track.height[place]! < ON_GROUND_M; place += 1) last = place;
  const at = Math.max(0, last);
  return { at: [track.lon[at]!, track.lat[at]!], named: last >= 0 ? "the take-off" : "where the track begins" };
}

function spelled(): string {
  const place = by("walk-place").textContent ?? "";
  return `${by("walk-title").textContent}. ${place.split("").join(" ").replaceAll(".", translated("point")).replaceAll("-", translated("minus"))}. ${by("walk-way").textContent}`;
}

function copyPlace(): void {
  const text = by("walk-place").textContent ?? "";
  const refused = () => toast("This browser does not let the page copy", 5);
  // Over plain HTTP from another computer there is no clipboard.
  if (!navigator.clipboard) refused();
  else void navigator.clipboard.writeText(text).then(() => toast("Copied", 6), refused);
}
