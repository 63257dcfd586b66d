/**
 * The first set-up of a drone's computer, where this page runs on it: one step after the other,
 * each judged and written by the server. It comes by itself until it has been finished.
 */

import { ApiError, BASE, get, getOnceThere, reasonOf, send } from "../shared/api";
import { fill, h, say } from "../shared/dom";
import { choose, fromServer, language, LANGUAGES, t, verbatim, type Words } from "../shared/i18n";
import type { Choices, Finding, SetUp } from "../types";

type Values = Record<string, string | boolean>;

interface Step {
  name: string;
  title: Words;
  about: Words;
  /** What the step can try, if anything. */
  test?: Words;
  fields: (setup: SetUp) => Node[];
}

const STEPS: Step[] = [
  {
    name: "name",
    title: t("common.name"),
    about: t("wizard.about_name"),
    fields: (setup) => [field("name", t("common.name"), setup.values.name, t("wizard.name_hint"))],
  },
  {
    name: "antenna",
    title: t("common.antenna"),
    about: t("wizard.about_antenna"),
    fields: (setup) => [
      select("antenna", t("common.antenna"), setup.choices.antennas.map((name) => [name, name]), setup.values.antenna),
      field("yaw_offset_deg", t("wizard.yaw"), String(setup.values.yaw_offset_deg), t("wizard.yaw_hint")),
    ],
  },
  {
    name: "radio",
    title: t("common.radio"),
    about: t("wizard.about_radio"),
    test: t("wizard.test_radio"),
    fields: radioFields,
  },
  {
    name: "autopilot",
    title: t("wizard.autopilot"),
    about: t("wizard.about_autopilot"),
    test: t("wizard.test_link"),
    fields: autopilotFields,
  },
  {
    name: "keys",
    title: t("wizard.keys"),
    about: t("wizard.about_keys"),
    fields: keyFields,
  },
];

let dialog: HTMLDialogElement;
let setup: SetUp;
let at = 0;
/** Values of the last test that passed, or that was skipped. */
let tested = "";
let busy = false;

/** Ask the server whether this computer has been set up, and begin if not. */
export async function offerSetUp(): Promise<void> {
  if (BASE) return;
  const found = await get<SetUp>("/set-up").catch(() => null);
  if (!found?.wanted) return;
  setup = found;
  at = Math.max(0, STEPS.findIndex((step) => !setup.done.includes(step.name)));
  dialog = h("dialog", { id: "wizard", class: "wizard", "aria-labelledby": "wizard-title" });
  document.body.append(dialog);
  draw();
  dialog.showModal();
  focusFirst();
}

function draw(): void {
  const step = STEPS[at]!;
  fill(
    dialog,
    h(
      "header",
      {},
      h("h2", { id: "wizard-title" }, t("wizard.title")),
      h("select", { id: "wizard-language", "aria-label": t("common.language"), onchange: (event: Event) => choose((event.target as HTMLSelectElement).value) },
        ...LANGUAGES.map(([name, own]) => h("option", { value: name, lang: name, translate: "no", selected: name === language }, own)),
      ),
    ),
    h(
      "ol",
      { class: "wizard-steps" },
      ...STEPS.map((one, place) => h("li", { class: place < at ? "past" : "", "aria-current": place === at ? "step" : undefined }, one.title)),
    ),
    h(
      "form",
      {
        id: "wizard-form",
        novalidate: true,
        oninput: (event: Event) => {
          forgetTest();
          const one = event.target as HTMLInputElement;
          one.removeAttribute("aria-invalid");
          const fault = dialog.querySelector(`#wizard-${one.name}-fault`);
          if (fault) say(fault, "");
        },
        onsubmit: (event: Event) => {
          event.preventDefault();
          void alone(next);
        },
      },
      h("p", { class: "note" }, step.about),
      h("div", { class: "wizard-fields" }, ...step.fields(setup)),
      h("ul", { id: "wizard-found", class: "check-list", role: "status" }),
      h("p", { id: "wizard-fault", class: "fault-line", role: "alert" }),
      h(
        "footer",
        {},
        h("button", { id: "wizard-later", type: "button", onclick: () => dialog.close() }, t("common.later")),
        h("span", { class: "gap" }),
        at > 0 ? h("button", { id: "wizard-back", type: "button", onclick: () => void alone(() => go(at - 1)) }, t("wizard.back")) : null,
        step.test ? h("button", { id: "wizard-test", type: "button", onclick: () => void alone(test) }, step.test) : null,
        h("button", { id: "wizard-next", class: "primary" }, at === STEPS.length - 1 ? t("wizard.finish") : t("wizard.next")),
      ),
    ),
  );
}

