/** The log, filtered. */

import { by, fill, h, say } from "./dom";
import { clock, dateTime } from "./format";
import { toast } from "./notice";
import { store } from "./store";

const SEVERITIES = ["emergency", "alert", "critical", "error", "warning", "notice", "info", "debug"];
const SHOWN = 500;

let shown = false;
let seen = 0;

export function buildLog(): void {
  const text = h("input", { id: "log-text", type: "search", placeholder: "Text", "aria-label": "Text to search for", oninput: draw });
  const severity = h("select", { id: "log-severity", "aria-label": "At least as severe as", onchange: draw },
    ...[["7", "everything"], ["6", "info"], ["5", "notices"], ["4", "warnings"], ["3", "errors"]].map(([value, label]) =>
      h("option", { value, selected: value === "6" }, label),
    ),
  );
  const source = h("select", { id: "log-source", "aria-label": "From", onchange: draw },
    ...[["", "from all"], ["drone", "the drone"], ["acknowledgement", "acknowledgements"], ["ground", "this station"]].map(
      ([value, label]) => h("option", { value }, label),
    ),
  );
  fill(
    by("view-log"),
    h("div", { class: "toolbar" }, text, severity, source, h("span", { id: "log-count", class: "note" })),
    h("div", { id: "log-lines", class: "log-lines", role: "log", "aria-label": "Log", tabindex: "0" }),
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
      if ((line.number ?? 0) > seen && line.severity <= 4) toast(line.text, line.severity);
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
        h("span", { class: "log-kind" }, SEVERITIES[line.severity] ?? String(line.severity)),
        h("span", { class: "log-source" }, line.source),
        h("span", { class: "log-said", translate: "no" }, line.text),
      ),
    ),
    latest.length ? null : h("p", { class: "empty" }, "No matching lines."),
  );
  say(by("log-count"), `${found.length} of ${lines.length} lines, newest first, times UTC`);
}
