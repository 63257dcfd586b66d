/** The log, filtered. */

import { by, fill, h, say } from "../shared/dom";
import { clock, dateTime } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";

const SEVERITIES = [
  t("log.emergency"),
  t("log.alert"),
  t("log.critical"),
  t("log.error"),
  t("log.warning"),
  t("log.notice"),
  t("log.info"),
  t("log.debug"),
];
const SOURCES: Record<string, Words> = { drone: t("log.drone"), acknowledgement: t("log.acknowledgement"), ground: t("log.ground") };
const SHOWN = 500;

let shown = false;
let seen = 0;

export function buildLog(): void {
  const text = h("input", { id: "log-text", type: "search", placeholder: t("log.text"), "aria-label": t("log.text_hint"), oninput: draw });
  const severity = h("select", { id: "log-severity", "aria-label": t("log.severity"), onchange: draw },
    ...([["7", t("log.everything")], ["6", t("log.info_at_least")], ["5", t("log.notices")], ["4", t("log.warnings")], ["3", t("log.errors")]] as const).map(
      ([value, label]) => h("option", { value, selected: value === "6" }, label),
    ),
  );
  const source = h("select", { id: "log-source", "aria-label": t("log.source"), onchange: draw },
    ...([["", t("log.from_all")], ["drone", t("log.from_drone")], ["acknowledgement", t("log.acknowledgements")], ["ground", t("log.from_station")]] as const).map(
      ([value, label]) => h("option", { value }, label),
    ),
  );
  fill(
    by("view-log"),
    h("div", { class: "toolbar" }, text, severity, source, h("span", { id: "log-count", class: "note" })),
    h("div", { id: "log-lines", class: "log-lines", role: "log", "aria-label": t("common.log"), tabindex: "0" }),
  );
  store.on(["log", "reset"], () => {
    announce();
    draw();
  });
}

export function showLog(visible: boolean): void {
  shown = visible;
  if (visible) draw();
}

/** New warnings are shown, and spoken where that is wanted. */
function announce(): void {
  const last = store.log.at(-1)?.number ?? 0;
  if (seen > 0) {
    for (const line of store.log) {
      if ((line.number ?? 0) > seen && line.severity <= 4) toast(fromServer(line.text), line.severity);
    }
  }
  seen = last || seen || 1;
}

function draw(): void {
  if (!shown) return;
  const words = (by("log-text") as HTMLInputElement).value.toLowerCase();
  const most = Number((by("log-severity") as HTMLSelectElement).value);
  const source = (by("log-source") as HTMLSelectElement).value;
  const lines = store.review ? store.review.log : store.log;
  const found = lines.filter(
    (line) =>
      line.severity <= most &&
      (!source || line.source === source) &&
      (!words || line.text.toLowerCase().includes(words)),
  );
  const latest = found.slice(-SHOWN).reverse();
  fill(
    by("log-lines"),
    ...latest.map((line) =>
      h(
        "div",
        { class: `log-line severity-${line.severity}` },
        h("time", { title: dateTime(line.time_ns) }, clock(line.time_ns)),
        h("span", { class: "log-kind" }, SEVERITIES[line.severity] ?? line.severity),
        h("span", { class: "log-source" }, SOURCES[line.source] ?? verbatim(line.source)),
        h("span", { class: "log-said", translate: "no" }, verbatim(line.text)),
      ),
    ),
    latest.length ? null : h("p", { class: "empty" }, t("log.no_lines")),
  );
  say(by("log-count"), t("log.count", { found: found.length, lines: lines.length }));
}
