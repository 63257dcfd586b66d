"""Plots of the results: Pd and recall by ENR, pulses summed, false alarms."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from uavrt.core.errors import needs_extra
from uavrt_experiments.detection import original, theory
from uavrt_experiments.result import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIZE = (8.0, 5.0)
_OURS = "C0"
_ORIGINAL = "C3"


def require_matplotlib() -> None:
    """Check that matplotlib is installed, before minutes of work.

    Raises `UsageError`: it is not installed.
    """
    with needs_extra("analysis", "drawing the curves", otherwise=", or give --no-plots"):
        import matplotlib.figure  # noqa: F401


def draw_all(directory: Path, rows: Sequence[Row]) -> list[Path]:
    """Draw the curves that have rows; returns the paths of the pictures."""
    from matplotlib.figure import Figure

    directory.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, draw in (
        ("pd.png", draw_pd),
        ("pulses-summed.png", draw_summed),
        ("tracking.png", draw_tracking),
        ("false-alarms.png", draw_false_alarms),
    ):
        figure = Figure(figsize=_SIZE, layout="constrained")
        if draw(figure, rows):
            figure.savefig(directory / name, dpi=110)
            drawn.append(directory / name)
    return drawn


def _with_bars(axes: "Axes", rows: Sequence[Row], label: str, **style: object) -> None:
    """Plot figures with their intervals as error bars."""
    figures = np.array([row.figure for row in rows])
    ends = np.array([[r.figure - r.low, r.high - r.figure] for r in rows]).T
    at = [row.at for row in rows]
    axes.errorbar(at, figures, np.maximum(ends, 0.0), capsize=3, label=label, **style)  # type: ignore[arg-type]


def _finish(
    axes: "Axes", title: str, x: str, y: str, where: Literal["best", "center left"] = "best"
) -> bool:
    axes.set(xlabel=x, ylabel=y, title=title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small", loc=where)
    return True


def draw_pd(figure: "Figure", rows: Sequence[Row]) -> bool:
    """Plot Pd of single decisions by ENR, with the original and the bounds."""
    ours = sorted(
        (r for r in rows if r.quantity == "Pd" and r.case.startswith("K = 3, pf 1 %")),
        key=lambda row: row.at or 0.0,
    )
    if not ours:
        return False
    axes = figure.subplots()
    levels = np.linspace(0.0, 14.0, 113)
    for label, bound, style in (
        ("genie: time, frequency, interval known", theory.genie, ":"),
        ("union bound: aligned pulses, whole search", theory.union_bound, "--"),
    ):
        axes.plot(levels, [bound(3, e) for e in levels], style, color="gray", label=label)
    single = [theory.single_pulse(e) for e in levels]
    axes.plot(levels, single, "-.", color="gray", label="single pulse (energy detector)")
    _with_bars(axes, ours, "ours", fmt="o-", color=_OURS)
    axes.plot(*zip(*original.PD.items(), strict=True), "s-", color=_ORIGINAL, label="original")
    axes.set_xlim(0.0, 14.0)
    n = ours[0].n
    title = f"Thesis's tag, K = 3, pf 1 %, whole channel, n = {n} for each point"
    return _finish(axes, title, "ENR of a pulse [dB]", "Pd of a decision", "center left")


def draw_summed(figure: "Figure", rows: Sequence[Row]) -> bool:
    """Plot the ENR for Pd 0.5 by the number of pulses summed."""
    ours = sorted(
        (r for r in rows if r.quantity == "ENR for Pd 0.5, dB" and r.at is not None),
        key=lambda row: row.at or 0.0,
    )
    if not ours:
        return False
    axes = figure.subplots()
    for label, table, style in (
        ("union bound", theory.ENR_HALF_DB, "--"),
        ("genie", theory.GENIE_HALF_DB, ":"),
    ):
        axes.plot(*zip(*table.items(), strict=True), style, color="gray", label=label)
    _with_bars(axes, ours, "ours", fmt="o", color=_OURS)
    axes.plot([3.0], [original.ENR_HALF_DB], "s", color=_ORIGINAL, label="original, K = 3")
    axes.set_xscale("log")
    at = sorted(theory.ENR_HALF_DB)
    axes.set_xticks(at, labels=[str(k) for k in at])
    axes.minorticks_off()
    title = "Whole channel, pf 1 % for each decision interval"
    return _finish(axes, title, "pulses summed K", "ENR for Pd .5 [dB]")


def draw_tracking(figure: "Figure", rows: Sequence[Row]) -> bool:
    """Plot the confirmed share of the pulses of 300 s by ENR."""
    ours = sorted(
        (r for r in rows if r.experiment == "E4" and r.at is not None),
        key=lambda row: row.at or 0.0,
    )
    if not ours:
        return False
    axes = figure.subplots()
    _with_bars(axes, ours, "ours", fmt="o-", color=_OURS)
    published = zip(*original.CONFIRMED_RECALL.items(), strict=True)
    axes.plot(*published, "s-", color=_ORIGINAL, label="original")
    title = f"Tracking for 300 s, whole channel, {ours[0].note}"
    return _finish(axes, title, "ENR of a pulse [dB]", "pulses confirmed")


def draw_false_alarms(figure: "Figure", rows: Sequence[Row]) -> bool:
    """Plot the false groups found by the nominal share."""
    ours = [r for r in rows if r.experiment == "E1" and r.at is not None]
    if not ours:
        return False
    axes = figure.subplots()
    names = list(dict.fromkeys(row.case.split(", nominal")[0] for row in ours))
    for number, name in enumerate(names):
        mine = sorted(
            (r for r in ours if r.case.startswith(name + ", nominal")), key=lambda r: r.at or 0
        )
        # Points of one share next to one another, not on one another.
        shift = 1.0 + 0.05 * (number - len(names) / 2.0)
        at = np.array([(r.at or 0.0) * shift for r in mine])
        figures = np.array([r.figure for r in mine])
        ends = np.array([[r.figure - r.low, r.high - r.figure] for r in mine]).T
        axes.errorbar(at, figures, np.maximum(ends, 0.0), fmt="o-", capsize=3, label=name)
    axes.axhspan(0.7, 1.4, color="gray", alpha=0.15, label="asked for")
    published = list(original.FALSE_ALARMS.values())
    asked = [100.0 * share for share in original.FALSE_ALARMS]
    axes.plot(asked, published, "s", color=_ORIGINAL, label="original, white")
    axes.set_xscale("log")
    axes.set_xticks([0.1, 1.0, 5.0], labels=["0.1", "1", "5"])
    axes.minorticks_off()
    title = "Noise alone, thesis's tag, K = 3"
    return _finish(axes, title, "false alarms asked for [% of decisions]", "found / asked for")
