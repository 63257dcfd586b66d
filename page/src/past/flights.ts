/** Past flights: the list by tag and day, and each to be looked at and exported. */

import { BASE, get, getOnceThere, reasonOf, send } from "../shared/api";
import { archiveSection, showArchive } from "./archive";
import { compare } from "./compare";
import { by, describe, fill, h, say, valueOf } from "../shared/dom";
import { downloadSection } from "./downloads";
import { dateTime, span } from "../shared/format";
import { t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { pager } from "../shared/pager";
import { tableOf } from "../shared/rows";
import { seasonSection } from "./season";
import { store } from "../store";
import type { Choices, FlightSummary } from "../types";

/** Rows of a table at once: a page of thousands would take seconds to draw. */
const ROWS = 25;
let exports: string[] = [];
let openView: (name: string) => void = () => undefined;
/** Ticked to be compared, in the order of ticking; two at most. */
let ticked: string[] = [];
let after = 0;
/** The last that was asked: an older answer is not shown. */
let asked = 0;
/** What is drawn: replacing an unchanged row would lose a press that has begun on it. */
let drawn = "";
let listed: FlightSummary[] = [];

export function buildFlights(go: (name: string) => void): void {
  openView = go;
  const sought = () => {
    after = 0;
    void refresh();
    showArchive(wanted());
  };
  const day = (id: string, words: Words) => h("label", { class: "check" }, words, h("input", { id, type: "date", onchange: sought }));
  fill(
    by("view-flights"),
    h(
      "div",
      { class: "toolbar" },
      h("h2", {}, t("flights.title")),
      h("button", { id: "flights-refresh", onclick: () => void all() }, t("flights.refresh")),
      h("button", { id: "flights-compare", "aria-disabled": "true", onclick: () => void compareTicked() }, t("flights.compare_two")),
    ),
    h(
      "div",
      { class: "toolbar sought", role: "search" },
      h("label", { class: "check" }, t("common.tag"), h("input", { id: "flights-tag", type: "number", min: "0", step: "1", placeholder: t("flights.any_tag"), onchange: sought })),
      day("flights-from", t("flights.day")),
      day("flights-to", t("flights.to_day")),
      h("button", { id: "flights-all", onclick: () => clear(sought) }, t("flights.all")),
      h("span", { id: "flights-pager", class: "pager", role: "status" }),
    ),
    h("div", { id: "flights-list", class: "table-wrap" }),
    h("div", { id: "compare", class: "table-wrap" }),
    archiveSection((id) => void open(id)),
    seasonSection(),
    downloadSection(() => void refresh()),
  );
  void getOnceThere<Choices>("/choices").then((choices) => {
    exports = choices.exports;
    if (!drawn) return;
    drawn = "";
    void refresh();
  });
}

/** Both lists, with what is sought. */
export async function all(): Promise<void> {
  showArchive(wanted());
  await refresh();
}

function clear(then: () => void): void {
  for (const id of ["flights-tag", "flights-from", "flights-to"]) (by(id) as HTMLInputElement).value = "";
  then();
}

/** What is sought, as the server has it; a day alone is that day. */
function wanted(): URLSearchParams {
  const found = new URLSearchParams();
  const [tag, from, to] = [valueOf("flights-tag"), valueOf("flights-from"), valueOf("flights-to")];
  if (tag) found.set("tag", tag);
  if (from) found.set("from", from);
  if (to || from) found.set("to", to || from);
  return found;
}

async function refresh(): Promise<void> {
  const number = ++asked;
  const query = wanted();
  const any = query.size === 0;
  query.set("after", String(after));
  query.set("limit", String(ROWS));
  let found: { total: number; flights: FlightSummary[] };
  const instead = (child: HTMLElement) => {
    drawn = "";
    fill(by("flights-list"), child);
  };
  try {
    found = await get(`/found-flights?${query}`);
  } catch (error) {
    if (number !== asked) return;
    instead(h("p", { class: "fault-line" }, reasonOf(error)));
    fill(by("flights-pager"));
    return;
  }
  if (number !== asked) return;
  if (after && !found.flights.length) {
    after = 0; // fewer than there were
    return refresh();
  }
  pager(by("flights-pager"), found.total, after, ROWS, (next) => {
    after = next;
    void refresh();
  });
  if (!found.total) {
    instead(h("p", { class: "empty" }, any ? t("flights.no_flight_yet") : t("flights.no_such_flight")));
    return;
  }
  draw(found.flights);
}

function keyOf(flights: FlightSummary[]): string {
  return JSON.stringify([flights, ticked, exports, store.state?.flight.flight_id, store.state?.flight.ended]);
}

function draw(flights: FlightSummary[]): void {
  const key = keyOf(flights);
  if (key === drawn) return;
  listed = flights;
  drawn = key;
  const rows = flights.map((flight) => {
    const live = flight.flight_id === store.state?.flight.flight_id && !store.state.flight.ended;
    const tags = flight.tags.map((tag) => (tag.name ? `${tag.tag_id} ${tag.name}` : String(tag.tag_id)));
    return h(
      "tr",
      { "data-flight": flight.flight_id },
      h("td", {}, h("label", { class: "touch" }, h("input", { type: "checkbox", class: "tick", "aria-label": t("flights.compare_this"), checked: ticked.includes(flight.flight_id), onchange: () => tick(flight.flight_id) }))),
      h("td", {}, dateTime(flight.start_time_ns), live ? h("span", { class: "chip live" }, t("flights.now")) : null),
      h("td", { class: "number" }, span((flight.end_time_ns - flight.start_time_ns) / 1e9)),
      h("td", { class: "number" }, verbatim(flight.pulses.toLocaleString("en"))),
      h("td", { translate: "no" }, verbatim(tags.join(", "))),
      h("td", {}, whereFrom(flight)),
      h(
        "td",
        { class: "row-actions" },
        starButton(flight),
        h("button", { class: "open-flight", onclick: () => void open(flight.flight_id) }, t("common.open")),
        h("a", { class: "export report", href: `${BASE}/api/flights/${encodeURIComponent(flight.flight_id)}/report`, target: "_blank", rel: "noopener" }, t("flights.report")),
        ...exports.map((name) =>
          h("a", { class: "export", href: `${BASE}/api/flights/${encodeURIComponent(flight.flight_id)}/export/${name}`, download: "" }, verbatim(name.toUpperCase())),
        ),
      ),
    );
  });
  fill(
    by("flights-list"),
    tableOf(["", t("flights.start"), t("common.length"), t("common.pulses"), t("common.tags"), t("flights.where_from"), t("flights.open_save")], rows),
  );
}

function whereFrom({ source, vehicle }: FlightSummary): Words {
  if (!vehicle) return t(source === "ground" ? "flights.received_here" : "flights.from_drone");
  return t(source === "ground" ? "flights.received_here_of" : "flights.from_drone_of", { vehicle: verbatim(vehicle) });
}

/** A starred flight is never removed from the computer that it is on. */
function starButton(flight: FlightSummary): HTMLElement {
  const button = h("button", { class: "star", onclick: () => void turn() });
  const draw = () => {
    say(button, verbatim(flight.starred ? "★" : "☆"));
    button.setAttribute("aria-pressed", String(flight.starred));
    const words = flight.starred ? t("flights.starred") : t("flights.star");
    describe(button, "aria-label", words);
    describe(button, "title", words);
  };
  const turn = async () => {
    try {
      const answer = await send<{ starred: boolean }>("PUT", `/flights/${encodeURIComponent(flight.flight_id)}/star`, { starred: !flight.starred });
      const asDrawn = drawn === keyOf(listed);
      flight.starred = answer.starred;
      draw();
      if (asDrawn) drawn = keyOf(listed); // this row is not replaced
      void refresh(); // an answer under way still has the star's old state
    } catch (error) {
      toast(reasonOf(error), 3);
    }
  };
  draw();
  return button;
}

async function open(id: string): Promise<void> {
  try {
    if (await store.open(id)) openView("fly");
  } catch (error) {
    toast(reasonOf(error), 3);
  }
}

function tick(id: string): void {
  if (ticked.includes(id)) ticked = ticked.filter((one) => one !== id);
  else ticked = [...ticked.slice(-1), id];
  document.querySelectorAll<HTMLElement>("tr[data-flight]").forEach((row) => {
    (row.querySelector(".tick") as HTMLInputElement).checked = ticked.includes(row.dataset.flight!);
  });
  by("flights-compare").setAttribute("aria-disabled", String(ticked.length !== 2));
}

async function compareTicked(): Promise<void> {
  if (ticked.length !== 2) {
    toast(t("flights.tick_two"), 5);
    return;
  }
  const [first, second] = [...ticked].sort().reverse() as [string, string];
  await compare(first, second, openView);
}
