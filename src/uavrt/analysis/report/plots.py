"""Draw the results of a detection run for each tag: waterfall with pulses, folded pulses, SNR
over time.

Matplotlib, from the extra ``uavrt[analysis]``, is used without pyplot and without a display.
The colours are those of Okabe and Ito (2008), which people with any kind of colour vision can
distinguish; marker shapes show the same distinction.
"""

import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.measure.waterfall import Waterfall
from uavrt.core.errors import RecordingError, needs_extra, os_errors_as
from uavrt.core.messages import ChannelBlock, DetectionStatus, Pulse, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.detection.beeps.interval_fit import Beat, fit_beat

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure

STYLES: Final[dict[DetectionStatus, tuple[str, str, str]]] = {
    "confirmed": ("#0072B2", "o", "confirmed"),
    "detected": ("#D55E00", "^", "detected"),
    "subthreshold": ("#000000", "x", "below the threshold"),
    "integrated": ("#CC79A7", "+", "found after the flight"),
}
"""Colour, marker shape and legend text of each pulse status."""
CIRCLED: Final = 40
"""Maximum number of circled pulses in a waterfall; more would hide the picture."""
TICKED: Final = 400
"""Maximum number of pulses marked by ticks above a waterfall; more would touch."""
RASTER_ROWS: Final = 700
LEAST_DB: Final = 6.0
LEAST_HZ: Final = 20.0
LOWEST_SPAN_DB: Final = 15.0


class DetectionPlots:
    """Collects the data for plots during a detection run, in almost constant memory."""

    def __init__(
        self, directory: Path, tags: Sequence[Tag], *, frequency_window_hz: float = 500.0
    ) -> None:
        with needs_extra("analysis", "drawing pictures"):
            import matplotlib  # noqa: F401
        with _writing(directory):
            directory.mkdir(parents=True, exist_ok=True)
        self._directory = directory
        self._tags = tuple(tags)
        self._half_width_hz = 1.2 * frequency_window_hz
        self._waterfalls: dict[int, tuple[int, float, Waterfall]] = {}
        self._pulses: dict[int, list[Pulse]] = {tag.tag_id: [] for tag in tags}

    def add_block(self, block: ChannelBlock) -> None:
        """Add a channel's block; each tag is plotted from the channel nearest to it."""
        for tag in self._tags:
            offset_hz = tag.frequency_hz - block.center_frequency_hz
            known = self._waterfalls.get(tag.tag_id)
            closer = known is None or abs(offset_hz) < known[1]
            if closer and abs(offset_hz) <= block.sample_rate_hz / 2:
                fresh = Waterfall(
                    offset_hz=offset_hz,
                    half_width_hz=self._half_width_hz,
                    sample_rate_hz=block.sample_rate_hz,
                    pulse_width_s=tag.pulse_width_s,
                )
                known = (block.channel, abs(offset_hz), fresh)
                self._waterfalls[tag.tag_id] = known
            if known is not None and known[0] == block.channel:
                known[2].add(block)

    def add_pulses(self, pulses: Sequence[Pulse]) -> None:
        """Add detected pulses to the plots."""
        for pulse in pulses:
            self._pulses[pulse.tag_id].append(pulse)

    def write(self) -> list[Path]:
        """Draw the pictures of every tag that has samples; return their files."""
        written = []
        for tag in self._tags:
            known = self._waterfalls.get(tag.tag_id)
            if known is None or not len(known[2].power):
                continue
            pulses = sorted(self._pulses[tag.tag_id], key=lambda pulse: pulse.start_time_ns)
            waterfall = known[2]
            figures = {
                "waterfall": draw_waterfall(tag, waterfall, pulses),
                "beat": draw_beat(tag, waterfall, pulses),
                "snr": draw_snr(tag, waterfall, pulses),
            }
            for name, figure in figures.items():
                path = self._directory / f"tag_{tag.tag_id}_{name}.png"
                with _writing(path):
                    figure.savefig(path)
                written.append(path)
        return written


