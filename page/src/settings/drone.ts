/** The drone's upkeep: its radio, its parameters, its flights. */

import { ApiError, reasonOf, send } from "../shared/api";
import { by, describe, fill, h, say } from "../shared/dom";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { store } from "../store";

const UPKEEP = ["radio_status", "save_logs", "clean_logs"];
/** Asked a second time, because it cannot be undone. */
const FINAL: Record<string, Words> = { clean_logs: t("drone.remove_really") };
const CONFIRM_MS = 5000;
/** What our drone says to the first step; the original's removes at once. */
const FIRST_STEP = /send it again after (\d+) s to delete (\d+) flights?: (.+)$/;
/** The drone forgets the first step after a minute. */
const SECOND_STEP_MS = 40_000;

export function droneSection(): HTMLElement {
  const buttons = UPKEEP.map((name) => h("button", { id: `act-${name}`, onclick: () => void press(name) }));
  store.on(["state", "online"], drawButtons);
  return h(
    "section",
    { class: "block wide", "aria-labelledby": "h-drone" },
    h(
      "div",
      { class: "toolbar" },
      h("h2", { id: "h-drone" }, t("drone.title")),
      ...buttons,
      h("button", { id: "parameters-read", onclick: () => void read() }, t("drone.parameters")),
      h("span", { id: "drone-note", class: "note", role: "status" }),
    ),
    h("div", { id: "parameters", class: "parameters" }),
  );
}

const inputs = new Map<string, HTMLInputElement[]>();

/** Inputs for the numbers of a command, once its row is known. */
function drawFields(name: string, fields: { name: string; unit: string }[]): void {
  if (inputs.has(name)) return;
  const made = fields.map((field) => h("input", { inputmode: "decimal", "data-field": field.name }));
  inputs.set(name, made);
  const row = (input: HTMLElement, at: number) =>
    h("label", { class: "parameter" }, h("span", {}, verbatim(fields[at]!.name)), input, h("span", {}, verbatim(fields[at]!.unit)));
  by(`act-${name}`).after(...made.map(row));
}

function numbers(name: string): Record<string, number> {
  const given = inputs.get(name) ?? [];
  return Object.fromEntries(given.map((input) => [input.dataset.field!, parseFloat(input.value.replace(",", "."))]));
}

function drawButtons(): void {
  const actions = store.state?.actions ?? {};
  for (const name of UPKEEP) {
    const button = by(`act-${name}`);
    const action = actions[name];
    if (action?.fields) drawFields(name, action.fields);
    button.setAttribute("aria-disabled", String(!action?.enabled));
    describe(button, "title", fromServer(action?.reason ?? ""));
    if (!button.dataset.asking) say(button, fromServer(action?.label ?? name));
  }
}

async function press(name: string): Promise<void> {
  const button = by(`act-${name}`);
  const action = store.state?.actions[name];
  if (!action?.enabled) {
    say(by("drone-note"), action?.reason ? fromServer(action.reason) : t("common.not_now"));
    return;
  }
  if (FINAL[name] && !button.dataset.asking) {
    button.dataset.asking = "yes";
    say(button, FINAL[name]);
    setTimeout(() => {
      delete button.dataset.asking;
      drawButtons();
    }, CONFIRM_MS);
    return;
  }
  if (button.dataset.asking === "wait") return;
  delete button.dataset.asking;
  const step = FIRST_STEP.exec(await ask(name, numbers(name)));
  if (step) secondStep(button, Number(step[1]), Number(step[2]), step[3]!);
  drawButtons();
}

/** Show what will be removed and what stays; the second press counts if the drone accepts. */
function secondStep(button: HTMLElement, seconds: number, flights: number, stays: string): void {
  const one = flights === 1;
  const kept = fromServer(stays[0]!.toUpperCase() + stays.slice(1));
  say(by("drone-note"), t(one ? "drone.remove_flight" : "drone.remove_flights", { flights, kept, seconds }));
  button.dataset.asking = "wait";
  say(button, t(one ? "drone.remove_flight_wait" : "drone.remove_flights_wait", { flights }));
  setTimeout(() => {
    button.dataset.asking = "yes";
    say(button, t(one ? "drone.remove_flight_now" : "drone.remove_flights_now", { flights }));
    setTimeout(() => {
      delete button.dataset.asking;
      drawButtons();
    }, SECOND_STEP_MS);
  }, (seconds + 1) * 1000);
}

/** Ask the drone; give what it refused with, "" when it took it. */
async function ask(name: string, body: unknown): Promise<string> {
  try {
    const answer = await send<{ message: string }>("POST", `/commands/${name}`, body);
    say(by("drone-note"), fromServer(answer.message));
    return "";
  } catch (error) {
    const words = reasonOf(error);
    say(by("drone-note"), words);
    const english = error instanceof ApiError ? String(error.body.error ?? error.body.message) : words;
    if (!FIRST_STEP.test(english)) toast(words, 4);
    return english;
  }
}

async function read(): Promise<void> {
  const note = by("drone-note");
  say(note, t("common.requesting_list"));
  try {
    const found = await send<Record<string, number>>("POST", "/parameters", {});
    const names = Object.keys(found).sort();
    fill(by("parameters"), ...names.map((name) => row(name, found[name]!)));
    say(note, t("drone.parameter_count", { count: names.length }));
  } catch (error) {
    say(note, reasonOf(error));
  }
}

function row(name: string, value: number): HTMLElement {
  // The wire carries 32-bit floats: seven digits are all there is.
  const input = h("input", { value: String(Number(value.toPrecision(7))), inputmode: "decimal", "data-parameter": name });
  const set = async () => {
    const wanted = Number(input.value.replace(",", "."));
    if (input.value.trim() === "" || !Number.isFinite(wanted)) {
      say(by("drone-note"), t("drone.not_a_number", { parameter: verbatim(name) }));
      input.setAttribute("aria-invalid", "true");
      return;
    }
    const refusal = await ask("set_parameter", { name, value: wanted });
    input.setAttribute("aria-invalid", String(refusal !== ""));
  };
  input.addEventListener("keydown", (event) => {
    if (event.key === "Enter") void set();
  });
  return h("label", { class: "parameter" }, h("span", {}, verbatim(name)), input, h("button", { onclick: () => void set() }, t("drone.set")));
}
