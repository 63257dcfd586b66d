/** Who flew what: entered once, printed in the reports of all flights. */

import { get, reasonOf, send } from "../shared/api";
import { by, h, say } from "../shared/dom";
import { Queue } from "../shared/queue";
import { t, type Words } from "../shared/i18n";

interface Field {
  key: string;
  label: Words;
  hint: Words;
}

const FIELDS: Field[] = [
  { key: "operator", label: t("facts.operator"), hint: t("facts.operator_hint") },
  { key: "aircraft", label: t("facts.aircraft"), hint: t("facts.aircraft_hint") },
  { key: "permit", label: t("facts.permit"), hint: t("facts.permit_hint") },
  { key: "species", label: t("facts.species"), hint: t("facts.species_hint") },
  { key: "time_zone", label: t("facts.time_zone"), hint: t("facts.time_zone_hint") },
  { key: "altitude_datum", label: t("facts.altitude_datum"), hint: t("facts.altitude_datum_hint") },
];

export function factsSection(): HTMLElement {
  void changes.add(() => get<Record<string, string>>("/facts")).then(draw, complain);
  return h(
    "section",
    { class: "block wide", "aria-labelledby": "h-facts" },
    h("h2", { id: "h-facts" }, t("facts.title")),
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
      h("p", { class: "note" }, t("facts.where_saved")),
    ),
  );
}

function input(key: string): HTMLInputElement {
  return by(`fact-${key}`) as HTMLInputElement;
}

const changes = new Queue();

function draw(facts: Record<string, string>): void {
  for (const { key } of FIELDS)
    if (document.activeElement !== input(key) && !changes.waits(key)) input(key).value = facts[key] ?? "";
}

function complain(error: unknown): void {
  say(by("fact-fault"), reasonOf(error));
}

function change(key: string): void {
  const { value } = input(key);
  const taken = changes.add(() => send<Record<string, string>>("PUT", "/facts", { [key]: value }), key);
  void taken.then((facts) => {
    draw(facts);
    say(by("fact-fault"), "");
  }, complain);
}
