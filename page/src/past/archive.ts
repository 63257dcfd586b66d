/** Flights of the archive that `uavrt batch` wrote: thousands, by tag and day. */

import { get, reasonOf } from "../shared/api";
import { by, fill, h, say } from "../shared/dom";
import { dateTime, span } from "../shared/format";
import { t, verbatim } from "../shared/i18n";
import { pager } from "../shared/pager";
import { tableOf } from "../shared/rows";
import type { ArchiveAnswer, ArchivedFlight } from "../types";

const ROWS = 20;
const MOST_TAGS = 12;
let openFlight: (id: string) => void = () => undefined;
let after = 0;
let sought = new URLSearchParams();
/** The last that was asked: an older answer is not shown. */
let asked = 0;

/** The section below the flights of this computer; hidden while there is no archive. */
export function archiveSection(open: (id: string) => void): HTMLElement {
  openFlight = open;
  return h(
    "section",
    { id: "archive", class: "season", "aria-labelledby": "h-archive", hidden: true },
    h(
      "div",
      { class: "toolbar" },
      h("h2", { id: "h-archive" }, t("archive.title")),
      h("span", { id: "archive-place", class: "note", translate: "no" }),
      h("span", { id: "archive-pager", class: "pager", role: "status" }),
    ),
    h("div", { id: "archive-list", class: "table-wrap", role: "region", "aria-labelledby": "h-archive", tabindex: "0" }),
  );
}

/** Show its first flights that are sought. */
export function showArchive(query: URLSearchParams): void {
  sought = query;
  after = 0;
  void show();
}

async function show(): Promise<void> {
  const number = ++asked;
  const query = new URLSearchParams(sought);
  query.set("after", String(after));
  query.set("limit", String(ROWS));
  try {
    const found = await get<ArchiveAnswer>(`/archive?${query}`);
    if (number !== asked) return;
    by("archive").hidden = found.directory === null;
    say(by("archive-place"), found.directory === null ? "" : verbatim(found.directory));
    pager(by("archive-pager"), found.total, after, ROWS, (next) => {
      after = next;
      void show();
    });
    fill(by("archive-list"), found.total ? table(found.flights) : h("p", { class: "empty" }, t("archive.no_flight")));
  } catch (error) {
    if (number !== asked) return;
    by("archive").hidden = false;
    fill(by("archive-pager"));
    fill(by("archive-list"), h("p", { class: "fault-line" }, reasonOf(error)));
  }
}

function table(flights: ArchivedFlight[]): HTMLElement {
  const titles = [t("flights.start"), t("common.length"), t("common.pulses"), t("archive.tags_heard"), t("archive.place")];
  return tableOf(titles, flights.map(row));
}

function row(flight: ArchivedFlight): HTMLElement {
  const { start_time_ns: start, end_time_ns: end } = flight;
  // The one that is sought first.
  const wanted = Number(sought.get("tag"));
  const tags = [...flight.heard].sort(([one], [other]) => Number(other === wanted) - Number(one === wanted));
  const heard = tags.slice(0, MOST_TAGS).map(([tag, pulses]) => `${tag} (${pulses})`);
  if (flight.heard.length > MOST_TAGS) heard.push("…");
  return h(
    "tr",
    { "data-archived": flight.flight },
    h("td", { class: "nowrap" }, start === null ? "" : dateTime(start)),
    h("td", { class: "number" }, start === null || end === null ? "" : span((end - start) / 1e9)),
    h("td", { class: "number" }, verbatim(flight.pulses.toLocaleString("en"))),
    h("td", { translate: "no" }, verbatim(heard.join(", "))),
    h(
      "td",
      { class: "row-actions" },
      flight.here ? h("button", { class: "open-flight", onclick: () => openFlight(flight.flight) }, t("common.open")) : h("span", { class: "path", translate: "no" }, verbatim(flight.path)),
    ),
  );
}
