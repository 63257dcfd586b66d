"""Polar plots of SNR over the antenna's heading, with its pattern and residuals."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.report.style import INK, SOFT, message, tag_color
from uavrt.analysis.survey import Survey
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.units import wrap_degrees_180, wrap_degrees_360
from uavrt.localization.antenna import pattern_named
from uavrt.localization.estimates.flight_estimates import TagBearing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

COLUMNS = 4
CAPTION = (
    "SNR [dB] over heading for each turn in place; grey: the antenna's pattern at the "
    "estimated bearing; below: differences from the pattern."
)
_Floats = NDArray[np.float64]


def headings_and_snr(survey: Survey, bearing: TagBearing) -> tuple[_Floats, _Floats]:
    """Antenna headings [deg] and SNR [dB] of the pulses used in a bearing."""
    pairs = [
        (yaw_deg(one.pose.quaternion_wxyz) + survey.offset_deg, one.pulse.snr_db)
        for one in survey.pulses_of(bearing.tag_id)
        if one.pose is not None
        and bearing.start_time_ns <= one.pulse.start_time_ns <= bearing.end_time_ns
        and np.isfinite(one.pulse.snr_db)
    ]
    array = np.array(pairs, np.float64).reshape(-1, 2)
    return array[:, 0], array[:, 1]


def draw_roses(target: "FigureBase", survey: Survey, tag_id: int, first: int = 0) -> None:
    """Draw polar plots and residuals of up to `COLUMNS` bearings from number `first`."""
    bearings = survey.bearings_of(tag_id)[first : first + COLUMNS]
    if not bearings:
        message(target, "No polar plot: no turn in place has three pulses of this tag.")
        return
    color = tag_color(survey.tag_ids, tag_id)
    columns = max(len(bearings), 3)
    layout = target.add_gridspec(2, columns, height_ratios=[3.2, 1.0])
    for column, one in enumerate(bearings):
        yaw, snr = headings_and_snr(survey, one)
        rose = target.add_subplot(layout[0, column], projection="polar")
        _rose(rose, survey, one, yaw, snr, color)
        rest = target.add_subplot(layout[1, column])
        _residuals(rest, survey, one, yaw, snr, color)
        if column == 0:
            rest.set_ylabel("SNR − pattern [dB]")


def _gain_db(survey: Survey, off_deg: _Floats) -> _Floats:
    return (survey.pattern or pattern_named(survey.antenna)).gain_db(off_deg)


def _rose(
    axes: "Axes", survey: Survey, one: TagBearing, yaw: _Floats, snr: _Floats, color: str
) -> None:
    bearing = one.bearing
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    axes.set_theta_direction(-1)  # type: ignore[attr-defined]
    top = max(float(snr.max(initial=10.0)), bearing.level_db or 0.0) + 3.0
    floor = min(float(snr.min(initial=top)), top - 20.0) - 3.0
    if bearing.interval90_deg is not None:
        low, high = bearing.interval90_deg
        width = np.radians(wrap_degrees_360(high - low))
        axes.bar(
            np.radians(low) + width / 2,
            top - floor,
            width=width,
            bottom=floor,
            color=color,
            alpha=0.18,
            lw=0,
        )
    if bearing.level_db is not None:
        around = np.linspace(0.0, 360.0, 361)
        level = bearing.level_db + _gain_db(survey, around - bearing.bearing_deg)
        axes.plot(np.radians(around), np.maximum(level, floor), color=SOFT, lw=1.0)
    axes.plot(np.radians([bearing.bearing_deg] * 2), [floor, top], color=color, lw=1.8)
    axes.plot(np.radians(yaw), snr, "o", color=INK, ms=2.6, alpha=0.8, mew=0)
    axes.set_rlim(floor, top)  # type: ignore[attr-defined]
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["N", "E", "S", "W"])
    axes.set_rlabel_position(135)  # type: ignore[attr-defined]
    axes.tick_params(labelsize=7, pad=0)
    text = f"{bearing.bearing_deg:.0f}°"
    if bearing.sigma_deg is not None:
        text += f" ± {bearing.sigma_deg:.0f}°"
    axes.set_title(f"{text}\n{len(snr)} pulses", loc="center", fontsize=8.5)


def _residuals(
    axes: "Axes", survey: Survey, one: TagBearing, yaw: _Floats, snr: _Floats, color: str
) -> None:
    bearing = one.bearing
    axes.axhline(0.0, color=SOFT, lw=0.8)
    axes.axvline(0.0, color=color, lw=1.2)
    off = wrap_degrees_180(yaw - bearing.bearing_deg)
    level = float(np.median(snr)) if bearing.level_db is None else bearing.level_db
    rest = snr - level - _gain_db(survey, off)
    axes.plot(off, rest, "o", color=INK, ms=2.2, alpha=0.8, mew=0)
    bound = max(6.0, float(np.abs(rest).max(initial=0.0)) * 1.1)
    axes.set_ylim(-bound, bound)
    axes.set_xlim(-180, 180)
    axes.set_xticks([-180, -90, 0, 90, 180], ["−180°", "", "0", "", "180°"], fontsize=7)
    axes.set_xlabel("off the bearing", fontsize=7.5)
    axes.tick_params(axis="y", labelsize=7)
