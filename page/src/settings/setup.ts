/** Set-up: connection, tags, antenna, radio. Mistakes are shown where they are made. */

import { ApiError, BASE, getOnceThere, reasonOf, send } from "../shared/api";
import { by, fill, h, say, valueOf } from "../shared/dom";
import { addressSection } from "./page_address";
import { droneSection } from "./drone";
import { factsSection } from "./flight_facts";
import { choose, fromServer, language, LANGUAGES, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { Queue } from "../shared/queue";
import { store } from "../store";
import type { Choices, FieldFault, Settings, TagRow } from "../types";

interface Field {
  key: string;
  label: Words;
  unit: string;
  hint: Words;
  text?: boolean;
  /** What it may be; the first where the row says nothing. */
  choices?: Record<string, Words>;
}

/** As `DEFAULT_FALSE_ALARM_PROBABILITY` in uavrt/core/messages.py; a test compares them. */
const DEFAULT_FALSE_ALARM_PERCENT = 1;
const MOST_WARNINGS = 5;

const FIELDS: Field[] = [
  { key: "id", label: t("setup.id"), unit: "", hint: t("setup.id_hint") },
  { key: "name", label: t("common.name"), unit: "", hint: t("setup.name_hint"), text: true },
  { key: "frequency_mhz", label: t("common.frequency"), unit: "MHz", hint: t("setup.frequency_hint") },
  { key: "kind", label: t("setup.kind"), unit: "", hint: t("setup.kind_hint"), text: true, choices: { beeping: t("setup.beeping"), coded: t("setup.coded") } },
  { key: "interval_ms", label: t("common.interval"), unit: "ms", hint: t("setup.interval_hint") },
  { key: "gaps_ms", label: t("common.gaps"), unit: "ms", hint: t("setup.gaps_hint"), text: true },
  { key: "second_interval_ms", label: t("setup.second_interval"), unit: "ms", hint: t("setup.second_interval_hint") },
  { key: "pulse_width_ms", label: t("setup.width"), unit: "ms", hint: t("setup.width_hint") },
  { key: "interval_uncertainty_ms", label: t("setup.uncertainty"), unit: "ms", hint: t("setup.uncertainty_hint") },
  { key: "interval_jitter_ms", label: t("setup.jitter"), unit: "ms", hint: t("setup.jitter_hint") },
  { key: "k", label: t("setup.k"), unit: "", hint: t("setup.k_hint") },
  { key: "false_alarm_percent", label: t("setup.false_alarms"), unit: "%", hint: t("setup.false_alarms_hint") },
];

/** As `CODED_PULSE_WIDTH_MS`, `BURST_TOLERANCE_MS` and `CODED_K` in uavrt/config/tags/code_rules.py. */
const CODED_NUMBERS: TagRow = { second_interval_ms: "", pulse_width_ms: 2.5, interval_uncertainty_ms: 4, interval_jitter_ms: 0, k: 10 };

let rows: TagRow[] = [];
let faults: FieldFault[] = [];
let changed = false;
/** Version of the table that the edits began with. */
let begun = "";
let choices: Choices | null = null;
let checking = 0;
/** Tags not flown with, as an imported file says; kept when the table is saved. */
let leftOut: number[] | null = null;
/** What an imported file holds that the table cannot: shown until the next import. */
let importNotes: string[] = [];

export function buildSetup(): void {
  fill(
    by("view-setup"),
    h(
      "div",
      { class: "setup" },
      h("section", { class: "block", "aria-labelledby": "h-connection" }, h("h2", { id: "h-connection" }, t("setup.connection")), connectionForm()),
      h("section", { class: "block", "aria-labelledby": "h-antenna" }, h("h2", { id: "h-antenna" }, t("setup.antenna_and_radio")), antennaForm()),
      h(
        "section",
        { class: "block wide", "aria-labelledby": "h-tags" },
        h(
          "div",
          { class: "toolbar" },
          h("h2", { id: "h-tags" }, t("common.tags")),
          h("button", { id: "tag-add", disabled: true, onclick: () => addRow() }, t("setup.add_tag")),
          h("select", { id: "tag-preset", "aria-label": t("setup.new_tags_like"), title: t("setup.new_tags_like") }, h("option", { value: "" }, t("setup.last_tag"))),
          importButton(),
          ...["tags.toml", "TagInfo.txt", "tags.csv"].map((name) => h("a", { class: "export", translate: "no", href: `${BASE}/api/tags/${name}`, download: name }, verbatim(name))),
          h("span", { id: "tag-state", class: "note", role: "status" }),
          h("button", { id: "tag-save", class: "primary", disabled: true, onclick: () => void save() }, t("setup.save")),
        ),
        h("div", { id: "tag-table", class: "table-wrap" }),
        h("p", { id: "tag-fault", class: "fault-line", role: "alert" }),
        h("div", { id: "tag-warnings", role: "status" }),
        h(
          "div",
          { id: "tag-conflict", class: "conflict", role: "alert", hidden: true },
          h("span", {}, t("setup.conflict")),
          h("button", { id: "tag-theirs", onclick: () => takeTheirs() }, t("setup.use_theirs")),
          h("button", { id: "tag-mine", onclick: () => void keepMine() }, t("setup.keep_mine")),
        ),
      ),
      factsSection(),
      droneSection(),
      addressSection(),
    ),
  );
  store.on(["tags"], () => {
    // Rows that were typed before the table came would stand against it.
    for (const id of ["tag-add", "tag-import", "tag-save"]) by(id).removeAttribute("disabled");
    if (changed) {
      drawConflict();
      return;
    }
    begun = store.tagsVersion;
    rows = structuredClone(store.tags);
    faults = [];
    draw();
    void check();
  });
  store.on(["settings"], drawSettings);
  store.on(["settings"], drawFlown);
  addEventListener("beforeunload", (event) => {
    if (changed) event.preventDefault();
  });
  store.on(["state", "online"], drawConnection);
  void getOnceThere<Choices>("/choices").then((found) => {
    choices = found;
    offer();
    drawSettings();
  });
}

// ------------------------------------------------------------------- tags

function addRow(): void {
  const preset = choices?.presets[Number((by("tag-preset") as HTMLSelectElement).value || "-1")];
  const last = rows.at(-1);
  const ids = rows.map((row) => Number(row.id)).filter(Number.isFinite);
  // A first tag is like none: what is not typed is not assumed.
  const like = preset ?? last ?? { interval_uncertainty_ms: 60, interval_jitter_ms: 10 };
  const row: TagRow = {};
  for (const field of FIELDS) row[field.key] = (like as TagRow)[field.key] ?? "";
  // Even ids, as the original ground station wants them.
  row.id = ids.length ? Math.max(...ids) + 2 - (Math.max(...ids) % 2) : 2;
  row.name = "";
  row.frequency_mhz = "";
  row.k = row.k || 3;
  row.false_alarm_percent = row.false_alarm_percent || DEFAULT_FALSE_ALARM_PERCENT;
  rows.push(row);
  touched();
  draw();
  cell(rows.length - 1, "frequency_mhz")?.focus();
}

function draw(): void {
  const head = FIELDS.map((field) =>
    h("th", { scope: "col", title: field.hint }, field.label, field.unit ? h("span", { class: "unit" }, verbatim(` ${field.unit}`)) : null),
  );
  const body = rows.map((row, place) =>
    h(
      "tr",
      {},
      h("td", {}, flyBox(row)),
      ...FIELDS.map((field) =>
        h(
          "td",
          { "data-field": field.key },
          field.choices ? kindChoice(field, row, place) : h("input", {
            value: row[field.key] ?? "",
            "aria-label": t("setup.field_in_row", { field: field.label, row: place + 1 }),
            inputmode: field.text ? "text" : "decimal",
            autocomplete: "off",
            maxlength: 60,
            "data-row": place,
            "data-key": field.key,
            oninput: (event: Event) => {
              row[field.key] = (event.target as HTMLInputElement).value;
              touched();
            },
          }),
        ),
      ),
      h(
        "td",
        {},
        h("button", { class: "remove", "aria-label": t("setup.remove_row", { row: place + 1 }), onclick: () => remove(place) }, verbatim("×")),
      ),
    ),
  );
  fill(
    by("tag-table"),
    rows.length
      ? h("table", { class: "tags" }, h("thead", {}, h("tr", {}, h("th", { scope: "col", title: t("setup.fly_hint") }, t("common.fly")), ...head, h("th", {}))), h("tbody", {}, ...body))
      : h("p", { class: "empty" }, t("setup.no_tags")),
  );
  drawFaults();
}

/** Beeping or coded; a tag that becomes coded gets the usual numbers of such tags. */
function kindChoice(field: Field, row: TagRow, place: number): HTMLElement {
  const now = String(row[field.key] || Object.keys(field.choices!)[0]);
  const select: HTMLSelectElement = h(
    "select",
    {
      "aria-label": t("setup.field_in_row", { field: field.label, row: place + 1 }),
      "data-row": place,
      "data-key": field.key,
      onchange: () => {
        row[field.key] = select.value;
        if (select.value === "coded") Object.assign(row, CODED_NUMBERS);
        else row.gaps_ms = "";
        touched();
        draw();
      },
    },
    ...Object.entries(field.choices!).map(([one, words]) => h("option", { value: one, selected: one === now }, words)),
  );
  return select;
}

/** Whether a tag is searched for in the next flight; the table keeps it in any case. */
function flyBox(row: TagRow): HTMLElement {
  const box = h("input", {
    type: "checkbox",
    class: "fly-tag",
    "aria-label": t("setup.search_for_tag", { tag: verbatim(row.id!) }),
    checked: !notFlown().includes(Number(row.id)),
    onchange: () => {
      // Its number as it is now: it may have been typed meanwhile.
      const [id, fly] = [Number(row.id), box.checked];
      const without = () => [...notFlown().filter((one) => one !== id), ...(fly ? [] : [id])];
      if (leftOut) leftOut = without();
      // One after the other: each begins with what the one before has left.
      else void changes.add(() => keepLeftOut(without()));
    },
  });
  return h("label", { class: "touch" }, box);
}

/** Changes of the settings, and of the table. */
const [changes, saving] = [new Queue(), new Queue()];

/** The boxes as the tags are flown: another page may have changed that, or refused this one. */
function drawFlown(): void {
  document.querySelectorAll<HTMLInputElement>(".fly-tag").forEach((box, place) => {
    box.checked = !notFlown().includes(Number(rows[place]?.id));
  });
}

function notFlown(): number[] {
  return leftOut ?? store.settings?.left_out ?? [];
}

async function keepLeftOut(out: number[]): Promise<void> {
  try {
    store.settings = await send<Settings>("PUT", "/settings", { left_out: out });
  } catch (error) {
    toast(reasonOf(error), 3);
    drawFlown();
  }
}

function remove(place: number): void {
  rows.splice(place, 1);
  touched();
  draw();
}

function touched(): void {
  if (!changed) store.emit("state"); // "Tags sent" is no longer true
  changed = true;
  say(by("tag-state"), t("setup.not_saved"));
  const ticket = ++checking;
  setTimeout(() => {
    if (ticket === checking) void check();
  }, 250);
}

async function check(): Promise<void> {
  const ticket = checking;
  const answer = await send<{ faults: FieldFault[]; warnings: string[] }>("POST", "/tags/check", rows).catch(() => null);
  if (answer && ticket === checking) {
    faults = answer.faults;
    drawFaults();
    drawWarnings(answer.warnings);
  }
}

function drawConflict(): void {
  // While it is saved, the new version may be this page's own.
  by("tag-conflict").hidden = !changed || begun === store.tagsVersion || saving.waits("tags");
}

function takeTheirs(): void {
  changed = false;
  leftOut = null;
  checking += 1;
  begun = store.tagsVersion;
  rows = structuredClone(store.tags);
  faults = [];
  say(by("tag-state"), "");
  draw();
  drawConflict();
  void check();
}

async function keepMine(): Promise<void> {
  begun = store.tagsVersion;
  drawConflict();
  await save();
}

/** Whether something was typed that the table does not hold yet. */
export function unsaved(): boolean {
  return changed;
}

/** Whether the drone has the table as this page shows it. */
export function tagsSent(): boolean {
  return store.state?.tags_sent === true && !changed && begun === store.tagsVersion;
}

/** Keep what is typed; false where it has a fault, another page was first, or more was typed meanwhile. */
export async function save(): Promise<boolean> {
  const saved = await saving.add(keep, "tags");
  drawConflict();
  return saved;
}

async function keep(): Promise<boolean> {
  const ticket = ++checking;
  try {
    const answer = await send<{ tags: TagRow[]; version: string }>("PUT", "/tags", rows, { "If-Match": `"${begun}"` });
    begun = answer.version;
    if (ticket !== checking) return !changed;
    rows = answer.tags;
    faults = [];
    changed = false;
    if (leftOut) await keepLeftOut(leftOut);
    leftOut = null;
    say(by("tag-state"), t("setup.saved"));
    draw();
    return true;
  } catch (error) {
    if (error instanceof ApiError && error.faults.length) {
      faults = error.faults;
      drawFaults();
      const first = faults[0]!;
      cell(first.row, first.field)?.focus();
    } else if (error instanceof ApiError && error.status === 412) {
      store.tagsVersion = String(error.body.version);
      store.tags = error.body.tags as TagRow[];
    } else toast(reasonOf(error), 3);
    return false;
  }
}

function drawFaults(): void {
  document.querySelectorAll("#tag-table .fault").forEach((one) => one.remove());
  document.querySelectorAll("#tag-table input, #tag-table select").forEach((one) => one.removeAttribute("aria-invalid"));
  for (const [number, fault] of faults.entries()) {
    const input = cell(fault.row, fault.field);
    if (!input) continue;
    const id = `fault-${number}`;
    input.setAttribute("aria-invalid", "true");
    input.setAttribute("aria-describedby", id);
    input.after(h("span", { class: "fault", id }, fromServer(fault.text)));
  }
  const first = faults[0];
  say(by("tag-fault"), first ? t("setup.fault_in_row", { row: first.row + 1, field: labelOf(first.field), fault: fromServer(first.text) }) : "");
}

/** What is no fault, but may surprise in flight: codes that are near to each other. */
function drawWarnings(warnings: string[]): void {
  warnings = [...importNotes, ...warnings];
  const shown = warnings.slice(0, MOST_WARNINGS).map((text) => h("p", {}, fromServer(text)));
  const more = warnings.length - shown.length;
  fill(by("tag-warnings"), ...shown, more > 0 ? h("p", {}, t("setup.more_code_pairs", { more })) : null);
}

function labelOf(key: string): Words {
  return FIELDS.find((field) => field.key === key)?.label ?? verbatim(key);
}

function cell(row: number, key: string): HTMLElement | null {
  return document.querySelector(`#tag-table [data-row="${row}"][data-key="${CSS.escape(key)}"]`);
}

function importButton(): HTMLElement {
  const input = h("input", {
    id: "tag-import",
    type: "file",
    disabled: true,
    multiple: true,
    accept: ".txt,.toml,.csv,.db,.yaml,.yml",
    onchange: () => void importFiles(input),
  });
  return h("label", { class: "file" }, t("common.import"), input);
}

async function importFiles(input: HTMLInputElement): Promise<void> {
  const files: Record<string, string> = {};
  for (const file of input.files ?? []) files[file.name] = await file.text();
  input.value = "";
  try {
    const answer = await send<{ rows: TagRow[]; left_out: number[] | null; warnings: string[]; notes: string[] }>(
      "POST",
      "/tags/import",
      files,
    );
    importNotes = answer.notes;
    rows = answer.rows;
    leftOut = answer.left_out;
    touched();
    draw();
    drawWarnings(answer.warnings);
    if (leftOut?.length) {
      toast(t("setup.tags_read_some_left_out", { count: rows.length, tags: verbatim(leftOut.join(", ")) }), 4);
    } else toast(t("setup.tags_read", { count: rows.length }), 6);
  } catch (error) {
    say(by("tag-fault"), reasonOf(error));
  }
}

// ------------------------------------------------------------------- connection, antenna

function connectionForm(): HTMLElement {
  return h(
    "form",
    {
      onsubmit: (event: Event) => {
        event.preventDefault();
        void connect(true);
      },
    },
    h("label", {}, t("common.how"), h("select", { id: "link-kind", onchange: () => suggest() })),
    h("label", {}, t("common.address"), h("input", { id: "link-address", autocomplete: "off", spellcheck: "false", "data-setting": "address", oninput: () => refused.add("link-address") })),
    setting("set-my-place", t("setup.my_place"), "my_place", t("setup.my_place_hint"), { spellcheck: "false", placeholder: t("setup.my_place_empty") }),
    setting("set-dem", t("setup.dem"), "dem", t("setup.dem_hint"), { spellcheck: "false", placeholder: t("setup.dem_empty") }),
    h("label", {}, t("setup.generation"), h("select", { id: "set-generation", "data-setting": "generation", onchange: () => change({ generation: valueOf("set-generation") }, "set-generation") },
      h("option", { value: "G1" }, t("setup.generation_g1")),
      h("option", { value: "G0" }, t("setup.generation_g0")),
      h("option", { value: "G2v1" }, t("setup.generation_g2v1")),
      h("option", { value: "G2" }, t("setup.generation_g2")),
    )),
    h("label", {}, t("common.language"), h("select", { id: "set-language", onchange: () => speakIn(valueOf("set-language")) },
      ...LANGUAGES.map(([name, own]) => h("option", { value: name, lang: name, translate: "no", selected: name === language }, own)),
    )),
    h(
      "div",
      { class: "row" },
      h("button", { id: "link-connect", class: "primary" }, t("setup.connect")),
      h("button", { id: "link-close", type: "button", onclick: () => void connect(false) }, t("setup.disconnect")),
      h("span", { id: "link-state", class: "note", role: "status" }),
    ),
  );
}

/** The page is loaded again: edits must be saved first. */
function speakIn(name: string): void {
  if (!changed) {
    choose(name);
    return;
  }
  (by("set-language") as HTMLSelectElement).value = language;
  toast(t("setup.save_first"), 4);
}

/** A setting that is typed, by default a number; below it the reason why a value was refused. */
function setting(id: string, label: Words, key: keyof Settings, hint: Words, properties: Record<string, string> = { inputmode: "decimal" }): HTMLElement {
  return h("label", { title: hint }, label, h("input", {
    id,
    autocomplete: "off",
    "data-setting": key,
    ...properties,
    onchange: () => change({ [key]: valueOf(id) }, id),
  }), h("span", { class: "fault", id: `${id}-fault` }));
}

function antennaForm(): HTMLElement {
  return h(
    "form",
    { onsubmit: (event: Event) => event.preventDefault() },
    h("label", {}, t("common.antenna"), h("select", { id: "set-antenna", "data-setting": "antenna", onchange: () => change({ antenna: valueOf("set-antenna") }, "set-antenna") })),
    setting("set-offset", t("setup.antenna_offset"), "antenna_offset_deg", t("setup.antenna_offset_hint")),
    setting("set-heading-error", t("setup.heading_error"), "heading_error_deg", t("setup.heading_error_hint")),
    setting("set-height-error", t("setup.height_error"), "height_error_m", t("setup.height_error_hint")),
    setting("set-gain", t("setup.gain"), "gain", t("setup.gain_hint")),
    setting("set-vehicle-name", t("setup.vehicle_name"), "vehicle_name", t("setup.vehicle_name_hint"), { maxlength: "40" }),
    setting("set-roaming", t("setup.roaming"), "roaming_m", t("setup.roaming_hint")),
    setting("set-frequency", t("setup.radio_frequency"), "center_frequency_mhz", t("setup.radio_frequency_hint")),
  );
}

/** Fields whose value is not taken: refused, or not sent yet. They keep it, and the reason, until another is taken. */
const refused = new Set<string>();

function change(values: Record<string, string>, id: string): void {
  const [fault, before] = [document.getElementById(`${id}-fault`), store.settings];
  const cleaned: Record<string, string | null> = Object.fromEntries(Object.entries(values).map(([key, one]) => [key, one === "" ? null : one]));
  for (const name of ["my_place", "dem"]) if (name in cleaned) cleaned[name] ??= "";
  if ("antenna_offset_deg" in cleaned) cleaned.antenna_offset_deg ??= "0";
  void changes
    .add(() => send("PUT", "/settings", cleaned), id)
    .then(
      () => {
        if (fault) say(fault, "");
        refused.delete(id);
      },
      (error: unknown) => {
        const text = reasonOf(error);
        if (fault) say(fault, text);
        else toast(text, 3);
        if (fault) refused.add(id);
        else drawSettings();
      },
    )
    .then(() => {
      if (store.settings !== before) drawSettings(); // it came before the answer
    });
}

/** What the last press of Connect has come to, until the drone is there. */
let pressed: Words | "" = "";

async function connect(open: boolean): Promise<void> {
  pressed = open ? t("setup.connecting") : "";
  drawConnection();
  try {
    await send("POST", "/connection", { address: open ? valueOf("link-address") : "" });
    pressed = "";
    if (open) refused.delete("link-address");
  } catch (error) {
    pressed = reasonOf(error);
  }
  drawConnection();
}

function offer(): void {
  if (!choices) return;
  fill(
    by("link-kind"),
    h("option", { value: "" }, t("common.address_below")),
    ...choices.ports.map((port) => h("option", { value: port.address, translate: "no" }, verbatim(`${port.device} ${port.description}`))),
    h("option", { value: "udpin://127.0.0.1:14550" }, t("setup.udp_shared")),
    h("option", { value: "udpin://0.0.0.0:14550" }, t("setup.udp_wi_fi")),
    h("option", { value: "tcp://127.0.0.1:5760", translate: "no" }, verbatim("TCP")),
  );
  fill(by("set-antenna"), ...Object.keys(choices.antennas).map((name) => h("option", { value: name, translate: "no" }, verbatim(name))));
  const presets = by("tag-preset");
  choices.presets.forEach((preset, place) => presets.append(h("option", { value: place, translate: "no" }, verbatim(preset.name!))));
}

function suggest(): void {
  const chosen = valueOf("link-kind");
  if (!chosen) return;
  refused.add("link-address");
  (by("link-address") as HTMLInputElement).value = chosen;
}

function drawSettings(): void {
  const settings = store.settings;
  if (!settings) return;
  document.querySelectorAll<HTMLInputElement | HTMLSelectElement>("[data-setting]").forEach((input) => {
    if (document.activeElement === input || refused.has(input.id) || changes.waits(input.id)) return;
    input.value = String(settings[input.dataset.setting as keyof Settings] ?? "");
  });
}

function drawConnection(): void {
  const state = store.state;
  if (!state) return;
  const text = state.connection.error ? t("setup.connection_failed") : (state.connection.open ? (state.drone.present ? t("setup.drone_connected") : t("setup.no_contact_yet")) : t("setup.not_connected"));
  if (state.drone.present) pressed = "";
  say(by("link-state"), pressed || text);
  const me = state.me;
  const heard = me?.latitude_deg === null ? (me.error ? fromServer(me.error) : t("setup.no_position_yet")) : "";
  if (document.activeElement !== by("set-my-place") && !refused.has("set-my-place")) say(by("set-my-place-fault"), heard);
}
