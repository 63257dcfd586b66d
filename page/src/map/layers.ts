/** Box on the map: what is drawn, on which background, and the meaning of the colours. */

import { gradient, SNR_HIGH, SNR_LOW } from "../shared/colour";
import { by, fill, h } from "../shared/dom";
import { get, reasonOf, upload } from "../shared/api";
import { fixed } from "../shared/format";
import { fromServer, t, verbatim, type Words } from "../shared/i18n";
import { toast } from "../shared/notice";
import { recall, remember } from "../shared/remembered";
import { toggleMe } from "./my_place";
import type { FlightMap } from "./map_view";
import type { Layers } from "./maplayers";
import { store } from "../store";
import { type Heights, heightBands } from "./surface";
import type { Choices } from "../types";

let view: FlightMap;

export function legend(): HTMLElement {
  const ramp = h("div", { class: "ramp" });
  ramp.style.background = `linear-gradient(to right, ${gradient().join(",")})`;
  return h(
    "div",
    { class: "legend", role: "img", "aria-label": t("layers.strength_ramp", { low: SNR_LOW, high: SNR_HIGH }) },
    h("span", {}, SNR_LOW),
    ramp,
    h("span", {}, fixed(SNR_HIGH, 0, "dB")),
    h("span", { id: "legend-on-board", class: "legend-on-board", hidden: true }, t("layers.drones_bearing")),
  );
}

/** The drone's own bearings are explained where there are any. */
export function drawLegend(): void {
  by("legend-on-board").hidden = !store.bearings.some((one) => one.from_drone && !store.hidden.has(one.tag_id));
}

export function layerBox(made: FlightMap): HTMLElement {
  view = made;
  const names: [keyof Layers, Words][] = [
    ["track", t("layers.track")],
    ["pulses", t("common.pulses")],
    ["rose", t("layers.pulse_rose")],
    ["bearings", t("layers.bearings")],
    ["regions", t("layers.position")],
    ["strength", t("layers.strongest_signal")],
    ["hindsight", t("layers.whole_flight")],
  ];
  const boxes = names.map(([name, label]) => {
    const box = h("input", {
      type: "checkbox",
      id: `layer-${name}`,
      checked: name !== "strength",
      onchange: () => view.setLayer(name, box.checked),
    });
    return h("label", {}, box, label);
  });
  return h(
    "details",
    { class: "layers", ontoggle: offerHeights },
    h("summary", {}, t("layers.title")),
    ...boxes,
    h("label", { id: "heights-label", class: "basemap", hidden: true }, t("layers.heights"), h("select", { id: "heights", onchange: chooseHeights })),
    h("label", { class: "basemap" }, t("layers.map"), h("select", { id: "basemap" }, h("option", { value: "" }, t("layers.no_map")))),
    h(
      "div",
      { class: "layer-actions" },
      h("button", { id: "fit", onclick: () => view.fit() }, t("layers.whole_flight")),
      h("button", { id: "follow", onclick: toggleFollow, "aria-pressed": "true" }, t("layers.follow")),
      h("button", { id: "me", onclick: (event: Event) => toggleMe(event.currentTarget as HTMLElement), "aria-pressed": "false" }, t("layers.my_position")),
    ),
    h("div", { class: "layer-actions" }, mapImport()),
    h("p", { class: "note map-note" }, t("layers.map_note")),
    h("label", { class: "check" }, plainBox(), t("layers.plain_map")),
  );
}

let bands: Heights[] = [];

/** When the box is opened: the layers of height that were flown, where there are several. */
export function offerHeights(): void {
  const { count } = store.pulses;
  bands = count ? heightBands(store.pulses.get("height").slice(0, count)) : [];
  by("heights-label").hidden = bands.length < 2;
  const select = by("heights") as HTMLSelectElement;
  fill(
    select,
    h("option", { value: "" }, t("layers.all_heights")),
    ...bands.map(([low, high], number) =>
      h("option", { value: String(number) }, verbatim(`${Math.round(low)}–${Math.round(high)}\u202fm`)),
    ),
  );
  const chosen = bands.findIndex(([low, high]) => low === store.heights?.[0] && high === store.heights[1]);
  select.value = chosen < 0 ? "" : String(chosen);
  if (chosen < 0 && store.heights !== null) store.setHeights(null);
}

function chooseHeights(): void {
  const { value } = by("heights") as HTMLSelectElement;
  store.setHeights(value === "" ? null : bands[Number(value)]!);
}

function toggleFollow(): void {
  view.follow = !view.follow;
  drawFollow();
  view.drawTrack();
}

export function drawFollow(): void {
  by("follow").setAttribute("aria-pressed", String(view.follow));
}

export function offerMaps(choices: Choices): void {
  const select = by("basemap") as HTMLSelectElement;
  fill(
    select,
    h("option", { value: "" }, t("layers.no_map")),
    ...choices.maps.map((file) => h("option", { value: file.name, disabled: file.fault !== null, translate: "no" }, file.fault ? t("layers.map_fault", { map: verbatim(file.name), fault: fromServer(file.fault) }) : verbatim(file.name))),
  );
  const choose = (name: string) => {
    select.value = name;
    remember("map", name);
    void view.setBasemap(choices.maps.find((one) => one.name === name) ?? null);
  };
  select.onchange = () => choose(select.value);
  const kept = recall("map");
  const good = choices.maps.filter((one) => !one.fault).map((one) => one.name);
  // None, chosen by hand, stays none.
  choose(kept !== null && (kept === "" || good.includes(kept)) ? kept : (good[0] ?? ""));
}

function mapImport(): HTMLElement {
  const input = h("input", { id: "map-import", type: "file", accept: ".mbtiles,.pmtiles", onchange: () => void bring(input) });
  return h("label", { class: "file" }, t("layers.add_map"), input);
}

async function bring(input: HTMLInputElement): Promise<void> {
  const file = input.files?.[0];
  input.value = "";
  if (!file) return;
  toast(t("layers.map_copying", { map: verbatim(file.name) }), 6);
  try {
    await upload(`/maps/${encodeURIComponent(file.name)}`, file);
    remember("map", file.name);
    offerMaps(await get<Choices>("/choices"));
    toast(t("layers.map_here", { map: verbatim(file.name) }), 6);
  } catch (error) {
    toast(reasonOf(error), 4);
  }
}

function plainBox(): HTMLElement {
  const box = h("input", {
    type: "checkbox",
    id: "plain-map",
    checked: view.flat,
    onchange: () => {
      remember("plain", box.checked ? "yes" : "");
      location.reload();
    },
  });
  return box;
}
