/**
 * The first set-up of a drone's computer, where this page runs on it: one step after the other,
 * each judged and written by the server. It comes by itself until it has been finished.
 */

import { ApiError, BASE, get, getOnceThere, reasonOf, send } from "./api";
import { fill, h, say } from "./dom";
import { choose, language, LANGUAGES } from "./i18n";
import type { Choices, Finding, SetUp } from "./types";

type Values = Record<string, string | boolean>;

interface Step {
  name: string;
  title: string;
  about: string;
  /** What the step can try, if anything. */
  test?: string;
  fields: (setup: SetUp) => Node[];
}

const STEPS: Step[] = [
  {
    name: "name",
    title: "Name",
    about: "Each drone has its own name. It names its Wi-Fi and the address of this page.",
    fields: (setup) => [field("name", "Name", setup.values.name, "Small letters, digits and hyphens: lynx-1")],
  },
  {
    name: "antenna",
    title: "Antenna",
    about: "Which antenna it carries, and its direction.",
    fields: (setup) => [
      select("antenna", "Antenna", setup.choices.antennas.map((name) => [name, name]), setup.values.antenna),
      field("yaw_offset_deg", "Pointing direction, clockwise from the nose, °", String(setup.values.yaw_offset_deg), "0 ahead, 90 to the right, 180 back"),
    ],
  },
  {
    name: "radio",
    title: "Radio",
    about: "Plug the radio in before the test.",
    test: "Test the radio",
    fields: radioFields,
  },
  {
    name: "autopilot",
    title: "Autopilot",
    about: "Switch on the autopilot before the test. If empty, there is no autopilot and pulses get no position.",
    test: "Test the link",
    fields: autopilotFields,
  },
  {
    name: "keys",
    title: "Keys",
    about: "Empty fields stay unchanged. Passwords take effect at the next start.",
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
      h("h2", { id: "wizard-title" }, "First set-up of this computer"),
      h("select", { id: "wizard-language", "aria-label": "Language", onchange: (event: Event) => choose((event.target as HTMLSelectElement).value) },
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
          void next();
        },
      },
      h("p", { class: "note" }, step.about),
      h("div", { class: "wizard-fields" }, ...step.fields(setup)),
      h("ul", { id: "wizard-found", class: "check-list", role: "status" }),
      h("p", { id: "wizard-fault", class: "fault-line", role: "alert" }),
      h(
        "footer",
        {},
        h("button", { id: "wizard-later", type: "button", onclick: () => dialog.close() }, "Later"),
        h("span", { class: "gap" }),
        at > 0 ? h("button", { id: "wizard-back", type: "button", onclick: () => go(at - 1) }, "Back") : null,
        step.test ? h("button", { id: "wizard-test", type: "button", onclick: () => void test() }, step.test) : null,
        h("button", { id: "wizard-next", class: "primary" }, at === STEPS.length - 1 ? "Finish" : "Next"),
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

function labelled(name: string, label: string, input: HTMLElement): HTMLElement {
  input.setAttribute("aria-describedby", `wizard-${name}-fault`);
  return h("label", {}, h("span", {}, label), input, h("span", { class: "fault", id: `wizard-${name}-fault` }));
}

function field(name: string, label: string, value: string, hint = "", type = "text"): HTMLElement {
  return labelled(name, label, h("input", { id: `wizard-${name}`, name, type, value, placeholder: hint, title: hint, autocomplete: "off", spellcheck: "false", maxlength: 1600 }));
}

function select(name: string, label: string, choices: [string, string][], value: string, onchange?: () => void): HTMLElement {
  return labelled(name, label, h("select", { id: `wizard-${name}`, name, onchange },
    ...choices.map(([key, text]) => h("option", { value: key, translate: "no", selected: key === value }, text)),
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
    h("p", { class: "note" }, found ? `Plugged in: ${found}` : "No known USB radio is plugged in."),
    select("kind", "Radio", radios.map((one) => [one.kind, one.title]), chosen, () => {
      const now = radios.find((one) => one.kind === input("kind").value);
      if (now) input("sample_rate_msps").value = String(now.rate_msps);
    }),
    field("gain", "Gain", setup.values.gain === null ? "" : String(setup.values.gain), "empty: the default"),
    field("sample_rate_msps", "Sample rate, MS/s", String(rate)),
    labelled("bias_tee", "Power for an amplifier at the antenna", h("input", { id: "wizard-bias_tee", name: "bias_tee", type: "checkbox", checked: setup.values.bias_tee })),
  ];
}

function autopilotFields(): Node[] {
  const ports = h("select", { id: "wizard-port", onchange: () => {
    if (ports.value) input("address").value = ports.value;
    forgetTest();
  } }, h("option", { value: "" }, "the address below"));
  void getOnceThere<Choices>("/choices").then((choices) =>
    choices.ports.forEach((port) => ports.append(h("option", { value: port.address, translate: "no" }, `${port.device} ${port.description}`))),
  );
  return [
    h("label", {}, h("span", {}, "Serial ports found"), ports),
    field("address", "Address", setup.values.address, "serial:///dev/ttyAMA0:57600"),
  ];
}

function keyFields(): Node[] {
  const file = h("input", { id: "wizard-update-file", type: "file", accept: ".pem", onchange: () => void file.files?.[0]?.text().then((text) => (update.value = text)) });
  const update = h("input", { type: "hidden", name: "update_key", id: "wizard-update_key" });
  return [
    field("page_password", "New password of this page", "", "8 to 63 letters and digits", "password"),
    field("wifi_password", "New password of its Wi-Fi", "", "8 to 63 letters and digits", "password"),
    field("command_key", "Key for commands", "", setup.values.command_key ? "there is one; paste another, or type: new" : "none yet: type new, or paste one"),
    h("p", { class: "note" }, setup.values.command_key ? h("a", { class: "export", id: "wizard-key", href: "/api/set-up/command.key", download: "command.key" }, "Save it for a laptop") : "", h("span", {}, " Anyone who has this key can command the drone.")),
    field("ssh_key", "Public ssh key of the maintainer", "", "ssh-ed25519 AAAA…, as in a .pub file"),
    setup.values.update_key
      ? h("p", { class: "note" }, "The update key is set already; an update can change it.")
      : labelled("update_key", "Public key of the update signer", h("span", {}, file, update)),
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
  if (element) say(element, at === STEPS.length - 1 ? "Finish" : "Next");
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
      if (place) say(place, fault.text);
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
  if (busy || !(await keep())) return false;
  busy = true;
  const list = dialog.querySelector("#wizard-found")!;
  const button = dialog.querySelector<HTMLButtonElement>("#wizard-test")!;
  fill(list, h("li", { class: "note" }, "Listening …"));
  button.setAttribute("aria-busy", "true");
  try {
    const found = await send<Finding[]>("POST", `/set-up/${STEPS[at]!.name}/test`, {});
    fill(list, ...found.map(row));
    tested = JSON.stringify(typed());
    const good = found.every((one) => one.ok);
    say(dialog.querySelector("#wizard-next")!, good ? "Next" : "Continue anyway");
    return good;
  } catch (error) {
    fill(list);
    showFault(error);
    return false;
  } finally {
    busy = false;
    button.removeAttribute("aria-busy");
  }
}

function row(one: Finding): HTMLElement {
  return h(
    "li",
    { class: one.ok ? "check-row good" : "check-row bad", "data-ok": String(one.ok) },
    h("span", { class: "check-mark", "aria-hidden": "true" }, one.ok ? "✓" : "✗"),
    h("span", { class: "wizard-said" }, h("span", { class: "hidden-word" }, one.ok ? "passed: " : "to fix: "), h("span", {}, one.text)),
    one.remedy ? h("span", { class: "wizard-said remedy" }, one.remedy) : null,
  );
}

async function next(): Promise<void> {
  if (busy) return;
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
      h("header", {}, h("h2", { id: "wizard-title" }, "This computer is set up")),
      h("p", {}, "Now switch it off and on. The settings take effect then."),
      h("dl", { class: "wizard-end" },
        h("dt", {}, "Its Wi-Fi"), h("dd", { translate: "no" }, finished.name),
        h("dt", {}, "This page"), h("dd", { translate: "no" }, `http://${finished.name}.local:${location.port || "8650"}`),
      ),
      h("p", { class: "note" }, "Before it flies: type in the tags under Set-up, then go through Check."),
      h("footer", {}, h("span", { class: "gap" }), h("button", { id: "wizard-close", class: "primary", onclick: () => dialog.close() }, "Close")),
    );
    focusFirst();
  } catch (error) {
    showFault(error);
  }
}
