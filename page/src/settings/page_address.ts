/** How a phone or tablet comes to this page: a code for its camera. */

import { get } from "../shared/api";
import { by, fill, h } from "../shared/dom";
import { t, verbatim, type Words } from "../shared/i18n";
import type { Door } from "../types";

const TITLES: Record<string, Words> = { page: t("common.this_page"), "access point": t("doors.wi_fi") };

export function addressSection(): HTMLElement {
  void get<Door[]>("/doors").then(draw, () => undefined);
  return h(
    "section",
    { class: "block wide", "aria-labelledby": "h-doors" },
    h("h2", { id: "h-doors" }, t("doors.title")),
    h("div", { id: "doors", class: "doors" }, h("p", { class: "note" }, t("doors.local_only"))),
  );
}

function draw(doors: Door[]): void {
  if (!doors.length) return;
  fill(
    by("doors"),
    ...doors.map((door) =>
      h(
        "figure",
        { class: "door", "data-door": door.what },
        h("img", { src: door.picture, width: 180, height: 180, alt: t("doors.qr_code") }),
        h("figcaption", {}, h("span", {}, TITLES[door.what] ?? verbatim(door.what)), door.what === "page" ? h("a", { href: door.text, translate: "no" }, verbatim(door.text)) : null),
      ),
    ),
  );
}
