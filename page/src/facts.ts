/** Who flew what: entered once, printed in the reports of all flights. */

import { get, reasonOf, send } from "./api";
import { by, h, say } from "./dom";
import { t, type Words } from "./i18n";

interface Field {
  key: string;
  label: Words;
  hint: Words;
}

const FIELDS: Field[] = [
  { key: "operator", label: t("facts.operator"), hint: t("facts.name_of_the_operator") },
  { key: "aircraft", label: t("facts.aircraft"), hint: t("facts.kind_and_registration") },
  { key: "permit", label: t("facts.permit"), hint: t("facts.number_of_the_permission_to") },
  { key: "species", label: t("facts.species"), hint: t("facts.of_the_tagged_animals") },
  { key: "time_zone", label: t("facts.time_zone"), hint: t("facts.reports_show_local_time_as") },
  { key: "altitude_datum", label: t("facts.altitudes_refer_to"), hint: t("facts.what_heights_above_the_sea") },
];

export function factsSection(): HTMLElement {
  void get<Record<string, string>>("/facts").then(draw, complain);
  return h(
    "section",
    { class: "block wide", "aria-labelledby": "h-facts" },
    h("h2", { id: "h-facts" }, t("facts.in_reports")),
    h(
      "form",
      { class: "facts", onsubmit: (event: Event) => event.preventDefault() },
      ...FIELDS.map((field) =>
        h("label", { title: field.hint }, field.label, h("input", {
          id: `fact-${field.key}`,
          autocomplete: "off",
          maxlength: "200",
          list: field.key === "time_zone" ? "time-zones" : undefined,
          onchange: () => change(field.key),
        })),
      ),
      h("datalist", { id: "time-zones" }, ...Intl.supportedValuesOf("timeZone").map((zone) => h("option", { value: zone }))),
      h("p", { id: "fact-fault", class: "fault-line", role: "alert" }),
      h("p", { class: "note" }, t("facts.saved_in_report_toml_next")),
    ),
  );
}

function input(key: string): HTMLInputElement {
  return by(`fact-${key}`) as HTMLInputElement;
}

/** Fields whose change is on its way, and the end of the last change: one is sent after the other. */
const waiting = new Set<string>();
let sent: Promise<void> = Promise.resolve();

function draw(facts: Record<string, string>): void {
  for (const { key } of FIELDS)
    if (document.activeElement !== input(key) && !waiting.has(key)) input(key).value = facts[key] ?? "";
}

function complain(error: unknown): void {
  say(by("fact-fault"), reasonOf(error));
}

function change(key: string): void {
  const { value } = input(key);
  waiting.add(key);
  sent = sent.then(async () => {
    try {
      const facts = await send<Record<string, string>>("PUT", "/facts", { [key]: value });
      waiting.delete(key);
      draw(facts);
      say(by("fact-fault"), "");
    } catch (error) {
      waiting.delete(key);
      complain(error);
    }
  });
}
