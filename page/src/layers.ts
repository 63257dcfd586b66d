/** Beside the map: what is drawn on it, on which ground, and what the colours mean. */

import { gradient, SNR_HIGH, SNR_LOW } from "./colour";
import { by, fill, h } from "./dom";
import type { MapView } from "./map";
import type { Layers } from "./maplayers";
import { store } from "./store";
import { type Heights, heightBands } from "./surface";
import type { Choices } from "./types";

let view: MapView;

export function legend(): HTMLElement {
  const ramp = h("div", { class: "ramp" });
  ramp.style.background = `linear-gradient(to right, ${gradient().join(",")})`;
  return h(
    "div",
    { class: "legend", role: "img", "aria-label": `Pulse strength from ${SNR_LOW} to ${SNR_HIGH} decibel` },
    h("span", {}, `${SNR_LOW}`),
    ramp,
    h("span", {}, `${SNR_HIGH}\u202fdB`),
    h("span", { id: "legend-on-board", class: "legend-on-board", hidden: true }, "bearing from the drone"),
  );
}

/** The drone's own bearings are explained where there are any. */
export function drawLegend(): void {
  by("legend-on-board").hidden = !store.bearings.some((one) => one.from_drone && !store.hidden.has(one.tag_id));
}

export function layerBox(made: MapView): HTMLElement {
  view = made;
  const names: [keyof Layers, string][] = [
    ["track", "Track"],
    ["pulses", "Pulses"],
    ["rose", "Pulse rose"],
    ["bearings", "Bearings, 90\u202f%"],
    ["regions", "Position, 50/95\u202f%"],
    ["strength", "Strongest signal"],
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
    h("summary", {}, "Layers"),
    ...boxes,
    h("label", { id: "heights-label", class: "basemap", hidden: true }, "Heights", h("select", { id: "heights", onchange: chooseHeights })),
    h("label", { class: "basemap" }, "Map", h("select", { id: "basemap" }, h("option", { value: "" }, "none: grid"))),
    h(
      "div",
      { class: "layer-actions" },
      h("button", { id: "fit", onclick: () => view.fit() }, "Whole flight"),
      h("button", { id: "follow", onclick: toggleFollow, "aria-pressed": "true" }, "Follow"),
    ),
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
    h("option", { value: "" }, "all"),
    ...bands.map(([low, high], number) =>
      h("option", { value: String(number) }, `${Math.round(low)}–${Math.round(high)}\u202fm`),
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
  for (const file of choices.maps) {
    select.append(h("option", { value: file.name, disabled: file.fault !== null }, file.fault ? `${file.name}: ${file.fault}` : file.name));
  }
  select.onchange = () => void view.setBasemap(choices.maps.find((one) => one.name === select.value) ?? null);
  const first = choices.maps.find((one) => !one.fault);
  if (first) {
    select.value = first.name;
    void view.setBasemap(first);
  }
}
