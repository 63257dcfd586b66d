/** How vector map files are drawn: the layers of Protomaps and of OpenMapTiles, quietly. */

import type { LayerSpecification } from "maplibre-gl";

interface Kind {
  layers: string[];
  type: "fill" | "line";
  light: string;
  dark: string;
  width?: number;
}

const KINDS: Kind[] = [
  { layers: ["earth"], type: "fill", light: "#f4f4ef", dark: "#20292d" },
  { layers: ["landcover", "natural"], type: "fill", light: "#e3ecdd", dark: "#24302c" },
  { layers: ["landuse"], type: "fill", light: "#e9ece2", dark: "#263030" },
  { layers: ["water"], type: "fill", light: "#c3dbe6", dark: "#16323f" },
  { layers: ["waterway", "physical_line"], type: "line", light: "#9cc4d6", dark: "#24505f", width: 1.2 },
  { layers: ["building", "buildings"], type: "fill", light: "#d8d4cc", dark: "#333c40" },
  { layers: ["transportation", "roads", "transit"], type: "line", light: "#b8aa96", dark: "#5d6468", width: 1.3 },
  { layers: ["boundary", "boundaries"], type: "line", light: "#a58fb0", dark: "#6f6080", width: 1 },
];

/** Layers for the source "base"; `names` are the file's own layers, null when not known. */
export function vectorLayers(names: string[] | null, dark: boolean): LayerSpecification[] {
  return KINDS.flatMap((kind) =>
    kind.layers
      .filter((name) => names === null || names.includes(name))
      .map((name): LayerSpecification => {
        const colour = dark ? kind.dark : kind.light;
        const common = { id: `base-${kind.type}-${name}`, source: "base", "source-layer": name };
        return kind.type === "fill"
          ? { ...common, type: "fill", filter: ["==", ["geometry-type"], "Polygon"], paint: { "fill-color": colour } }
          : { ...common, type: "line", paint: { "line-color": colour, "line-width": kind.width ?? 1 } };
      }),
  );
}
