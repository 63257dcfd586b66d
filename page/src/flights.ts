/** Past flights: the list, and each to be looked at and exported. */

import { ApiError, BASE, get, send } from "./api";
import { compare } from "./compare";
import { by, describe, fill, h, say } from "./dom";
import { downloadSection } from "./downloads";
import { dateTime, span } from "./format";
import { toast } from "./notice";
import { seasonSection } from "./season";
import { store } from "./store";
import type { Choices, FlightSummary } from "./types";

let exports: string[] = [];
let openView: (name: string) => void = () => undefined;
/** Ticked to be compared, in the order of ticking; two at most. */
let ticked: string[] = [];

export function buildFlights(go: (name: string) => void): void {
  openView = go;
  fill(
    by("view-flights"),
    h("div", { class: "toolbar" }, h("h2", {}, "Flights on this computer"), h("button", { id: "flights-refresh", onclick: () => void refresh() }, "Refresh"), h("button", { id: "flights-compare", "aria-disabled": "true", onclick: () => void compareTicked() }, "Compare two")),
    h("div", { id: "flights-list", class: "table-wrap" }),
    h("div", { id: "compare", class: "table-wrap" }),
    seasonSection(),
    downloadSection(() => void refresh()),
  );
  void get<Choices>("/choices").then(
    (choices) => {
      exports = choices.exports;
    },
    () => undefined,
  );
}

export async function refresh(): Promise<void> {
  const flights = await get<FlightSummary[]>("/flights").catch(() => []);
  if (!flights.length) {
    fill(by("flights-list"), h("p", { class: "empty" }, "No flight yet. The first start makes one."));
    return;
  }
  ticked = ticked.filter((id) => flights.some((flight) => flight.flight_id === id));
  const rows = flights.map((flight) => {
    const live = flight.flight_id === store.state?.flight.flight_id && !store.state.flight.ended;
    const tags = flight.tags.map((tag) => (tag.name ? `${tag.tag_id} ${tag.name}` : String(tag.tag_id)));
    return h(
      "tr",
      { "data-flight": flight.flight_id },
      h("td", {}, h("input", { type: "checkbox", class: "tick", "aria-label": "Compare this flight", checked: ticked.includes(flight.flight_id), onchange: () => tick(flight.flight_id) })),
      h("td", {}, dateTime(flight.start_time_ns), live ? h("span", { class: "chip live" }, "now") : null),
      h("td", { class: "number" }, span((flight.end_time_ns - flight.start_time_ns) / 1e9)),
      h("td", { class: "number" }, flight.pulses.toLocaleString("en")),
      h("td", { translate: "no" }, tags.join(", ")),
      h("td", {}, `${flight.source === "ground" ? "received here" : "from the drone"}${flight.vehicle ? `, vehicle ${flight.vehicle}` : ""}`),
      h(
        "td",
        { class: "row-actions" },
        starButton(flight),
        h("button", { class: "open-flight", onclick: () => void open(flight.flight_id) }, "Open"),
        h("a", { class: "export report", href: `${BASE}/api/flights/${encodeURIComponent(flight.flight_id)}/report`, target: "_blank", rel: "noopener" }, "Report"),
        ...exports.map((name) =>
          h("a", { class: "export", href: `${BASE}/api/flights/${encodeURIComponent(flight.flight_id)}/export/${name}`, download: "" }, name.toUpperCase()),
        ),
      ),
    );
  });
  fill(
    by("flights-list"),
    h(
      "table",
      { class: "flights" },
      h("thead", {}, h("tr", {}, ...["", "Start", "Length", "Pulses", "Tags", "Where from", "Look, save"].map((title) => h("th", { scope: "col" }, title)))),
      h("tbody", {}, ...rows),
    ),
  );
}

/** A starred flight is never removed from the computer that it is on. */
function starButton(flight: FlightSummary): HTMLElement {
  const button = h("button", { class: "star", onclick: () => void turn() }, "");
  const draw = () => {
    say(button, flight.starred ? "★" : "☆");
    button.setAttribute("aria-pressed", String(flight.starred));
    const words = flight.starred ? "Starred: never removed. Press to take the star away" : "Star: never remove this flight";
    describe(button, "aria-label", words);
    describe(button, "title", words);
  };
  const turn = async () => {
    try {
      const answer = await send<{ starred: boolean }>("PUT", `/flights/${encodeURIComponent(flight.flight_id)}/star`, { starred: !flight.starred });
      flight.starred = answer.starred;
      draw();
    } catch (error) {
      toast(error instanceof ApiError ? error.message : "the server cannot be reached", 3);
    }
  };
  draw();
  return button;
}

async function open(id: string): Promise<void> {
  try {
    await store.open(id);
    openView("fly");
  } catch (error) {
    toast(error instanceof ApiError ? error.message : "the server cannot be reached", 3);
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
    toast("Tick two flights first", 5);
    return;
  }
  const [first, second] = [...ticked].sort().reverse() as [string, string];
  try {
    await compare(first, second, openView);
  } catch (error) {
    say(by("compare"), "");
    toast(error instanceof ApiError ? error.message : "the server cannot be reached", 3);
  }
}
