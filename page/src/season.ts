/** A season in numbers: flights, minutes for each animal, batteries. */

import { get, reasonOf } from "./api";
import { by, fill, h, say } from "./dom";
import { dateTime, fixed } from "./format";
import type { SeasonRecord } from "./types";

const TITLES = ["Tag", "Frequency", "Flights", "Detected in", "Minutes searched", "Minutes to detection", "Last detected"];

export function seasonSection(): HTMLElement {
  return h(
    "section",
    { class: "season", "aria-labelledby": "h-season" },
    h(
      "div",
      { class: "toolbar" },
      h("h2", { id: "h-season" }, "The season"),
      h("button", { id: "season-show", onclick: () => void show() }, "Summarise season"),
      h("span", { id: "season-note", class: "note", role: "status" }),
    ),
    h("div", { id: "season-table", class: "table-wrap" }),
  );
}

async function show(): Promise<void> {
  say(by("season-note"), "Reading all flights …");
  try {
    draw(await get<SeasonRecord>("/season"));
  } catch (error) {
    say(by("season-note"), reasonOf(error));
    fill(by("season-table"));
  }
}

function draw(found: SeasonRecord): void {
  say(by("season-note"), [flown(found), heard(found), batteries(found)].join(" · "));
  const rows = found.animals.map((one) =>
    h(
      "tr",
      { "data-animal": one.tag_id },
      h("td", { translate: "no" }, one.name ? `${one.tag_id} ${one.name}` : String(one.tag_id)),
      h("td", { class: "number" }, fixed(one.frequency_hz / 1e6, 3, "MHz")),
      h("td", { class: "number" }, one.flights),
      h("td", { class: "number" }, one.flights_heard),
      h("td", { class: "number" }, fixed(one.minutes, 0)),
      h("td", { class: "number" }, fixed(one.minutes_to_hear, 1)),
      h("td", {}, one.last_heard_ns === null ? "" : dateTime(one.last_heard_ns)),
    ),
  );
  fill(
    by("season-table"),
    h("table", { class: "flights" }, h("thead", {}, h("tr", {}, ...TITLES.map((title) => h("th", { scope: "col" }, title)))), h("tbody", {}, ...rows)),
  );
}

function flown(found: SeasonRecord): string {
  return `${found.flights} flights, ${fixed(found.minutes, 0)} minutes`;
}

function heard(found: SeasonRecord): string {
  const all = `${found.animals_heard} of ${found.animals.length} animals detected`;
  return found.minutes_per_animal === null ? all : `${all} · ${fixed(found.minutes_per_animal, 1)} minutes of flight per detection`;
}

function batteries(found: SeasonRecord): string {
  if (!found.batteries) return "no flight has battery data";
  const put = `${found.batteries} battery changes, charge of ${fixed(found.batteries_used, 1)} full batteries used`;
  return found.flights_without_battery ? `${put} · ${found.flights_without_battery} flights without battery data` : put;
}
