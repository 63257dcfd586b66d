/** Unlisted beeps, and what a measurement corrects of the list. */

import { ApiError, reasonOf, send } from "../shared/api";
import { by, fill, h } from "../shared/dom";
import { fixed } from "../shared/format";
import { fromServer, listed, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";
import type { BeepRecord, State } from "../types";

let drawn = "";

export function beepBox(): HTMLElement {
  return h("div", { id: "beeps", class: "beeps", role: "group", "aria-label": t("beeps.title"), hidden: true });
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
  const measured = state?.beeps.filter((one) => !one.odd && one.corrects.length) ?? [];
  const common_ppm = state?.common_ppm ?? null;
  box.hidden = !state || !(odd.length || measured.length || state.corrections.length || common_ppm !== null);
  if (!state || box.hidden) return;
  fill(
    box,
    odd.length > 0 && h("h3", {}, t("beeps.title")),
    common_ppm !== null && common(common_ppm),
    ...odd.map(item),
    measured.length > 0 &&
      h("details", {}, h("summary", {}, t("beeps.measured", { count: measured.length })), ...measured.map(item)),
    ...state.corrections.map(corrected),
  );
}

function item(one: BeepRecord): HTMLElement {
  const facts = listed(
    fixed(one.frequency_hz / 1e6, 4, "MHz"),
    t("fly.every", { interval: fixed(1e3 * one.interval_s, one.odd ? 0 : 1) }),
    t("common.pulse_count", { pulses: one.pulses }),
    fixed(one.level_db, 0, "dB"),
  );
  return h(
    "div",
    { class: "beep", "data-kind": one.kind },
    h("strong", {}, fromServer(one.meaning)),
    h("span", { class: "facts" }, facts),
    ...one.corrects.map((of) => press(words(of), { tag_id: of.tag_id, frequency_hz: one.frequency_hz })),
  );
}

function words({ tag_id, what }: BeepRecord["corrects"][number]): Words {
  return what === "interval" ? t("beeps.correct_interval", { tag: tag_id }) : t("beeps.correct_frequency", { tag: tag_id });
}

function common(ppm: number): HTMLElement {
  const text = t("beeps.receiver_off", { ppm: verbatim(`${ppm > 0 ? "+" : ""}${ppm.toFixed(1)}`) });
  return h("p", { class: "note" }, text, verbatim(" "), button(t("beeps.correct_receiver"), () => correctReceiver(ppm)));
}

function corrected(one: State["corrections"][number]): HTMLElement {
  return h("div", { class: "beep" }, h("span", { class: "facts" }, fromServer(one.text)), press(t("beeps.undo"), { tag_id: one.tag_id, undo: true }));
}

function press(text: Words, request: object): HTMLElement {
  return button(text, () => send<{ message: string }>("POST", "/commands/correct_tag", request));
}

function button(text: Words, ask: () => Promise<{ message: string }>): HTMLElement {
  const one = h("button", { disabled: store.looksOn(), onclick: () => void answer() }, text) as HTMLButtonElement;
  async function answer(): Promise<void> {
    one.disabled = true;
    try {
      toast(fromServer((await ask()).message), 6);
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
  if (before === undefined) throw new ApiError(t("beeps.no_radio_ppm"), 409);
  // A slow crystal shows all frequencies too high.
  return send("POST", "/commands/set_parameter", { name: "RADIO_PPM", value: Number((before - ppm).toFixed(2)) });
}
