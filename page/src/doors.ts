/** How a phone or tablet comes to this page: a code for its camera. */

import { get } from "./api";
import { by, fill, h } from "./dom";
import type { Door } from "./types";

const TITLES: Record<string, string> = { page: "This page", "access point": "Wi-Fi of this computer" };

export function doorsSection(): HTMLElement {
  void get<Door[]>("/doors").then(draw, () => undefined);
  return h(
    "section",
    { class: "block wide", "aria-labelledby": "h-doors" },
    h("h2", { id: "h-doors" }, "On a phone"),
    h("div", { id: "doors", class: "doors" }, h("p", { class: "note" }, "This page is served to this computer only: start it with --listen 0.0.0.0 and a password.")),
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
        h("img", { src: door.picture, width: 180, height: 180, alt: "QR code" }),
        h("figcaption", {}, h("span", {}, TITLES[door.what] ?? door.what), door.what === "page" ? h("a", { href: door.text, translate: "no" }, door.text) : null),
      ),
    ),
  );
}
