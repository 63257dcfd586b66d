/** Before a flight: where a tag would be heard along what is planned. */

import { by, fill, h, say } from "./dom";
import { askForMap, forgetHeard, heardElements, numberOf, tellHeard } from "./heard";
import { store } from "./store";
import type { PlanMap } from "./types";
import type { FlightMap } from "./view";

/** What is planned, as the server takes it: places are latitude and longitude. */
export type Plan = { way: [number, number][] } | { outline: [number, number][]; spacing_m?: number | null };

const MONOPOLE = "monopole";
/** What a tag of no list is: `uavrt coverage` without --tags. */
const NO_TAG = "A typical tag: 150\u202fMHz, every 1.254\u202fs";
const NO_LINES = "Calculated for lines 200\u202fm apart; a search chooses its own path.";
const NO_TURNS = "Calculated for a flight from place to place, without the turns.";

let view: FlightMap;
let plan: Plan | null = null;
let note = "";
let height: number | null = null;
let asked = 0;
let made: PlanMap | null = null;
let open = false;

export function beforeBox(shown: FlightMap): HTMLElement {
  view = shown;
  store.on(["tags", "reset"], drawTags);
  const input = (id: string, label: string, properties: Record<string, string>) =>
    h("label", {}, h("span", {}, label), h("input", { id, autocomplete: "off", onchange: () => forget(), ...properties }));
  return h(
    "details",
    { id: "before", class: "before", hidden: true },
    h("summary", {}, "Where would a tag be detected?"),
    h(
      "div",
      { class: "fields" },
      h("label", {}, h("span", {}, "Tag"), h("select", { id: "before-tag", onchange: () => forget() }, h("option", { value: "" }, NO_TAG))),
      input("before-power", "Radiated power, dBm", { value: "-25", inputmode: "decimal" }),
      input("before-heights", "Flight heights, m", { placeholder: "as above, or 60" }),
    ),
    h(
      "div",
      { class: "area-row" },
      h("button", { id: "before-make", class: "primary", onclick: () => void make() }, "Make the map"),
      h("button", { id: "before-hide", onclick: () => forget() }, "Hide the map"),
    ),
    ...heardElements("before"),
    h("div", { id: "before-status", class: "status-line", role: "status" }),
  );
}

/** Take what is planned now; a map of another plan is not shown any longer. */
export function setPlan(now: Plan | null, how: "" | "search" | "turns", height_m: number | null): void {
  const same = JSON.stringify(now) === JSON.stringify(plan) && height_m === height;
  plan = now;
  height = height_m;
  note = { "": "", search: NO_LINES, turns: NO_TURNS }[how];
  by("before").hidden = plan === null;
  if (!same) forget();
}

/** The map lies on the flight's map while the plan does. */
export function openBefore(shown: boolean): void {
  open = shown;
  if (made) view.setHeard(shown ? made : null);
}

function drawTags(): void {
  const chosen = by("before-tag") as HTMLSelectElement;
  const was = chosen.value;
  const tags = store.tags.filter((tag) => Number.isInteger(Number(tag.id)));
  fill(chosen, ...tags.map((tag) => h("option", { value: String(tag.id), translate: "no" }, [tag.id, tag.name].filter(Boolean).join(" "))), h("option", { value: "" }, NO_TAG));
  if (tags.some((tag) => String(tag.id) === was)) chosen.value = was;
  else if (was !== chosen.value) forget();
}

function forget(): void {
  asked += 1;
  if (made && open) view.setHeard(null);
  made = null;
  forgetHeard("before");
}

/** Several may be compared; none: the height of the order, or the usual one. */
function heights(): number[] | null {
  const text = (by("before-heights") as HTMLInputElement).value.trim();
  if (text === "") return [height ?? 60];
  const found = text.split(/[\s;]+/).map((one) => Number(one.replace(/,$/, "").replace(",", ".")));
  return found.every(Number.isFinite) ? found : null;
}

async function make(): Promise<void> {
  forget();
  const wanted = heights();
  if (!plan || !wanted) {
    say(by("before-fault"), "Write heights as numbers separated by spaces");
    return;
  }
  const ticket = ++asked;
  const tag = (by("before-tag") as HTMLSelectElement).value;
  const question = { ...plan, heights_m: wanted, tag_power_dbm: numberOf("before-power"), ...(tag === "" ? {} : { tag_id: Number(tag) }) };
  const map = await askForMap<PlanMap>("before", "/motion/coverage", question, () => ticket === asked);
  if (!map) return;
  made = map;
  if (open) view.setHeard(map);
  tellHeard("before", map, [said(map), note].filter(Boolean));
}

/** From where, how, and by which antenna. */
function said(map: PlanMap): string {
  const others = map.heights.filter((one) => !one.best).map((one) => `${one.height_m}\u202fm`);
  const from = others.length ? `Best from ${map.height_m}\u202fm, better than from ${others.join(", ")}` : `From ${map.height_m}\u202fm`;
  const antenna = map.antenna === MONOPOLE ? "an omnidirectional antenna" : `the antenna ${map.antenna} pointing ahead`;
  return `${from} above the ground, at ${map.speed_m_s}\u202fm/s, with ${antenna}.`;
}
