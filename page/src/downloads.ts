/** Flights that are still on the drone. */

import { reasonOf, send } from "./api";
import { by, fill, h, say } from "./dom";
import { toast } from "./notice";
import { store } from "./store";
import type { Download } from "./types";

interface Remote {
  flight_id: string;
  here: boolean;
}

let refreshHere: () => void = () => undefined;
let ended = true;

/** The section below the flights; `changed` is called when a flight has come. */
export function downloadSection(changed: () => void): HTMLElement {
  refreshHere = changed;
  store.on(["download"], draw);
  return h(
    "section",
    { "aria-labelledby": "drone-title" },
    h(
      "div",
      { class: "toolbar" },
      h("h2", { id: "drone-title" }, "On the drone"),
      h("button", { id: "drone-list", onclick: () => void list() }, "List flights"),
      h("label", { class: "check" }, h("input", { type: "checkbox", id: "drone-samples" }), "with recorded samples (large)"),
    ),
    h(
      "div",
      { id: "download", class: "download", hidden: true, role: "status" },
      h("progress", { id: "download-bar", "aria-label": "Download" }),
      h("span", { id: "download-text" }),
      h("button", { id: "download-stop", onclick: () => void stop() }, "Stop"),
    ),
    h("div", { id: "drone-flights" }),
  );
}

async function list(): Promise<void> {
  const holder = by("drone-flights");
  fill(holder, h("p", { class: "note" }, "Requesting the list …"));
  try {
    const found = await send<Remote[]>("POST", "/drone/flights", {});
    fill(
      holder,
      found.length ? null : h("p", { class: "empty" }, "No flight on the drone."),
      ...found.map((one) =>
        h(
          "div",
          { class: "remote", "data-remote": one.flight_id },
          h("span", {}, one.flight_id.replace("flight_log_", "").replace("_", " ")),
          one.here ? h("span", { class: "chip good" }, "here") : null,
          h("button", { class: "fetch", onclick: () => void start(one.flight_id) }, one.here ? "Fetch again" : "Fetch"),
        ),
      ),
    );
  } catch (error) {
    fill(holder, h("p", { class: "fault-line" }, reasonOf(error)));
  }
}

async function start(flight: string): Promise<void> {
  const everything = (by("drone-samples") as HTMLInputElement).checked;
  try {
    await send("POST", "/drone/download", { flight_id: flight, everything });
  } catch (error) {
    toast(reasonOf(error), 4);
  }
}

async function stop(): Promise<void> {
  await send("DELETE", "/drone/download", {}).catch((error: unknown) => toast(reasonOf(error), 4));
}

function draw(): void {
  const now = store.download;
  by("download").hidden = now === null;
  if (!now) return;
  const bar = by("download-bar") as HTMLProgressElement;
  if (now.whole_bytes === null && !now.ended) bar.removeAttribute("value");
  else {
    bar.max = now.whole_bytes || 1;
    bar.value = now.ended && !now.error ? bar.max : now.done_bytes;
  }
  by("download-stop").hidden = now.ended;
  say(by("download-text"), progressOf(now));
  if (now.ended && !ended) {
    refreshHere();
    if (by("drone-flights").childElementCount) void list();
  }
  ended = now.ended;
}

function progressOf(now: Download): string {
  const name = now.flight_id.replace("flight_log_", "").replace("_", " ");
  if (now.error) return `${name}: ${now.error}`;
  if (now.ended) return `${name}: here, ${size(now.done_bytes)}`;
  if (now.whole_bytes === null) return `${name}: listing its files`;
  return `${name}: ${size(now.done_bytes)} of ${size(now.whole_bytes)}, ${now.file}`;
}

function size(bytes: number): string {
  return bytes < 1e6 ? `${Math.round(bytes / 1e3)}\u202fkB` : `${(bytes / 1e6).toFixed(1)}\u202fMB`;
}
