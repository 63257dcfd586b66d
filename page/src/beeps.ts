/** Unlisted beeps, and what a measurement corrects of the list. */

import { ApiError, reasonOf, send } from "./api";
import { by, fill, h } from "./dom";
import { toast } from "./notice";
import { store } from "./store";
import type { BeepRecord, State } from "./types";

let drawn = "";

export function beepBox(): HTMLElement {
  return h("div", { id: "beeps", class: "beeps", role: "group", "aria-label": "What else beeps", hidden: true });
}

/** The list changes seldom; it is drawn when it has changed, so that a button stays under a finger. */
export function drawBeeps(): void {
  const state = store.review ? null : store.state;
  const key = state ? JSON.stringify([state.beeps, state.corrections, state.common_ppm, store.looksOn()]) : "";
  if (key === drawn) return;
  drawn = key;
  const box = by("beeps");
  const odd = state?.beeps.filter((one) => one.odd) ?? [];
  odd.sort((a, b) => b.corrects.length - a.corrects.length);
  const listed = state?.beeps.filter((one) => !one.odd && one.corrects.length) ?? [];
  const common_ppm = state?.common_ppm ?? null;
  box.hidden = !state || !(odd.length || listed.length || state.corrections.length || common_ppm !== null);
  if (!state || box.hidden) return;
  fill(
    box,
    odd.length > 0 && h("h3", {}, "What else beeps"),
    common_ppm !== null && common(common_ppm),
    ...odd.map(item),
    listed.length > 0 &&
      h("details", {}, h("summary", {}, `Measured values (${listed.length})`), ...listed.map(item)),
    ...state.corrections.map(corrected),
  );
}

function item(one: BeepRecord): HTMLElement {
  const place = `${(one.frequency_hz / 1e6).toFixed(4)}\u202fMHz`;
  const interval = one.odd ? (1e3 * one.interval_s).toFixed(0) : (1e3 * one.interval_s).toFixed(1);
  return h(
    "div",
    { class: "beep", "data-kind": one.kind },
    h("strong", {}, one.meaning),
    h("span", { class: "facts" }, `${place} · every ${interval}\u202fms · ${one.pulses} pulses · ${one.level_db.toFixed(0)}\u202fdB`),
    ...one.corrects.map((of) => press(words(of), { tag_id: of.tag_id, frequency_hz: one.frequency_hz })),
  );
}

function words({ tag_id, what }: BeepRecord["corrects"][number]): string {
  return what === "interval" ? `List this interval for tag ${tag_id}` : `List tag ${tag_id} here`;
}

function common(ppm: number): HTMLElement {
  const signed = `${ppm > 0 ? "+" : ""}${ppm.toFixed(1)}`;
  const text = `The tags are ${signed} ppm off their labels: the receiver's own error`;
  return h("p", { class: "note" }, text, " ", button("Correct the receiver", () => correctReceiver(ppm)));
}

function corrected(one: State["corrections"][number]): HTMLElement {
  return h("div", { class: "beep" }, h("span", { class: "facts" }, one.text), press("Undo", { tag_id: one.tag_id, undo: true }));
}

function press(text: string, request: object): HTMLElement {
  return button(text, () => send<{ message: string }>("POST", "/commands/correct_tag", request));
}

function button(text: string, ask: () => Promise<{ message: string }>): HTMLElement {
  const one = h("button", { disabled: store.looksOn(), onclick: () => void answer() }, text) as HTMLButtonElement;
  async function answer(): Promise<void> {
    one.disabled = true;
    try {
      toast((await ask()).message, 6);
    } catch (error) {
      toast(reasonOf(error), 3);
      one.disabled = false;
    }
  }
  return one;
}

async function correctReceiver(ppm: number): Promise<{ message: string }> {
  const found = await send<Record<string, number>>("POST", "/parameters", {});
  const before = found["RADIO_PPM"];
  if (before === undefined) throw new ApiError("the drone has no parameter RADIO_PPM", 409);
  // A slow crystal shows all frequencies too high.
  return send("POST", "/commands/set_parameter", { name: "RADIO_PPM", value: Number((before - ppm).toFixed(2)) });
}
