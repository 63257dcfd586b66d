/** A past flight, moment by moment. */

import { by, h, say } from "../shared/dom";
import { t, verbatim } from "../shared/i18n";
import { store } from "../store";

export function replayBar(): HTMLElement {
  const slider = h("input", {
    id: "replay-slider",
    type: "range",
    min: "0",
    max: "1000",
    value: "1000",
    "aria-label": t("replay.time"),
    oninput: () => seek(Number(slider.value) / 1000),
  });
  return h(
    "div",
    { id: "replay", class: "replay", hidden: true },
    h("button", { id: "replay-play", onclick: togglePlay }, t("replay.play")),
    slider,
    h("span", { id: "replay-time" }),
    h("button", { id: "replay-live", onclick: backToLive }, t("replay.back_to_live")),
  );
}

let playing: ReturnType<typeof setInterval> | null = null;

function seek(part: number): void {
  const review = store.review;
  if (!review) return;
  const whole = review.end_time_ns - review.start_time_ns;
  store.seek(part >= 1 ? Infinity : review.start_time_ns + part * whole);
}

function togglePlay(): void {
  if (playing !== null) {
    stopPlaying();
    return;
  }
  const slider = by("replay-slider") as HTMLInputElement;
  if (Number(slider.value) >= 1000) slider.value = "0";
  say(by("replay-play"), t("replay.pause"));
  // A whole flight in 20 s, ten steps a second.
  playing = setInterval(() => {
    slider.value = String(Number(slider.value) + 5);
    seek(Number(slider.value) / 1000);
    if (Number(slider.value) >= 1000) stopPlaying();
  }, 100);
}

function stopPlaying(): void {
  if (playing !== null) clearInterval(playing);
  playing = null;
  say(by("replay-play"), t("replay.play"));
}

function backToLive(): void {
  stopPlaying();
  store.backToLive();
  store.emit("selection");
  store.emit("state");
}

export function drawReplay(): void {
  const review = store.review;
  by("replay").hidden = review === null;
  if (!review) return;
  const now = Math.min(store.until, review.end_time_ns);
  const past = (now - review.start_time_ns) / 1e9;
  say(by("replay-time"), verbatim(`${Math.floor(past / 60)}:${String(Math.floor(past % 60)).padStart(2, "0")}`));
  if (!Number.isFinite(store.until)) (by("replay-slider") as HTMLInputElement).value = "1000";
}
