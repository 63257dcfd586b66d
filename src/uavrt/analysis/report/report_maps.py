"""Draw maps: graticule, track, pulses by SNR, bearings with wedges, positions with regions."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.estimates.power_survey import TagSignal
from uavrt.analysis.measure.pulse_shapes import (
    Point,
    path_points,
    point_of,
    ray,
    ray_length_m,
    rings95,
    wedge,
)
from uavrt.analysis.report.report_ground import draw_ground
from uavrt.analysis.report.style import (
    INK,
    SNR_COLORS,
    SOFT,
    message,
    outlined,
    tag_color,
    wrapped,
)
from uavrt.analysis.survey import Survey, thinned
from uavrt.analysis.whole_flights.judged_flights import POSITION_M
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.position.levels.strongest import SignalSurface, StrongestSignal
from uavrt.localization.position.regions import region_outlines
from uavrt.localization.results import Position

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import FigureBase

_LEAST_HALF_M = 120.0
_NICE = (1, 2, 5)
_SHADED_SHARES = (0.98, 0.9, 0.75, 0.5, 0.25)
_LEGEND_IN = 1.6
"""Width of the texts in a map's legend [in], which leaves the north arrow free."""
CAPTION = (
    "Latitude and longitude on WGS84; north is up. Stars: most probable positions, each with "
    "a line that contains the tag with 95 % probability. Lines: bearings; shaded: their 90 % "
    "arcs; dashed: unreliable bearings. Grey: the flight path; the dot is its start."
)
TAG_CAPTION = "Pulses by SNR where they were received; red: probability of the tag's position."
SIGNAL_CAPTION = (
    "Colours: SNR, interpolated between the pulses. Cross: strongest signal; for a monopole, "
    "the tag is on the dotted ring around it. Star: estimated position; the line around it "
    "contains the tag with 95 % probability."
)
STRONGEST = "strongest signal; the tag is on a ring around it"


