/** The list before a first flight: what is in order, and what to do about the rest. */

import { get } from "./api";
import { by, fill, h, say } from "./dom";
import { store } from "./store";
import type { Finding } from "./types";

const AGAIN_MS = 2000;
const NAMES: Record<string, string> = {
  drone: "Drone",
  radio: "Radio",
  noise: "Noise",
  time: "Time",
  poses: "Position",
  tags: "Bench tag",
  disk: "Disk",
  battery: "Battery",
  card: "Card",
  clock: "Clock",
};

let timer: number | undefined;
let drawn = "";

export function buildCheck(): void {
  fill(
    by("view-check"),
    h(
      "div",
      { class: "bench" },
      h("h2", { id: "h-check" }, "Before a first flight"),
      h("p", { class: "note" }, "Take the propellers off. Switch the drone on under the open sky, lay a tag a few metres away, press Send tags and Start, and wait half a minute."),
      h("p", { id: "check-sum", class: "check-sum", role: "status" }),
      h("ul", { id: "check-list", class: "check-list", "aria-labelledby": "h-check" }),
    ),
  );
}

/** Ask while it is looked at. */
export function showCheck(visible: boolean): void {
  clearInterval(timer);
  timer = visible ? setInterval(() => void ask(), AGAIN_MS) : undefined;
  if (visible) void ask();
}

async function ask(): Promise<void> {
  const found = await get<Finding[]>("/first-flight").catch(() => null);
  if (!found) {
    say(by("check-sum"), "The ground station does not answer.");
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
function verdict(wrong: number, open: number, count: number): string {
  if (store.state?.armed) return "The vehicle is armed: this list is for the bench.";
  if (wrong) return `${wrong} of ${count} to fix`;
  if (open) return "No fault found, but some points are not known yet: see “?”. Then stop, put the propellers on, and fly.";
  return "Everything is in order. Stop, put the propellers on, and fly.";
}

function row(one: Finding): HTMLElement {
  const [kind, mark, word] = one.ok ? ["good", "✓", "passed: "] : one.open ? ["open", "?", "open: "] : ["bad", "✗", "to fix: "];
  return h(
    "li",
    { class: `check-row ${kind}`, "data-check": one.what, "data-ok": String(one.ok) },
    h("span", { class: "check-mark", "aria-hidden": "true" }, mark),
    h("span", { class: "check-name" }, NAMES[one.what] ?? one.what),
    h("span", { class: "check-text" }, h("span", { class: "hidden-word" }, word), one.text),
    one.remedy ? h("span", { class: "check-remedy" }, one.remedy) : null,
  );
}