def draw_waterfall(tag: Tag, waterfall: Waterfall, pulses: Sequence[Pulse]) -> "Figure":
    """Draw the level over time and frequency; pulses are circled, or marked by ticks above."""
    figure = _figure(5.2)
    ticks, axes = figure.subplots(2, 1, sharex=True, height_ratios=(1, 14))
    level_db = levels_over_noise_db(waterfall.power)
    low, high = _edges(waterfall.frequencies_hz)
    begin = _date(waterfall.start_time_ns)
    end = begin + level_db.shape[0] * waterfall.column_s / 86_400
    present = level_db[np.isfinite(level_db)]
    top = max(LOWEST_SPAN_DB, float(np.quantile(present, 0.9995))) if present.size else 15.0
    image = axes.imshow(
        level_db.T,
        extent=(begin, end, low, high),
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        cmap=_colours(),
        vmin=0.0,
        vmax=top,
    )
    bar = figure.colorbar(image, ax=[ticks, axes], pad=0.015, fraction=0.05, extend="both")
    bar.set_label("Level over noise [dB]")
    for status, (colour, _, name) in STYLES.items():
        chosen = [pulse for pulse in pulses if pulse.detection_status == status]
        if not chosen:
            continue
        at = [_date((p.start_time_ns + p.end_time_ns) // 2) for p in chosen]
        if len(pulses) <= TICKED:
            ticks.vlines(at, 0, 1, color=colour, linewidth=0.8)
        if len(pulses) <= CIRCLED:
            offset = [p.frequency_hz - tag.frequency_hz for p in chosen]
            axes.scatter(
                at, offset, s=70, marker="o", facecolor="none", edgecolor="white", linewidth=0.9
            )
        ticks.plot([], [], color=colour, label=f"{len(chosen)} {name}", marker="|", ls="none")
    _legend(ticks, "no pulses")
    if len(pulses) > TICKED:
        _draw_counts(ticks, pulses, begin, end)
    else:
        ticks.set_ylim(0, 1)
    ticks.set_axis_off()
    axes.set_ylim(low, high)
    axes.set_ylabel(f"Offset from {tag.frequency_hz / 1e6:.6f} MHz [Hz]")
    _time_axis(axes, waterfall)
    figure.suptitle(f"{_name(tag)}: waterfall", x=0.01, ha="left")
    return figure


def _draw_counts(axes: "Axes", pulses: Sequence[Pulse], begin: float, end: float) -> None:
    """Histogram of pulses in 200 time spans, in place of ticks that would touch."""
    groups = [[p for p in pulses if p.detection_status == status] for status in STYLES]
    axes.hist(
        [[_date(pulse.start_time_ns) for pulse in group] for group in groups],
        bins=200,
        range=(begin, end),
        stacked=True,
        color=[colour for colour, _, _ in STYLES.values()],
    )


def draw_snr(tag: Tag, waterfall: Waterfall, pulses: Sequence[Pulse]) -> "Figure":
    """Draw SNR and frequency of each pulse over time."""
    figure = _figure(5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for status, (colour, shape, name) in STYLES.items():
        chosen = [pulse for pulse in pulses if pulse.detection_status == status]
        if not chosen:
            continue
        at = [_date(pulse.start_time_ns) for pulse in chosen]
        style = {"marker": shape, "s": _dot_size(pulses), "color": colour, "linewidth": 0.8}
        upper.scatter(at, [p.snr_db for p in chosen], label=f"{len(chosen)} {name}", **style)
        lower.scatter(at, [p.frequency_hz - tag.frequency_hz for p in chosen], **style)
    _legend(upper, "no pulses")
    upper.set_ylabel("Pulse energy over\nnoise density [dB]")
    lower.set_ylabel(f"Offset from\n{tag.frequency_hz / 1e6:.6f} MHz [Hz]")
    for axes, span in ((upper, LEAST_DB), (lower, LEAST_HZ)):
        axes.grid(visible=True, color="0.88", linewidth=0.6)
        axes.set_axisbelow(True)
        low, high = axes.get_ylim()
        if high - low < span:  # half a decibel of scatter shall not look like a change
            axes.set_ylim((low + high - span) / 2, (low + high + span) / 2)
    begin = _date(waterfall.start_time_ns)
    lower.set_xlim(begin, begin + len(waterfall.power) * waterfall.column_s / 86_400)
    _time_axis(lower, waterfall)
    figure.suptitle(f"{_name(tag)}: SNR and frequency", x=0.01, ha="left")
    return figure


def draw_beat(tag: Tag, waterfall: Waterfall, pulses: Sequence[Pulse]) -> "Figure":
    """Draw levels and pulses folded at the interval, a row of pictures per interval."""
    rates = sorted({pulse.rate for pulse in pulses}) or [1]
    figure = _figure(5.2 * len(rates))
    grid = figure.subplots(len(rates), 2, width_ratios=(3, 2), sharey="row", squeeze=False)
    for (raster, dots), rate in zip(grid, rates, strict=True):
        chosen = [pulse for pulse in pulses if pulse.rate == rate]
        times = (
            np.array([p.start_time_ns - waterfall.start_time_ns for p in chosen], np.float64)
            / NANOSECONDS_PER_SECOND
        )
        nominal_s = tag.pulse_intervals_s[rate - 1]
        beat = fit_beat(times, nominal_s) if times.size >= 3 else None
        interval_s = nominal_s if beat is None else beat.interval_s
        first_s = 0.0 if beat is None else beat.first_s + tag.pulse_width_s / 2
        _draw_raster(raster, waterfall, interval_s, first_s)
        known = "nominal" if beat is None else f"± {1e3 * beat.sigma_s:.2g} ms, measured"
        raster.set_title(
            f"Rate {rate}: folded at {1e3 * interval_s:.2f} ms ({known})", loc="left", size=9
        )
        raster.set_ylabel("Time since the start [s]")
        raster.set_xlabel("Time within the interval, a pulse at 0 [ms]")
        _draw_residuals(dots, chosen, times, beat)
    start = np.datetime64(waterfall.start_time_ns, "ns").astype("datetime64[s]")
    figure.suptitle(
        f"{_name(tag)}: beat (start {str(start).replace('T', ' ')} UTC)", x=0.01, ha="left"
    )
    return figure


def _draw_raster(axes: "Axes", waterfall: Waterfall, interval_s: float, first_s: float) -> None:
    """Draw the level along each interval as a row; too many intervals share rows."""
    trace, step_s = waterfall.trace, waterfall.trace_s
    at = np.arange(trace.size) * step_s + waterfall.frame_center_s
    phase = (at - first_s) / interval_s + 0.5
    number = np.floor(phase).astype(np.int64)
    number -= number.min() if number.size else 0
    rows = int(number.max(initial=0)) + 1
    joined = -(-rows // RASTER_ROWS)
    columns = max(8, min(600, int(interval_s / step_s)))
    raster = np.zeros((-(-rows // joined), columns), dtype=np.float32)
    place = np.minimum((phase % 1.0 * columns).astype(np.int64), columns - 1)
    np.maximum.at(raster, (number // joined, place), trace)
    level_db = levels_over_noise_db(raster)
    half_ms = 500.0 * interval_s
    begin_s = (np.floor((waterfall.frame_center_s - first_s) / interval_s + 0.5) - 0.5) * (
        interval_s
    ) + first_s
    axes.imshow(
        level_db,
        extent=(-half_ms, half_ms, begin_s + len(raster) * joined * interval_s, begin_s),
        aspect="auto",
        interpolation="nearest",
        cmap=_colours(),
        vmin=0.0,
        vmax=LOWEST_SPAN_DB,
    )
    axes.set_ylim(max(trace.size * step_s, 2 * interval_s), 0.0)


def _draw_residuals(
    axes: "Axes", pulses: Sequence[Pulse], times_s: NDArray[np.float64], beat: Beat | None
) -> None:
    axes.axvline(0.0, color="0.6", linewidth=0.8)
    axes.grid(visible=True, color="0.88", linewidth=0.6)
    axes.set_axisbelow(True)
    if beat is None:
        axes.set_xlabel("Pulse after the regular beat [ms]")
        axes.set_xlim(-10.0, 10.0)
        axes.text(
            0.5, 0.5, "too few pulses for an interval", transform=axes.transAxes, ha="center"
        )
        return
    residual_ms = 1e3 * beat.residuals_s
    for status, (colour, shape, name) in STYLES.items():
        chosen = np.array([pulse.detection_status == status for pulse in pulses])
        if chosen.any():
            axes.scatter(
                residual_ms[chosen],
                times_s[chosen],
                s=_dot_size(pulses),
                marker=shape,
                color=colour,
                linewidth=0.8,
                label=f"{int(chosen.sum())} {name}",
            )
    reach = max(2.0, 1.15 * float(np.abs(residual_ms).max()))
    axes.set_xlim(-reach, reach)
    axes.set_xlabel(
        f"Pulse after the regular beat [ms], scatter {1e3 * beat.scatter_s:.2f} ms rms"
    )
    _legend(axes, "")


def levels_over_noise_db(power: NDArray[np.float32]) -> NDArray[np.float64]:
    """Level of each cell over the noise [dB]; NaN where samples are missing."""
    present = power > 0.0
    level = np.full(power.shape, np.nan)
    if present.any():
        level[present] = 10.0 * np.log10(power[present] / np.median(power[present]))
    return level


def _figure(height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(11.0, height), dpi=120, layout="constrained")


def _colours() -> "Colormap":
    from matplotlib import colormaps

    return colormaps["viridis"].with_extremes(bad="0.8")


def _legend(axes: "Axes", otherwise: str) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=3,
            frameon=False,
            borderaxespad=0.1,
            handletextpad=0.3,
            fontsize=8,
        )
    elif otherwise:
        axes.text(0.5, 0.5, otherwise, transform=axes.transAxes, ha="center", va="center")


def _time_axis(axes: "Axes", waterfall: Waterfall) -> None:
    from matplotlib.dates import AutoDateLocator, DateFormatter

    span_s = len(waterfall.power) * waterfall.column_s
    locator = AutoDateLocator(minticks=4, maxticks=10)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    written = "%H:%M:%S" if span_s < 1800 else "%H:%M"
    axes.xaxis.set_major_formatter(DateFormatter(written))  # type: ignore[no-untyped-call]
    day = np.datetime64(waterfall.start_time_ns, "ns").astype("datetime64[D]")
    axes.set_xlabel(f"UTC, {day}")


def _date(time_ns: int) -> float:
    return time_ns / NANOSECONDS_PER_SECOND / 86_400


def _dot_size(pulses: Sequence[Pulse]) -> float:
    return 16.0 if len(pulses) <= TICKED else 5.0


def _edges(centers: NDArray[np.float64]) -> tuple[float, float]:
    half = (centers[1] - centers[0]) / 2 if centers.size > 1 else 0.5
    return float(centers[0] - half), float(centers[-1] + half)


def _name(tag: Tag) -> str:
    # A dollar sign would begin an equation.
    name = "" if tag.name is None else f" {re.sub(r'[$]', '', tag.name)}"
    return f"Tag {tag.tag_id}{name}"


def _writing(path: Path) -> AbstractContextManager[None]:
    remedy = "Give --plot a writable directory"
    return os_errors_as(RecordingError, f"cannot write {path}", remedy)
