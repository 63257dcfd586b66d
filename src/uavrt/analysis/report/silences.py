"""Draw coverage maps, from dark blue (not detectable) to yellow (surely detected)."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.estimates.position_words import FactTable
from uavrt.analysis.report.report_maps import LocalMap, draw_path, draw_track
from uavrt.analysis.report.style import SOFT, new_figure, styled
from uavrt.analysis.survey import Survey
from uavrt.core.units import counted
from uavrt.formats.png import chance
from uavrt.planning.detectability.detection_coverage import Coverage

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import FigureBase

CAPTION = (
    "Probability that a tag at each position would be detected in this flight. Dark blue: 0; "
    "blue-green: one half; yellow: 1; transparent: unknown. Grey: the flight path."
)


def summary(one: SilentMap) -> FactTable:
    """Table of a coverage map: result, assumed power, detection probability and limits."""
    found = one.coverage
    if one.heard_pulses:
        result = f"detected ({counted(one.heard_pulses, 'confirmed pulse')})"
    elif one.in_hindsight:
        result = "found over the whole flight, too weak for single groups"
    else:
        result = "not detected: where the map is yellow, it is probably absent"
    how = "found over the whole flight" if found.whole_flight else "detected"
    return FactTable(
        rows=(
            ("Tag", (result,)),
            ("Assumed power", (f"{one.tag_power_dbm:g} dBm (± 3 dB)",)),
            (
                f"Would be {how}",
                (
                    f"with {100.0 * found.mean:.0f} % on average",
                    f"with 90 % or more on {100.0 * found.share_above(0.9):.0f} % of "
                    f"{found.known_km2:.1f} km²",
                ),
            ),
            ("Limits", found.limitations),
        ),
        details=(("Drone's noise", (one.noise,)), ("Antenna", (one.antenna,))),
    )


def draw_silence(target: "FigureBase", survey: Survey, one: SilentMap) -> None:
    """Draw a coverage map with the flown path above it."""
    chart = _draw(target, survey, one.coverage, "would be detected")
    draw_track(chart, survey)


def coverage_png(coverage: Coverage, path: Sequence[tuple[float, float]]) -> bytes:
    """Coverage map as in the report, with `path` (longitude, latitude), as PNG."""
    empty = Survey(name="", kind="flight", antenna="", pulse_poses=(), track=())
    with styled():
        figure = new_figure(7.5, 6.5)
        chart = _draw(figure, empty, coverage, "is detected")
        draw_path(chart, path)
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=150, metadata={"Software": "uavrt"})
    return stream.getvalue()


def _draw(target: "FigureBase", survey: Survey, coverage: Coverage, heard: str) -> LocalMap:
    axes, ground = target.subplots(), coverage.ground
    half = 0.5 * ground.cell_m
    west, east = ground.east_m[0] - half, ground.east_m[-1] + half
    south, north = ground.north_m[0] - half, ground.north_m[-1] + half
    latitude, longitude = ground.plane.to_geodetic([west, east], [south, north])
    corners = list(zip(longitude.tolist(), latitude.tolist(), strict=True))
    chart = LocalMap(axes, survey, (), also=corners, margin=1.0)
    x, y = chart.line(corners)
    axes.imshow(
        chance(coverage.heard[::-1]),
        extent=(float(x[0]), float(x[1]), float(y[0]), float(y[1])),
        interpolation="nearest",
        zorder=0.5,
    )
    bar = target.colorbar(_scale(), ax=axes, shrink=0.7, pad=0.02)
    bar.set_label(f"probability that a tag there {heard}", color=SOFT)
    return chart


def _scale() -> "ScalarMappable":
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    colors = chance(np.linspace(0.0, 1.0, 256, dtype=np.float32)[np.newaxis])[0] / 255.0
    return ScalarMappable(Normalize(0.0, 1.0), ListedColormap(colors))