class LocalMap:
    """Map axes in metres around the flight, with fixed limits and a graticule in degrees."""

    def __init__(
        self,
        axes: "Axes",
        survey: Survey,
        tag_ids: Sequence[int],
        *,
        also: Sequence[Point] = (),
        margin: float = 1.25,
    ) -> None:
        self.axes = axes
        places = [*map(point_of, survey.track), *also]
        for tag_id in tag_ids:
            if (position := survey.placed(tag_id)) is not None:
                places.append(point_of(position))
                places += [place for ring in rings95(position) for place in ring]
                places += path_points(position)
            places += _hindsight_places(survey, tag_id)
        self.plane = TangentPlane(latitude_deg=places[0][1], longitude_deg=places[0][0])
        self._frame(places, margin)
        draw_ground(axes, self.plane, survey.maps)

    def line(self, points: Iterable[Point]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Convert points (longitude, latitude) [deg] to east and north [m]."""
        array = np.array(list(points), float).reshape(-1, 2)
        return self.plane.to_local(array[:, 1], array[:, 0])

    def _frame(self, places: list[Point], margin: float) -> None:
        east, north = self.line(places)
        middle = ((east.max() + east.min()) / 2, (north.max() + north.min()) / 2)
        half = float(max(np.ptp(east), np.ptp(north))) / 2 * margin
        half = max(half, _LEAST_HALF_M)
        self.axes.set_aspect("equal")
        self.axes.spines[:].set_visible(True)
        self.axes.set_xlim(middle[0] - half, middle[0] + half)
        self.axes.set_ylim(middle[1] - half, middle[1] + half)
        self._graticule()
        self._scale_bar(half)

    def _graticule(self) -> None:
        (left, right), (low, high) = self.axes.get_xlim(), self.axes.get_ylim()
        south, west = (float(value) for value in self._degrees(left, low))
        north, east = (float(value) for value in self._degrees(right, high))
        east = west + wrap_degrees_360(east - west)
        longitudes, latitudes = _round_values(west, east), _round_values(south, north)
        xs = [float(self.plane.to_local((south + north) / 2, lon)[0]) for lon in longitudes]
        ys = [float(self.plane.to_local(lat, (west + east) / 2)[1]) for lat in latitudes]
        decimals = _decimals(longitudes)
        self.axes.set_xticks(xs, [_degrees(lon, "E", "W", decimals) for lon in longitudes])
        decimals = _decimals(latitudes)
        self.axes.set_yticks(ys, [_degrees(lat, "N", "S", decimals) for lat in latitudes])
        self.axes.tick_params(axis="y", labelrotation=90)
        for label in self.axes.get_yticklabels():
            label.set_verticalalignment("center")
        self.axes.grid(visible=True)
        self.axes.set_axisbelow(True)

    def _degrees(self, east_m: float, north_m: float) -> tuple[float, float]:
        latitude, longitude = self.plane.to_geodetic(east_m, north_m)
        return float(latitude), float(longitude)

    def _scale_bar(self, half_m: float) -> None:
        length = nice_below(half_m / 2)
        (left, _), (low, high) = self.axes.get_xlim(), self.axes.get_ylim()
        x, y = left + 0.08 * half_m, low + 0.08 * half_m
        self.axes.plot(
            [x, x + length],
            [y, y],
            color=INK,
            lw=2,
            solid_capstyle="butt",
            path_effects=[outlined()],
        )
        text = f"{length:g} m" if length < 1000 else f"{length / 1000:g} km"
        halo = [outlined()]
        self.axes.text(x, y + 0.03 * half_m, text, va="bottom", path_effects=halo)
        x, y = left + 0.1 * half_m, high - 0.32 * half_m
        self.axes.annotate(
            "N",
            xy=(x, y + 0.22 * half_m),
            xytext=(x, y),
            ha="center",
            arrowprops={"arrowstyle": "-|>", "color": INK, "path_effects": halo},
            path_effects=halo,
        )


def draw_overview(target: "FigureBase", survey: Survey) -> None:
    """Draw the whole flight: track, all bearings and all positions."""
    if not survey.track:
        message(target, "No map: no data in this recording have a position.")
        return
    axes = target.subplots()
    chart = LocalMap(axes, survey, survey.tag_ids)
    draw_track(chart, survey)
    for tag_id in survey.tag_ids:
        color = tag_color(survey.tag_ids, tag_id)
        _bearings(chart, survey, tag_id, color, wedges=len(survey.tag_ids) <= 4)
        _position(chart, survey, tag_id, color)
        _hindsight(chart, survey, tag_id, color)
    finish_legend(axes)


def draw_tag_map(target: "FigureBase", survey: Survey, tag_id: int) -> None:
    """Draw one tag's map: pulses coloured by SNR, bearings with 90 % sectors, probability and
    position.
    """
    pulses = [one for one in survey.pulses_of(tag_id) if one.pose is not None]
    if not survey.track or not pulses:
        message(target, "No map: this tag was not detected at any known position.")
        return
    axes = target.subplots()
    chart = LocalMap(axes, survey, [tag_id])
    draw_track(chart, survey)
    color = tag_color(survey.tag_ids, tag_id)
    signal, position = survey.signal_of(tag_id), survey.placed(tag_id)
    if signal is not None:
        _signal(target, chart, signal)
    elif position is not None:
        _heat(chart, position)
    _bearings(chart, survey, tag_id, color, wedges=True)
    east, north = chart.line(point_of(one.pose) for one in pulses if one.pose)
    snr = np.array([one.pulse.snr_db for one in pulses])
    known = np.isfinite(snr)
    dots = axes.scatter(
        east[known],
        north[known],
        c=snr[known],
        s=12,
        cmap=SNR_COLORS,
        zorder=4,
        linewidths=0,
        rasterized=len(pulses) > 2000,
    )
    if known.any() and signal is None:
        target.colorbar(dots, ax=axes, label="SNR [dB]", shrink=0.6)
    _position(chart, survey, tag_id, color)
    _hindsight(chart, survey, tag_id, color)
    finish_legend(axes)


def finish_legend(axes: "Axes") -> None:
    """Draw the legend if any element has a label."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", fontsize=7.5)


def draw_track(chart: LocalMap, survey: Survey) -> None:
    """Draw the path of the drone."""
    draw_path(chart, map(point_of, thinned(survey.track)), label="flight")


def draw_path(chart: LocalMap, points: Iterable[Point], label: str | None = None) -> None:
    """Draw a flown or planned path, with a dot at its start."""
    east, north = chart.line(points)
    chart.axes.plot(east, north, color=SOFT, lw=0.9, zorder=2, label=label)
    chart.axes.plot(east[:1], north[:1], "o", color=SOFT, ms=4, zorder=3)


def _bearings(
    chart: LocalMap, survey: Survey, tag_id: int, color: str, *, wedges: bool
) -> None:
    position = survey.placed(tag_id)
    (left, right), (low, high) = chart.axes.get_xlim(), chart.axes.get_ylim()
    for one in survey.bearings_of(tag_id):
        length_m = max(ray_length_m(one, position), math.hypot(right - left, high - low))
        believed = one.bearing.accepted and not one.bearing.ambiguous
        x, y = chart.line(ray(one, length_m))
        style = "-" if believed else (0, (4, 3))
        chart.axes.plot(x, y, color=color, lw=1.1, ls=style, zorder=3)
        area = wedge(one, length_m)
        if wedges and area is not None and one.bearing.accepted:
            x, y = chart.line(area)
            chart.axes.fill(x, y, color=color, alpha=0.10, lw=0, zorder=1)


