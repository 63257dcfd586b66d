/** Flights that are still on the drone. */

import { reasonOf, send } from "../shared/api";
import { by, fill, h, say } from "../shared/dom";
import { fixed } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";
import type { Download } from "../types";

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
      h("h2", { id: "drone-title" }, t("downloads.title")),
      h("button", { id: "drone-list", onclick: () => void list() }, t("downloads.list_flights")),
      h("label", { class: "check" }, h("input", { type: "checkbox", id: "drone-samples" }), t("downloads.with_samples")),
    ),
    h(
      "div",
      { id: "download", class: "download", hidden: true, role: "status" },
      h("progress", { id: "download-bar", "aria-label": t("downloads.download") }),
      h("span", { id: "download-text" }),
      h("button", { id: "download-stop", onclick: () => void stop() }, t("common.stop")),
    ),
    h("div", { id: "drone-flights" }),
  );
}

/** The last list that was asked for: an older one is not shown. */
let asked = 0;

async function list(): Promise<void> {
  const number = ++asked;
  const holder = by("drone-flights");
  fill(holder, h("p", { class: "note" }, t("common.requesting_list")));
  try {
    const found = await send<Remote[]>("POST", "/drone/flights", {});
    if (number !== asked) return;
    fill(
      holder,
      found.length ? null : h("p", { class: "empty" }, t("downloads.no_flight")),
      ...found.map((one) =>
        h(
          "div",
          { class: "remote", "data-remote": one.flight_id },
          h("span", {}, nameOf(one.flight_id)),
          one.here ? h("span", { class: "chip good" }, t("downloads.is_here")) : null,
          h("button", { class: "fetch", onclick: () => void start(one.flight_id) }, one.here ? t("downloads.fetch_again") : t("downloads.fetch")),
        ),
      ),
    );
  } catch (error) {
    if (number === asked) fill(holder, h("p", { class: "fault-line" }, reasonOf(error)));
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

function progressOf(now: Download): Words {
  const flight = nameOf(now.flight_id);
  if (now.error) return t("downloads.failed", { flight, reason: fromServer(now.error) });
  if (now.ended) return t("downloads.done", { flight, size: size(now.done_bytes) });
  if (now.whole_bytes === null) return t("downloads.listing", { flight });
  return t("downloads.progress", { flight, size: size(now.done_bytes), whole: size(now.whole_bytes), file: verbatim(now.file) });
}

function nameOf(flight: string): Words {
  return verbatim(flight.replace("flight_log_", "").replace("_", " "));
}

function size(bytes: number): Words {
  return bytes < 1e6 ? fixed(bytes / 1e3, 0, "kB") : fixed(bytes / 1e6, 1, "MB");
}