function go(place: number): void {
  at = place;
  tested = "";
  draw();
  focusFirst();
}

function focusFirst(): void {
  dialog.querySelector<HTMLElement>(".wizard-fields input, .wizard-fields select, #wizard-close")?.focus();
}

// ------------------------------------------------------------------- fields

function labelled(name: string, label: Words, input: HTMLElement): HTMLElement {
  input.setAttribute("aria-describedby", `wizard-${name}-fault`);
  return h("label", {}, h("span", {}, label), input, h("span", { class: "fault", id: `wizard-${name}-fault` }));
}

function field(name: string, label: Words, value: string, hint: Words | "" = "", type = "text"): HTMLElement {
  return labelled(name, label, h("input", { id: `wizard-${name}`, name, type, value, placeholder: hint, title: hint, autocomplete: "off", spellcheck: "false", maxlength: 1600 }));
}

function select(name: string, label: Words, choices: [string, string][], value: string, onchange?: () => void): HTMLElement {
  return labelled(name, label, h("select", { id: `wizard-${name}`, name, onchange },
    ...choices.map(([key, text]) => h("option", { value: key, translate: "no", selected: key === value }, verbatim(text))),
  ));
}

function radioFields(): Node[] {
  const { radios, plugged_in } = setup.choices;
  const titles = new Map(radios.map((row) => [row.kind, row.title]));
  const found = plugged_in.map((kind) => titles.get(kind) ?? kind).join(", ");
  const chosen = setup.done.includes("radio") ? setup.values.kind : (plugged_in[0] ?? setup.values.kind);
  const row = radios.find((one) => one.kind === chosen);
  const rate = chosen === setup.values.kind ? setup.values.sample_rate_msps : (row?.rate_msps ?? 3);
  return [
    h("p", { class: "note" }, found ? t("wizard.plugged_in", { radios: verbatim(found) }) : t("wizard.no_radio")),
    select("kind", t("common.radio"), radios.map((one) => [one.kind, one.title]), chosen, () => {
      const now = radios.find((one) => one.kind === input("kind").value);
      if (now) input("sample_rate_msps").value = String(now.rate_msps);
    }),
    field("gain", t("wizard.gain"), setup.values.gain === null ? "" : String(setup.values.gain), t("wizard.gain_empty")),
    field("sample_rate_msps", t("wizard.sample_rate"), String(rate)),
    labelled("bias_tee", t("wizard.bias_tee"), h("input", { id: "wizard-bias_tee", name: "bias_tee", type: "checkbox", checked: setup.values.bias_tee })),
  ];
}

function autopilotFields(): Node[] {
  const ports = h("select", { id: "wizard-port", onchange: () => {
    if (ports.value) input("address").value = ports.value;
    forgetTest();
  } }, h("option", { value: "" }, t("common.address_below")));
  void getOnceThere<Choices>("/choices").then((choices) =>
    choices.ports.forEach((port) => ports.append(h("option", { value: port.address, translate: "no" }, verbatim(`${port.device} ${port.description}`)))),
  );
  return [
    h("label", {}, h("span", {}, t("wizard.ports")), ports),
    field("address", t("common.address"), setup.values.address, verbatim("serial:///dev/ttyAMA0:57600")),
  ];
}

function keyFields(): Node[] {
  const file = h("input", { id: "wizard-update-file", type: "file", accept: ".pem", onchange: () => void file.files?.[0]?.text().then((text) => (update.value = text)) });
  const update = h("input", { type: "hidden", name: "update_key", id: "wizard-update_key" });
  return [
    field("page_password", t("wizard.page_password"), "", t("wizard.password_hint"), "password"),
    field("wifi_password", t("wizard.wi_fi_password"), "", t("wizard.password_hint"), "password"),
    field("command_key", t("wizard.command_key"), "", setup.values.command_key ? t("wizard.key_exists") : t("wizard.key_missing")),
    h("p", { class: "note" }, setup.values.command_key ? h("a", { class: "export", id: "wizard-key", href: "/api/set-up/command.key", download: "command.key" }, t("wizard.save_key")) : "", verbatim(" "), h("span", {}, t("wizard.key_note"))),
    field("ssh_key", t("wizard.ssh_key"), "", t("wizard.ssh_key_hint")),
    setup.values.update_key
      ? h("p", { class: "note" }, t("wizard.update_key_set"))
      : labelled("update_key", t("wizard.update_key"), h("span", {}, file, update)),
  ];
}

function input(name: string): HTMLInputElement | HTMLSelectElement {
  return dialog.querySelector<HTMLInputElement>(`[name="${name}"]`)!;
}

// ------------------------------------------------------------------- steps

