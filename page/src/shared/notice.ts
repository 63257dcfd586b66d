/** Short messages at the edge of the screen; warnings stay until they are read. */

import { h } from "./dom";
import { t, verbatim, type Words } from "./i18n";
import { speak, speaking } from "./speech";

let holder: HTMLElement | null = null;

/** Show a message; `severity` is MAVLink's, 4 and below is a warning. */
export function toast(words: Words, severity: number): void {
  if (!holder) {
    holder = h("div", { class: "toasts", role: "status", "aria-live": "polite" });
    document.body.appendChild(holder);
  }
  const warning = severity <= 4;
  const box = h(
    "div",
    { class: warning ? "toast warning" : "toast" },
    h("span", {}, words),
    h("button", { "aria-label": t("common.close"), onclick: () => box.remove() }, verbatim("×")),
  );
  holder.appendChild(box);
  while (holder.childElementCount > 4) holder.firstElementChild?.remove();
  setTimeout(() => box.remove(), warning ? 12_000 : 4_000);
  if (warning && speaking()) speak(words);
}
