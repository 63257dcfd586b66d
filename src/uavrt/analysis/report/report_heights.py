"""Draw a monopole survey by height: SNR, vertical section and height range maps."""

from typing import TYPE_CHECKING

import numpy as np

from uavrt.analysis.estimates.power_survey import TagSignal
from uavrt.analysis.report.report_maps import LocalMap, draw_strongest, draw_surface
from uavrt.analysis.report.style import INK, SNR_COLORS, SOFT
from uavrt.analysis.survey import Survey

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

COLUMNS = 2
PER_PAGE = 6
CAPTION = (
    "Left: SNR of each pulse over the drone's height; line: median of each layer. Right, for "
    "a survey at several heights: side view of SNR, over the distance from the estimated "
    "position."
)
LAYER_CAPTION = (
    "Map of SNR for each layer of flight heights, all with the same colours. Cross: strongest "
    "signal of the layer; the tag is on the ring around it."
)


def draw_heights(target: "FigureBase", signal: TagSignal) -> None:
    """Draw SNR over height and, for several heights, a vertical section."""
    section = signal.section
    if section is None:
        axes = target.subplots()
    else:
        axes, side = target.subplots(1, 2, sharey=True, width_ratios=[1.0, 1.6])
        drawn = side.pcolormesh(
            section.distance_m, section.height_m, section.snr_db, cmap=SNR_COLORS
        )
        target.colorbar(drawn, ax=side, label="SNR [dB]")
        side.set_xlabel("distance from the star, over ground [m]")
        side.set_facecolor("#f2f2f2")
    track = signal.track
    axes.plot(track.snr_db, track.height_m, ".", color=SOFT, ms=3, alpha=0.6)
    middle = [(band.low_m + band.high_m) / 2.0 for band in signal.heights]
    axes.plot([band.median_db for band in signal.heights], middle, "o-", color=INK, ms=4)
    axes.set_xlabel("SNR [dB]")
    axes.set_ylabel("height above the start [m]")
    axes.grid(visible=True)


def draw_layers(
    target: "FigureBase", survey: Survey, signal: TagSignal, first: int = 0
) -> None:
    """Draw up to `PER_PAGE` height range maps from number `first`, in one color scale."""
    layers = signal.layers[first : first + PER_PAGE]
    every = np.concatenate(
        [one.surface.snr_db.ravel() for one in signal.layers if one.surface is not None]
    )
    limits_db = (float(np.nanmin(every)), float(np.nanmax(every)))
    rows = -(-len(layers) // COLUMNS)
    grid = target.subplots(rows, COLUMNS, squeeze=False)
    for axes in grid.flat[len(layers) :]:
        axes.set_visible(False)
    for axes, layer in zip(grid.flat, layers, strict=False):
        chart = LocalMap(axes, survey, [signal.tag_id])
        if layer.surface is not None:
            drawn = draw_surface(chart, layer.surface, limits_db)
        draw_strongest(chart, layer.strongest)
        axes.set_title(f"{layer.name}, {layer.pulses} pulses", fontsize=9)
    target.colorbar(drawn, ax=grid, label="SNR [dB]", shrink=0.6)
