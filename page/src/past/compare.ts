/** Two flights side by side, and both on the map. */

import { reasonOf } from "../shared/api";
import { by, fill, h } from "../shared/dom";
import { dateTime, fixed, metres, span, UNKNOWN } from "../shared/format";
import { distanceM } from "../shared/geo";
import { t, verbatim } from "../shared/i18n";
import { toast } from "../shared/notice";
import { isPlaced, store, stored, type Stored } from "../store";
import type { PositionRecord } from "../types";

interface TagFacts {
  pulses: number;
  median: number;
  best: number;
  fix: PositionRecord | undefined;
}

/** The last two that were asked for: an older answer is not shown. */
let asked = 0;

/** Load both and show them; the first is the one that the map shows in full. */
export async function compare(first: string, second: string, go: (name: string) => void): Promise<void> {
  const holder = by("compare");
  const number = ++asked;
  fill(holder, h("p", { class: "note" }, t("compare.reading")));
  const both = await Promise.all([stored(first), stored(second)]).catch((error: unknown) => {
    if (number === asked) fill(holder);
    toast(reasonOf(error), 3);
  });
  if (!both || number !== asked) return;
  const [one, two] = both;
  const show = async () => {
    try {
      if (!(await store.open(first))) return;
      store.compare(two);
      go("fly");
    } catch (error) {
      toast(reasonOf(error), 3);
    }
  };
  const named = new Map<number, string>();
  for (const row of [...one.summary.rows, ...two.summary.rows]) {
    named.set(Number(row.id), [row.id, row.name].filter(Boolean).join(" "));
  }
  for (const flight of [one, two]) {
    for (const id of new Set(flight.pulses.get("tag").subarray(0, flight.pulses.count))) {
      if (!named.has(id)) named.set(id, String(id));
    }
  }
  const lines = [...named].map(([id, name]) => line(name, factsOf(one, id), factsOf(two, id)));
  const title = (flight: Stored) =>
    h(
      "th",
      { scope: "colgroup", colspan: "4" },
      verbatim(`${dateTime(flight.summary.start_time_ns)}, ${span((flight.summary.end_time_ns - flight.summary.start_time_ns) / 1e9)}`),
    );
  const columns = [t("common.pulses"), t("compare.median_snr"), t("compare.best_snr"), t("compare.radius")];
  fill(
    holder,
    h(
      "div",
      { class: "toolbar" },
      h("h2", {}, t("compare.title")),
      h("button", { id: "compare-map", class: "primary", onclick: () => void show() }, t("compare.show_both")),
      h("button", { onclick: () => fill(holder) }, t("common.close")),
    ),
    h(
      "table",
      { class: "compared" },
      h("thead", {}, h("tr", {}, h("td", {}), title(one), title(two), h("td", {})), h("tr", {}, ...[t("common.tag"), ...columns, ...columns, t("compare.distance")].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, ...lines),
    ),
  );
  holder.scrollIntoView({ block: "nearest" });
}

function line(name: string, one: TagFacts, two: TagFacts): HTMLElement {
  const cells = [one, two].flatMap((facts) => [
    verbatim(facts.pulses.toLocaleString("en")),
    fixed(facts.median, 1, "dB"),
    fixed(facts.best, 1, "dB"),
    facts.fix ? metres(facts.fix.radius95_m) : UNKNOWN,
  ]);
  const apart =
    one.fix && two.fix
      ? metres(
          distanceM([one.fix.longitude_deg, one.fix.latitude_deg], [two.fix.longitude_deg, two.fix.latitude_deg]),
        )
      : UNKNOWN;
  return h(
    "tr",
    {},
    h("th", { scope: "row", translate: "no" }, verbatim(name)),
    ...[...cells, apart].map((text) => h("td", { class: "number" }, text)),
  );
}

function factsOf(flight: Stored, id: number): TagFacts {
  const [tag, snr] = [flight.pulses.get("tag"), flight.pulses.get("snr")];
  const values: number[] = [];
  let pulses = 0;
  for (let place = 0; place < flight.pulses.count; place += 1) {
    if (tag[place] !== id) continue;
    pulses += 1;
    if (Number.isFinite(snr[place]!)) values.push(snr[place]!);
  }
  values.sort((a, b) => a - b);
  return {
    pulses,
    median: values[values.length >> 1] ?? NaN,
    best: values.at(-1) ?? NaN,
    fix: flight.positions.find((position) => position.tag_id === id && isPlaced(position)),
  };
}