def _position(chart: LocalMap, survey: Survey, tag_id: int, color: str) -> None:
    position = survey.placed(tag_id)
    if position is None:
        return
    for ring in rings95(position):
        x, y = chart.line(ring)
        chart.axes.plot(x, y, color=color, lw=1.3, zorder=5)
    if position.track:
        x, y = chart.line(path_points(position))
        chart.axes.plot(x, y, color=color, lw=1.6, ls=":", zorder=5)
    (x,), (y,) = chart.line([point_of(position)])
    label = "\n".join(wrapped(f"{survey.label(tag_id)} and 95 %", _LEGEND_IN, size=7.5))
    chart.axes.plot([x], [y], "*", color=color, ms=13, mec="white", zorder=6, label=label)


def _hindsight(chart: LocalMap, survey: Survey, tag_id: int, color: str) -> None:
    """Draw the positions that whole-flight analysis found, including ambiguous ones."""
    verdict, places = survey.verdict_of(tag_id), _hindsight_places(survey, tag_id)
    if verdict is None or not places:
        return
    for ring in verdict.region95:
        x, y = chart.line((longitude, latitude) for latitude, longitude in ring)
        chart.axes.fill(x, y, color=color, alpha=0.15, lw=0, zorder=1)
    x, y = chart.line(places)
    label = f"tag {tag_id}, whole flight, and 95 %"
    chart.axes.plot(x, y, "D", color=color, ms=6, mfc="none", zorder=6, ls="", label=label)


def _hindsight_places(survey: Survey, tag_id: int) -> list[Point]:
    verdict = survey.verdict_of(tag_id)
    parts = () if verdict is None else verdict.parts
    return [point_of(one) for one in parts if one.radius95_m <= POSITION_M]


def _heat(chart: LocalMap, position: Position) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    if position.grid is None:
        return
    for share in _SHADED_SHARES:
        rings = region_outlines(position.grid, share)
        outlines = [np.stack(chart.line(map(tuple, ring)), axis=1) for ring in rings]
        if outlines:
            # Holes run the other way round, and stay open.
            shape = Path.make_compound_path(*map(Path, outlines))
            patch = PathPatch(shape, facecolor="firebrick", edgecolor="none", alpha=0.12)
            chart.axes.add_patch(patch)


def _signal(target: "FigureBase", chart: LocalMap, signal: TagSignal) -> None:
    """Draw a tag's SNR map, its strongest signal, and the circle on which the tag lies."""
    if signal.surface is not None:
        drawn = draw_surface(chart, signal.surface)
        target.colorbar(drawn, ax=chart.axes, label="SNR [dB]", shrink=0.6)
    if signal.strongest is not None:
        draw_strongest(chart, signal.strongest)


def draw_surface(
    chart: LocalMap, surface: SignalSurface, limits_db: tuple[float, float] | None = None
) -> "QuadMesh":
    """Color the map by SNR. With fixed limits, the colors of several maps can be compared."""
    plane = TangentPlane(latitude_deg=surface.latitude_deg, longitude_deg=surface.longitude_deg)
    east, north = np.meshgrid(surface.east_m, surface.north_m)
    x, y = chart.plane.to_local(*plane.to_geodetic(east, north))
    low, high = limits_db or (None, None)
    return chart.axes.pcolormesh(
        *(x, y, surface.snr_db),
        cmap=SNR_COLORS,
        vmin=low,
        vmax=high,
        alpha=0.75,
        zorder=1,
        rasterized=True,
    )


def draw_strongest(chart: LocalMap, loudest: StrongestSignal) -> None:
    """Mark the strongest signal, and the circle around it on which the tag lies."""
    x, y = chart.line([point_of(loudest)])
    label = "\n".join(wrapped(STRONGEST, _LEGEND_IN, size=7.5))
    chart.axes.plot(x, y, "P", color="white", mec=INK, ms=9, zorder=5, label=label)
    angle = np.linspace(0.0, 2.0 * np.pi, 90)
    ring = loudest.ring_radius_m
    chart.axes.plot(
        x[0] + ring * np.sin(angle), y[0] + ring * np.cos(angle), color=INK, lw=0.8, ls=":"
    )


_MOST_LABELS = 4
"""Maximum number of graticule labels along a side of the map; more would overlap."""


def nice_below(value: float) -> float:
    """Largest 1, 2 or 5 times a power of ten that does not exceed a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in _NICE if step * power <= value * (1 + 1e-9))


def _round_values(low: float, high: float) -> list[float]:
    step = nice_below(max(high - low, 1e-6) / 2.5)
    first = math.ceil(low / step)
    values = [index * step for index in range(first, math.floor(high / step) + 1)]
    if len(values) <= _MOST_LABELS:
        return values
    return [value for value in values if round(value / step) % 2 == 0]


def _decimals(values: Sequence[float]) -> int:
    step = abs(values[1] - values[0]) if len(values) > 1 else 1e-3
    return max(0, -math.floor(math.log10(step) + 1e-9))


def _degrees(value: float, positive: str, negative: str, decimals: int) -> str:
    value = math.remainder(value, 360.0)
    return f"{abs(value):.{decimals}f}° {positive if value >= 0 else negative}"
