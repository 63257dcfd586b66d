/** After the landing: what a whole flight's samples say, where a tag would have been heard, and where it is not. */

import { ApiError, reasonOf, send } from "../shared/api";
import { by, fill, h, numberOf, say, valueOf } from "../shared/dom";
import { askForMap, discardCoverageMap, coverageElements, showCoverageSummary } from "./coverage_maps";
import { fixed, percent } from "../shared/format";
import type { LonLat } from "../shared/geo";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { folded, type Row, rowList } from "../shared/rows";
import { store } from "../store";
import { catchTaps } from "./map_tap";
import type { Absence, IntegrationAnswer, SilenceMap, Verdict } from "../types";
import type { FlightMap } from "../map/map_view";

const AGAIN_MS = 700;
const MOST_CORNERS = 20;

let view: FlightMap;
let asked = 0;
/** The last outline that was judged: an older answer is not shown. */
let judged = 0;
let outline: LonLat[] = [];
let drawing = false;
let shown: SilenceMap | null = null;
let flight: string | null = null;

export function afterPanel(made: FlightMap): HTMLElement {
  view = made;
  store.on(["reset", "hindsight", "selection"], drawAfter);
  return h(
    "div",
    { id: "after", class: "after", hidden: true },
    h("h3", {}, t("after.whole_flight")),
    h("ul", { id: "verdicts", class: "verdicts" }),
    h("button", { id: "integrate-begin", hidden: true, onclick: () => void lookBelow() }, t("after.search")),
    h("p", { id: "integrate-status", class: "status-line", role: "status" }),
    h("h3", {}, t("after.silence_title")),
    h(
      "div",
      { class: "fields" },
      h("label", {}, h("span", {}, t("common.tag")), h("select", { id: "silence-tag", onchange: () => void forget() })),
      h("label", {}, h("span", {}, t("common.radiated_power")), h("input", { id: "silence-power", value: "-25", inputmode: "decimal", autocomplete: "off", onchange: () => void forget() })),
    ),
    h("button", { id: "silence-make", class: "primary", onclick: () => void make() }, t("common.make_map")),
    ...coverageElements("silence"),
    h(
      "div",
      { class: "area-row" },
      h("button", { id: "absence-draw", "aria-pressed": "false", onclick: () => draw() }, t("after.draw_area")),
      h("button", { id: "absence-clear", onclick: () => clear() }, t("common.clear")),
    ),
    h("p", { id: "absence-status", class: "status-line absence", role: "status" }),
    h("div", { id: "silence-status", class: "status-line", role: "status" }),
  );
}

/** Show or hide the panel; taps belong to the map again. */
export function openAfter(open: boolean): void {
  by("after").hidden = !open;
  if (open && shown) view.setHeard(shown);
  if (!open && drawing) draw();
}

function drawAfter(): void {
  const review = store.review;
  by("show-after").hidden = review === null;
  const now = review?.flight_id ?? null;
  if (now !== flight) {
    flight = now;
    forget();
    const tags = review?.rows ?? [];
    fill(by("silence-tag"), ...tags.map((tag) => h("option", { value: String(tag.id), translate: "no" }, verbatim([tag.id, tag.name].filter(Boolean).join(" ")))));
  }
  const tags = store.hindsight?.tags ?? [];
  fill(
    by("verdicts"),
    ...(tags.length ? tags.map(verdict) : [h("li", { class: "note" }, t("after.not_searched"))]),
  );
  by("integrate-begin").hidden = review === null || tags.length > 0;
}

/** Let the ground station judge the whole flight from the samples that it kept. */
async function lookBelow(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id) return;
  const button = by("integrate-begin") as HTMLButtonElement;
  button.disabled = true;
  say(by("integrate-status"), t("after.searching"));
  let fault: Words | "" = "";
  try {
    for (;;) {
      const answer = await send<IntegrationAnswer>("POST", `/flights/${encodeURIComponent(id)}/integrate`, {});
      if (answer.state === "failed") throw new ApiError(fromServer(answer.error), 500);
      if (answer.state === "done" || store.review?.flight_id !== id) break;
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
    await store.hindsightAgain();
  } catch (error) {
    fault = reasonOf(error);
  }
  say(by("integrate-status"), fault);
  button.disabled = false;
}

function fold(one: Verdict): HTMLElement | "" {
  const picture = store.folds[one.tag_id];
  if (!picture) return "";
  return h("img", {
    class: "fold",
    src: `data:image/png;base64,${picture.picture}`,
    alt: t("after.fold_alt"),
  });
}

function verdict(one: Verdict): HTMLElement {
  const row = store.review?.rows.find((each) => Number(each.id) === one.tag_id);
  const name = t("common.tag_named", { tag: verbatim([one.tag_id, row?.name].filter(Boolean).join(" ")) });
  const rows = (found: Verdict["facts"]["rows"]): Row[] => found.map(([label, values]) => [fromServer(label), ...values.map(fromServer)]);
  return h("li", {}, h("strong", {}, name), rowList(rows(one.facts.rows)), folded(rowList(rows(one.facts.details))), fold(one));
}

// ------------------------------------------------------------------- the map of silence

function question(): { tag_id: number; tag_power_dbm: number } {
  return { tag_id: Number(valueOf("silence-tag")), tag_power_dbm: numberOf("silence-power") };
}

function forget(): void {
  asked += 1;
  if (shown) view.setHeard(null);
  shown = null;
  discardCoverageMap("silence");
  say(by("absence-status"), "");
  clear();
}

async function make(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id) return;
  const ticket = ++asked;
  const map = await askForMap<SilenceMap>("silence", `/flights/${encodeURIComponent(id)}/silence`, question(), () => ticket === asked);
  if (map) {
    shown = map;
    view.setHeard(map);
    showCoverageSummary("silence", map, [t("after.noise", { noise: fromServer(map.noise) })]);
  }
  await judge();
}

// ------------------------------------------------------------------- not here

function draw(): void {
  drawing = !drawing;
  by("absence-draw").setAttribute("aria-pressed", String(drawing));
  catchTaps(drawing ? corner : null);
  if (drawing) say(by("absence-status"), t("after.tap_corners"));
}

function corner(at: LonLat): void {
  if (outline.length >= MOST_CORNERS) return;
  outline.push(at);
  view.setMeasure(outline.length > 2 ? [...outline, outline[0]!] : outline);
  void judge();
}

function clear(): void {
  judged += 1;
  outline = [];
  view.setMeasure([]);
  if (drawing) draw();
  say(by("absence-status"), "");
}

async function judge(): Promise<void> {
  const id = store.review?.flight_id;
  if (!id || outline.length < 3) return;
  if (!shown) {
    say(by("absence-status"), t("after.map_first"));
    return;
  }
  const ticket = ++judged;
  try {
    const found = await send<Absence>("POST", `/flights/${encodeURIComponent(id)}/absence`, { ...question(), outline });
    if (ticket !== judged) return;
    say(
      by("absence-status"),
      t("after.not_here", { odds: verbatim(found.not_here > 0.9995 ? "> 0.999" : found.not_here.toFixed(3)), heard: percent(found.heard), prior: fixed(found.prior, 3) }),
    );
  } catch (error) {
    if (ticket === judged) say(by("absence-status"), reasonOf(error));
  }
}
