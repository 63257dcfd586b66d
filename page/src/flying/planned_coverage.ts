/** Before a flight: where a tag would be heard along what is planned. */

import { by, fill, h, numberOf, say, valueOf } from "../shared/dom";
import { fixed } from "../shared/format";
import { askForMap, discardCoverageMap, coverageElements, showCoverageSummary } from "./coverage_maps";
import { t, verbatim, type Words } from "../shared/i18n";
import { store } from "../store";
import type { PlanMap } from "../types";
import type { FlightMap } from "../map/map_view";

/** What is planned, as the server takes it: places are latitude and longitude. */
export type Plan = { way: [number, number][] } | { outline: [number, number][]; spacing_m?: number | null };

const MONOPOLE = "monopole";
/** What a tag of no list is: `uavrt coverage` without --tags. */
const NO_TAG = t("before.typical_tag");
const NO_LINES = t("before.no_lines");
const NO_TURNS = t("before.no_turns");

let view: FlightMap;
let plan: Plan | null = null;
let note: Words | "" = "";
let height: number | null = null;
let asked = 0;
let made: PlanMap | null = null;
let open = false;

export function beforeBox(shown: FlightMap): HTMLElement {
  view = shown;
  store.on(["tags", "reset"], drawTags);
  const input = (id: string, label: Words, properties: Record<string, string>) =>
    h("label", {}, h("span", {}, label), h("input", { id, autocomplete: "off", onchange: () => forget(), ...properties }));
  return h(
    "details",
    { id: "before", class: "before", hidden: true },
    h("summary", {}, t("before.title")),
    h(
      "div",
      { class: "fields" },
      h("label", {}, h("span", {}, t("common.tag")), h("select", { id: "before-tag", onchange: () => forget() }, h("option", { value: "" }, NO_TAG))),
      input("before-power", t("common.radiated_power"), { value: "-25", inputmode: "decimal" }),
      input("before-heights", t("before.heights"), { placeholder: t("before.heights_hint") }),
    ),
    h(
      "div",
      { class: "area-row" },
      h("button", { id: "before-make", class: "primary", onclick: () => void make() }, t("common.make_map")),
      h("button", { id: "before-hide", onclick: () => forget() }, t("before.hide_map")),
    ),
    ...coverageElements("before"),
    h("div", { id: "before-status", class: "status-line", role: "status" }),
  );
}

/** Take what is planned now; a map of another plan is not shown any longer. */
export function setPlan(now: Plan | null, how: "" | "search" | "turns", height_m: number | null): void {
  const same = JSON.stringify(now) === JSON.stringify(plan) && height_m === height;
  plan = now;
  height = height_m;
  note = ({ "": "", search: NO_LINES, turns: NO_TURNS } as const)[how];
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
  fill(chosen, ...tags.map((tag) => h("option", { value: String(tag.id), translate: "no" }, verbatim([tag.id, tag.name].filter(Boolean).join(" ")))), h("option", { value: "" }, NO_TAG));
  if (tags.some((tag) => String(tag.id) === was)) chosen.value = was;
  else if (was !== chosen.value) forget();
}

function forget(): void {
  asked += 1;
  if (made && open) view.setHeard(null);
  made = null;
  discardCoverageMap("before");
}

/** Several may be compared; none: the height of the order, or the usual one. */
function heights(): number[] | null {
  const text = valueOf("before-heights").trim();
  if (text === "") return [height ?? 60];
  const found = text.split(/[\s;]+/).map((one) => Number(one.replace(/,$/, "").replace(",", ".")));
  return found.every(Number.isFinite) ? found : null;
}

async function make(): Promise<void> {
  forget();
  const wanted = heights();
  if (!plan || !wanted) {
    say(by("before-fault"), t("before.heights_fault"));
    return;
  }
  const ticket = ++asked;
  const tag = valueOf("before-tag");
  const question = { ...plan, heights_m: wanted, tag_power_dbm: numberOf("before-power"), ...(tag === "" ? {} : { tag_id: Number(tag) }) };
  const map = await askForMap<PlanMap>("before", "/motion/coverage", question, () => ticket === asked);
  if (!map) return;
  made = map;
  if (open) view.setHeard(map);
  showCoverageSummary("before", map, note ? [said(map), note] : [said(map)]);
}

/** From where, how, and by which antenna. */
function said(map: PlanMap): Words {
  const others = verbatim(map.heights.filter((one) => !one.best).map((one) => fixed(one.height_m, 0, "m")).join(", "));
  const [height, speed, antenna] = [map.height_m, map.speed_m_s, verbatim(map.antenna)];
  if (map.antenna === MONOPOLE) {
    return others ? t("before.best_omnidirectional", { height, others, speed }) : t("before.from_omnidirectional", { height, speed });
  }
  return others ? t("before.best_pointing", { height, others, speed, antenna }) : t("before.from_pointing", { height, speed, antenna });
}
