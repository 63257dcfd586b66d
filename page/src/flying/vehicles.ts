/** Several vehicles of one station: who they are, the way to the page of each, letting another be served. */

import { BASE, reasonOf, send } from "../shared/api";
import { mayCommand } from "./commands";
import { by, fill, h } from "../shared/dom";
import { vehicleName } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";

const CLASSES: Record<string, string> = { detecting: "live", capturing: "live" };
/** States of a drone's software. */
export const STATES: Record<string, Words> = {
  idle: t("state.idle"),
  receiving_tags: t("state.receiving_tags"),
  has_tags: t("state.ready"),
  detecting: t("state.detecting"),
  capturing: t("state.capturing"),
};

/** Vehicles on the link without a page. */
export function unserved(): number[] {
  const state = store.state;
  if (!state) return [];
  const served = state.fleet.map((one) => one.system_id);
  return state.drone.others.filter((number) => !served.includes(number));
}

export async function serve(number: number): Promise<void> {
  try {
    await send("POST", "/vehicles", { system_id: number }, {}, "");
    toast(t("vehicles.served", { number }), 5);
  } catch (error) {
    toast(reasonOf(error), 3);
  }
}

/** One link for each vehicle in the header, and a button for one that is heard besides. */
export function drawVehicles(): void {
  const fleet = store.state?.fleet ?? [];
  // Only the first page hears of others, and it has a vehicle of its own.
  const heard = BASE === "" && store.state?.drone.present ? unserved() : [];
  const links = fleet.map((one) =>
    h(
      "a",
      {
        class: `chip vehicle ${one.present ? (CLASSES[one.state ?? ""] ?? "good") : "bad"}`,
        href: one.page + location.hash,
        "data-vehicle": String(one.system_id),
        "aria-current": one.page === `${BASE}/` ? "page" : null,
        "aria-label": vehicleName(one),
        title: t("vehicles.summary", { name: vehicleName(one), state: one.present ? (STATES[one.state ?? ""] ?? t("vehicles.connected")) : t("vehicles.no_contact"), pulses: one.pulses }),
      },
      verbatim(one.name || `V${one.system_id ?? "?"}`),
    ),
  );
  const buttons = heard.map((number) =>
    h("button", { class: "chip warn serve-vehicle", "data-vehicle": String(number), title: t("vehicles.serve_hint", { number }), onclick: () => void serve(number) }, t("vehicles.serve", { number })),
  );
  const place = by("vehicles");
  const key = JSON.stringify([fleet.map((one) => [one.page, one.name, one.present, one.state, one.system_id]), heard, location.hash]);
  place.hidden = links.length + buttons.length === 0;
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  fill(place, ...links, ...buttons);
}

// ------------------------------------------------------------------- to all

/** What may be asked of all at once, with its label; nothing that moves a vehicle. */
const TO_ALL: [string, Words][] = [
  ["send_tags", t("vehicles.send_tags")],
  ["start", t("common.start")],
  ["stop", t("common.stop")],
];

interface Answers {
  accepted: boolean;
  answers: { system_id: number | null; name: string; accepted: boolean; message: string }[];
}

/** Buttons that ask all vehicles, and what each answered; nothing where there is but one. */
export function toAllBox(): HTMLElement {
  const buttons = TO_ALL.map(([name, label]) =>
    h("button", { id: `all-${name}`, class: name === "stop" ? "all-stop" : "", title: t("vehicles.to_all_hint"), onclick: () => void askAll(name) }, label),
  );
  const box = h(
    "section",
    { id: "to-all", class: "to-all", hidden: true, "aria-label": t("vehicles.to_all_label") },
    h("span", { class: "note" }, t("vehicles.to_all")),
    ...buttons,
    h("div", { id: "all-answers", class: "all-answers", role: "status" }),
  );
  const draw = (): void => {
    box.hidden = (store.state?.fleet.length ?? 0) < 2;
    const mayNot = store.review !== null || store.looksOn();
    for (const button of buttons) button.setAttribute("aria-disabled", String(mayNot && button.id !== "all-stop"));
  };
  store.on(["state", "reset"], draw);
  return box;
}

/** The last that was asked of all: an older answer is not shown over its own. */
let asked = 0;

async function askAll(name: string): Promise<void> {
  if (!(await mayCommand(name, () => undefined))) return;
  const number = ++asked;
  try {
    const said = await send<Answers>("POST", `/vehicles/commands/${name}`, {}, {}, "");
    if (number !== asked) return;
    const rows = said.answers.map((one) =>
      h(
        "li",
        { class: one.accepted ? "" : "fault-line", "data-vehicle": String(one.system_id) },
        h("strong", { translate: one.name ? "no" : null }, vehicleName(one)),
        // Where a drone records is a path, and has no words.
        h("span", {}, one.message.includes("/") ? verbatim(one.message) : fromServer(one.message)),
      ),
    );
    fill(by("all-answers"), h("ul", {}, ...rows), h("button", { id: "all-close", onclick: () => fill(by("all-answers")) }, t("common.close")));
  } catch (error) {
    toast(reasonOf(error), 3);
  }
}
