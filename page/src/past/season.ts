/** A season in numbers: flights, minutes for each animal, batteries. */

import { get, reasonOf } from "../shared/api";
import { by, fill, h, say } from "../shared/dom";
import { dateTime, fixed } from "../shared/format";
import { listed, t, verbatim, type Words } from "../shared/i18n";
import { tableOf } from "../shared/rows";
import type { SeasonRecord } from "../types";

const TITLES = [t("common.tag"), t("common.frequency"), t("common.flights"), t("season.detected_in"), t("season.minutes_searched"), t("season.minutes_to_detection"), t("season.last_detected")];

export function seasonSection(): HTMLElement {
  return h(
    "section",
    { class: "season", "aria-labelledby": "h-season" },
    h(
      "div",
      { class: "toolbar" },
      h("h2", { id: "h-season" }, t("season.title")),
      h("button", { id: "season-show", onclick: () => void show() }, t("season.summarise")),
      h("span", { id: "season-note", class: "note", role: "status" }),
    ),
    h("div", { id: "season-table", class: "table-wrap", role: "region", "aria-labelledby": "h-season", tabindex: "0" }),
  );
}

async function show(): Promise<void> {
  say(by("season-note"), t("season.reading"));
  try {
    draw(await get<SeasonRecord>("/season"));
  } catch (error) {
    say(by("season-note"), reasonOf(error));
    fill(by("season-table"));
  }
}

function draw(found: SeasonRecord): void {
  say(by("season-note"), listed(flown(found), heard(found), batteries(found)));
  const rows = found.animals.map((one) =>
    h(
      "tr",
      { "data-animal": one.tag_id },
      h("td", { translate: "no" }, verbatim(one.name ? `${one.tag_id} ${one.name}` : one.tag_id)),
      h("td", { class: "number" }, fixed(one.frequency_hz / 1e6, 3, "MHz")),
      h("td", { class: "number" }, one.flights),
      h("td", { class: "number" }, one.flights_heard),
      h("td", { class: "number" }, fixed(one.minutes, 0)),
      h("td", { class: "number" }, fixed(one.minutes_to_hear, 1)),
      h("td", {}, one.last_heard_ns === null ? "" : dateTime(one.last_heard_ns)),
    ),
  );
  fill(by("season-table"), tableOf(TITLES, rows));
}

function flown(found: SeasonRecord): Words {
  return t("season.flown", { flights: found.flights, minutes: fixed(found.minutes, 0) });
}

function heard(found: SeasonRecord): Words {
  const all = t("season.animals_detected", { animals_heard: found.animals_heard, animals: found.animals.length });
  return found.minutes_per_animal === null ? all : listed(all, t("season.minutes_per_detection", { minutes: fixed(found.minutes_per_animal, 1) }));
}

function batteries(found: SeasonRecord): Words {
  if (!found.batteries) return t("season.no_battery_data");
  const put = t("season.batteries", { batteries: found.batteries, batteries_used: fixed(found.batteries_used, 1) });
  return listed(put, found.flights_without_battery > 0 && t("season.flights_without_battery", { flights: found.flights_without_battery }));
}
