/** The list before a first flight: what is in order, and what to do about the rest. */

import { get } from "../shared/api";
import { by, fill, h, say } from "../shared/dom";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { store } from "../store";
import type { Finding } from "../types";

const AGAIN_MS = 2000;
const NAMES: Record<string, Words> = {
  drone: t("common.drone"),
  radio: t("common.radio"),
  noise: t("check.noise"),
  time: t("check.time"),
  poses: t("check.position"),
  tags: t("check.bench_tag"),
  disk: t("check.disk"),
  battery: t("check.battery"),
  card: t("check.card"),
  clock: t("check.clock"),
};

/** The last time that the list was opened or left; what was asked before that is not shown. */
let opened = 0;
let drawn = "";

export function buildCheck(): void {
  fill(
    by("view-check"),
    h(
      "div",
      { class: "bench" },
      h("h2", { id: "h-check" }, t("check.title")),
      h("p", { class: "note" }, t("check.instructions")),
      h("p", { id: "check-sum", class: "check-sum", role: "status" }),
      h("ul", { id: "check-list", class: "check-list", "aria-labelledby": "h-check" }),
    ),
  );
}

/** Ask while it is looked at, again after each answer. */
export async function showCheck(visible: boolean): Promise<void> {
  const mine = ++opened;
  while (visible && mine === opened) {
    const found = await get<Finding[]>("/first-flight").catch(() => null);
    if (mine === opened) draw(found);
    await new Promise((done) => setTimeout(done, AGAIN_MS));
  }
}

function draw(found: Finding[] | null): void {
  if (!found) {
    say(by("check-sum"), t("check.no_answer"));
    return;
  }
  const wrong = found.filter((one) => !one.ok && !one.open).length;
  const open = found.filter((one) => one.open).length;
  say(by("check-sum"), verdict(wrong, open, found.length));
  by("check-sum").classList.toggle("good", !wrong && !open && !store.state?.armed);
  by("check-sum").classList.toggle("open", !wrong && open > 0 && !store.state?.armed);
  const key = JSON.stringify(found);
  if (key === drawn) return;
  drawn = key;
  fill(by("check-list"), ...found.map(row));
}

/** In flight it gives no verdict: propellers must not be put on then. */
function verdict(wrong: number, open: number, count: number): Words {
  if (store.state?.armed) return t("check.armed");
  if (wrong) return t("check.count_to_fix", { wrong, count });
  if (open) return t("check.some_open");
  return t("check.all_passed");
}

function row(one: Finding): HTMLElement {
  const [kind, mark, word] = one.ok
    ? ["good", "✓", t("check.passed")] as const
    : one.open ? ["open", "?", t("check.open")] as const : ["bad", "✗", t("check.to_fix")] as const;
  return h(
    "li",
    { class: `check-row ${kind}`, "data-check": one.what, "data-ok": String(one.ok) },
    h("span", { class: "check-mark", "aria-hidden": "true" }, verbatim(mark)),
    h("span", { class: "check-name" }, NAMES[one.what] ?? verbatim(one.what)),
    h("span", { class: "check-text" }, h("span", { class: "hidden-word" }, word), verbatim(" "), fromServer(one.text)),
    one.remedy ? h("span", { class: "check-remedy" }, fromServer(one.remedy)) : null,
  );
}