function typed(): Values {
  const values: Values = {};
  for (const one of dialog.querySelectorAll<HTMLInputElement>("[name]")) values[one.name] = one.type === "checkbox" ? one.checked : one.value;
  return values;
}

function forgetTest(): void {
  tested = "";
  const element = dialog.querySelector("#wizard-next");
  if (element) say(element, at === STEPS.length - 1 ? t("wizard.finish") : t("wizard.next"));
}

/** One press at a time: a second one while the server answers the first must not skip a step. */
async function alone(press: () => unknown): Promise<void> {
  if (busy) return;
  busy = true;
  try {
    await press();
  } finally {
    busy = false;
  }
}

/** Have the server judge and write the step; false where something is wrong. */
async function keep(): Promise<boolean> {
  for (const one of dialog.querySelectorAll(".fault")) say(one, "");
  for (const one of dialog.querySelectorAll("[aria-invalid]")) one.removeAttribute("aria-invalid");
  say(dialog.querySelector("#wizard-fault")!, "");
  const name = STEPS[at]!.name;
  try {
    const answer = await send<{ values: SetUp["values"] }>("PUT", `/set-up/${name}`, typed());
    setup.values = answer.values;
    if (!setup.done.includes(name)) setup.done.push(name);
    return true;
  } catch (error) {
    const faults = error instanceof ApiError ? error.faults : [];
    for (const fault of faults) {
      const place = dialog.querySelector(`#wizard-${fault.field}-fault`);
      if (place) say(place, fromServer(fault.text));
      dialog.querySelector(`[name="${fault.field}"]`)?.setAttribute("aria-invalid", "true");
    }
    if (faults[0]) dialog.querySelector<HTMLElement>(`[name="${faults[0].field}"]`)?.focus();
    else showFault(error);
    return false;
  }
}

function showFault(error: unknown): void {
  say(dialog.querySelector("#wizard-fault")!, reasonOf(error));
}

/** Try what the step has set; true where it is well. */
async function test(): Promise<boolean> {
  if (!(await keep())) return false;
  const list = dialog.querySelector("#wizard-found")!;
  const button = dialog.querySelector<HTMLButtonElement>("#wizard-test")!;
  fill(list, h("li", { class: "note" }, t("wizard.listening")));
  button.setAttribute("aria-busy", "true");
  try {
    const found = await send<Finding[]>("POST", `/set-up/${STEPS[at]!.name}/test`, {});
    fill(list, ...found.map(row));
    tested = JSON.stringify(typed());
    const good = found.every((one) => one.ok);
    say(dialog.querySelector("#wizard-next")!, good ? t("wizard.next") : t("wizard.continue_anyway"));
    return good;
  } catch (error) {
    fill(list);
    showFault(error);
    return false;
  } finally {
    button.removeAttribute("aria-busy");
  }
}

function row(one: Finding): HTMLElement {
  return h(
    "li",
    { class: one.ok ? "check-row good" : "check-row bad", "data-ok": String(one.ok) },
    h("span", { class: "check-mark", "aria-hidden": "true" }, verbatim(one.ok ? "✓" : "✗")),
    h("span", { class: "wizard-said" }, h("span", { class: "hidden-word" }, one.ok ? t("check.passed") : t("check.to_fix")), verbatim(" "), h("span", {}, fromServer(one.text))),
    one.remedy ? h("span", { class: "wizard-said remedy" }, fromServer(one.remedy)) : null,
  );
}

async function next(): Promise<void> {
  const step = STEPS[at]!;
  if (step.test && tested !== JSON.stringify(typed())) {
    if (!(await test())) return;
  } else if (!(await keep())) return;
  if (at < STEPS.length - 1) go(at + 1);
  else await finish();
}

async function finish(): Promise<void> {
  try {
    const finished = await send<{ name: string }>("POST", "/set-up/finish", {});
    fill(
      dialog,
      h("header", {}, h("h2", { id: "wizard-title" }, t("wizard.done"))),
      h("p", {}, t("wizard.restart")),
      h("dl", { class: "wizard-end" },
        h("dt", {}, t("wizard.its_wi_fi")), h("dd", { translate: "no" }, verbatim(finished.name)),
        h("dt", {}, t("common.this_page")), h("dd", { translate: "no" }, verbatim(`http://${finished.name}.local:${location.port || "8650"}`)),
      ),
      h("p", { class: "note" }, t("wizard.before_it_flies")),
      h("footer", {}, h("span", { class: "gap" }), h("button", { id: "wizard-close", class: "primary", onclick: () => dialog.close() }, t("common.close"))),
    );
    focusFirst();
  } catch (error) {
    showFault(error);
  }
}
