"""Draw SNR, heading and noise density over time."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from uavrt.analysis.report.style import FAINT, INK, SOFT, message, tag_color
from uavrt.analysis.survey import Survey, thinned
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.messages import PulsePose

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

NOISE_CAPTION = "Noise density at each tag's frequency, over the square of full scale."


def draw_times(target: "FigureBase", survey: Survey, tag_id: int) -> None:
    """Draw a tag's SNR and the heading over time; turns with a bearing are shaded."""
    heard, later = survey.pulses_of(tag_id), survey.integrated_of(tag_id)
    if not heard and not later and not survey.track:
        message(target, "No pulses and no poses: nothing to draw over time.")
        return
    upper, lower = target.subplots(2, 1, sharex=True, height_ratios=[1.4, 1.0])
    start_ns = (survey.span_ns or (0, 0))[0]
    color = tag_color(survey.tag_ids, tag_id)
    _snr(upper, heard, start_ns, ms=2.6, mew=0, color=color, label=f"tag {tag_id}")
    if later:
        name = f"tag {tag_id}, found after the flight"
        _snr(upper, later, start_ns, ms=3.4, mew=0.6, mfc="none", color=color, label=name)
        upper.legend(loc="upper right", fontsize=7.5)
    for one in survey.bearings_of(tag_id):
        span = [_minutes(t, start_ns) for t in (one.start_time_ns, one.end_time_ns)]
        for axes in (upper, lower):
            axes.axvspan(*span, color=FAINT, alpha=0.35, lw=0)
    _heading(lower, survey, start_ns)
    upper.set_ylabel("SNR [dB]")
    upper.grid(visible=True)
    lower.set_xlabel(f"minutes after {survey.facts.clock_in_words(start_ns)}")


def _snr(axes: "Axes", pulses: Sequence[PulsePose], start_ns: int, **style: Any) -> None:
    snr = [one.pulse.snr_db if math.isfinite(one.pulse.snr_db) else np.nan for one in pulses]
    minutes = [_minutes(one.pulse.start_time_ns, start_ns) for one in pulses]
    axes.plot(minutes, snr, "o", rasterized=len(pulses) > 3000, **style)


def draw_noise(target: "FigureBase", survey: Survey) -> None:
    """Draw the noise density that the detectors measured at each tag's frequency over time."""
    axes = target.subplots()
    start_ns = (survey.span_ns or (0, 0))[0]
    drawn = False
    for tag_id in survey.tag_ids:
        reports = [r for r in survey.search_reports if r.tag_id == tag_id]
        points = [(r.time_ns, r.noise_psd) for r in reports]
        points += [
            (one.pulse.start_time_ns, one.pulse.noise_psd) for one in survey.pulses_of(tag_id)
        ]
        known = sorted((t, psd) for t, psd in points if math.isfinite(psd) and psd > 0.0)
        if not known:
            continue
        drawn = True
        level = 10.0 * np.log10([psd for _, psd in known])
        times = [_minutes(t, start_ns) for t, _ in known]
        axes.plot(
            times,
            level,
            ".",
            ms=2.5,
            color=tag_color(survey.tag_ids, tag_id),
            label=f"tag {tag_id}",
        )
    if not drawn:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "The noise level is not recorded here.", ha="center", color=SOFT)
        return
    axes.set_ylabel("noise density [dB]")
    axes.set_xlabel(f"minutes after {survey.facts.clock_in_words(start_ns)}")
    axes.grid(visible=True)
    axes.legend(loc="upper left", ncols=5, fontsize=7.5, markerscale=4)


def _heading(axes: "Axes", survey: Survey, start_ns: int) -> None:
    """Draw the vehicle's heading over time, interrupted where it passes from 359° to 0°."""
    poses = thinned(survey.track, 0.5)
    yaw = np.array([yaw_deg(pose.quaternion_wxyz) for pose in poses])
    times = np.array([_minutes(pose.time_ns, start_ns) for pose in poses])
    jumps = np.flatnonzero(np.abs(np.diff(yaw)) > 180.0) + 1
    axes.plot(np.insert(times, jumps, np.nan), np.insert(yaw, jumps, np.nan), color=INK, lw=1.0)
    axes.set_ylim(0, 360)
    axes.set_yticks([0, 90, 180, 270, 360], ["N", "E", "S", "W", "N"])
    axes.set_ylabel("heading")
    axes.grid(visible=True)


def _minutes(time_ns: int, start_ns: int) -> float:
    return (time_ns - start_ns) / 60e9
