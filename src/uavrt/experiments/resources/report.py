"""What the experiment found, in the shape of the thesis's tables."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table

from uavrt.experiments.resources import thesis
from uavrt.experiments.resources.flight import Reading

GROWTH_LIMIT = 0.01
WRITTEN_LIMIT_MB_H = 40.0
"""Of all processes together in an ordinary flight: a memory card lives by it."""
RADIO = "radio (stand-in)"
TOGETHER = "all but the radio"


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """All processes over one stretch."""

    minute: float
    """End of the stretch, since the start of detection."""
    cpu_percent: dict[str, float]
    """Of one core, over the stretch."""
    pss_mb: dict[str, float]
    """Mean over its last 40 s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """What a flight asked of the disk, from the start of detection on."""

    mb_h: dict[str, float]
    """Of each process [MB/h]."""
    syncs_h: float
    """Calls of fsync an hour, by the recorder; the others make none."""

    @property
    def together_mb_h(self) -> float:
        """Of all processes but the radio's stand-in [MB/h]."""
        return ours(self.mb_h)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """One step of the search for too many tags."""

    tags: int
    cpu_percent: float
    """Of one core, all processes but the radio's stand-in."""
    behind_s: float
    """Age of the newest sample that the slowest detector had worked on at the end."""
    lost_samples: float

    @property
    def real_time(self) -> bool:
        """Whether the system kept up."""
        return self.lost_samples == 0 and self.behind_s < 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ResourceReport:
    """The whole experiment."""

    tags: int
    moments: tuple[Moment, ...]
    written: Written
    lost_samples: float
    loads: tuple[Load, ...] = field(default=())

    @property
    def growth(self) -> dict[str, float]:
        """Growth of each process's memory between the first moment and the last, relative.

        Forked processes share pages until one of them writes: what one of them gains so is no
        leak. The sum of all, without the radio's stand-in, tells leaks.
        """
        first, last = self.moments[0].pss_mb, self.moments[-1].pss_mb
        growth = {name: last[name] / first[name] - 1.0 for name in last if first.get(name)}
        return growth | {TOGETHER: ours(last) / ours(first) - 1.0}

    @property
    def most_tags(self) -> int | None:
        """Largest number of tags that was kept up with."""
        return max((load.tags for load in self.loads if load.real_time), default=None)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "tags": self.tags,
            "moments": [
                {"minute": m.minute, "cpu_percent": m.cpu_percent, "pss_mb": m.pss_mb}
                for m in self.moments
            ],
            "written_mb_h": self.written.mb_h | {TOGETHER: self.written.together_mb_h},
            "syncs_h": self.written.syncs_h,
            "cpu_summary": {
                name: summary([m.cpu_percent[name] for m in self.moments])
                for name in self.moments[0].cpu_percent
            },
            "growth": self.growth,
            "lost_samples": self.lost_samples,
            "loads": [
                {
                    "tags": load.tags,
                    "cpu_percent": load.cpu_percent,
                    "behind_s": load.behind_s,
                    "lost_samples": load.lost_samples,
                }
                for load in self.loads
            ],
            "most_tags": self.most_tags,
        }

    def table(self) -> RenderableType:
        """For people: ours, then the thesis's."""
        here = {
            name: [m.cpu_percent[name] for m in self.moments]
            for name in self.moments[0].cpu_percent
        }
        minutes = [m.minute for m in self.moments]
        parts: list[RenderableType] = [
            cpu_table(f"CPU, per cent of a core, {self.tags} tag(s), here", minutes, here),
            histogram("Mean CPU here", here),
            self._memory_table(),
            self._disk_table(),
            f"samples lost: {self.lost_samples:.0f}",
            cpu_table("Thesis, Table 5.2: UDOO X86", thesis.MINUTES, thesis.UDOO_CPU),
            histogram("Thesis, Figure 5.3", thesis.UDOO_CPU),
            cpu_table("Thesis, Table 5.5: Dell T1700", thesis.MINUTES, thesis.DELL_CPU),
            histogram("Thesis, Figure 5.4", thesis.DELL_CPU),
        ]
        if self.loads:
            parts += [self._load_table(), self._verdict()]
        return Group(*parts)

    def _memory_table(self) -> Table:
        table = Table(title="Memory (PSS)")
        for title in ("process", "first MB", "last MB", "growth", ""):
            table.add_column(title, justify="left" if title == "process" else "right")
        first, last = self.moments[0].pss_mb, self.moments[-1].pss_mb
        first, last = (pss | {TOGETHER: ours(pss)} for pss in (first, last))
        for name, growth in self.growth.items():
            table.add_row(
                name,
                f"{first[name]:.1f}",
                f"{last[name]:.1f}",
                f"{100 * growth:+.2f} %",
                "met" if growth < GROWTH_LIMIT else "NOT met",
            )
        return table

    def _disk_table(self) -> Table:
        table = Table(title="Written to disks")
        for title in ("process", "MB/h", "fsync/h", "limit", ""):
            table.add_column(title, justify="left" if title == "process" else "right")
        for name, rate in self.written.mb_h.items():
            syncs = f"{self.written.syncs_h:.0f}" if name == "recorder" else ""
            table.add_row(name, f"{rate:.1f}", syncs, "", "")
        rate = self.written.together_mb_h
        verdict = "met" if rate <= WRITTEN_LIMIT_MB_H else "NOT met"
        limit = f"{WRITTEN_LIMIT_MB_H:.0f}"
        table.add_row(TOGETHER, f"{rate:.1f}", "", limit, verdict)
        return table

    def _load_table(self) -> Table:
        table = Table(title="More and more tags")
        for title in ("tags", "CPU of a core", "behind s", "samples lost", "real time"):
            table.add_column(title, justify="right")
        for load in self.loads:
            table.add_row(
                str(load.tags),
                f"{load.cpu_percent:.0f} %",
                f"{load.behind_s:.1f}",
                f"{load.lost_samples:.0f}",
                "yes" if load.real_time else "no",
            )
        return table

    def _verdict(self) -> str:
        return (
            f"most tags in real time here: {self.most_tags or 'none'}; the thesis extrapolates "
            f"{thesis.EXTRAPOLATED_TAGS} for the UDOO"
        )


def cpu_table(
    title: str, minutes: Sequence[float], rows: Mapping[str, Sequence[float]]
) -> Table:
    """Make a table like the thesis's 5.2 and 5.4 side by side."""
    table = Table(title=title)
    table.add_column("process")
    for minute in minutes:
        table.add_column(f"{minute:g} min", justify="right")
    for name in ("mean", "sd", "median", "min", "max", "range"):
        table.add_column(name, justify="right")
    for name, values in rows.items():
        table.add_row(
            name,
            *(f"{value:.2f}" for value in values),
            *(f"{value:.2f}" for value in summary(values).values()),
        )
    return table


def summary(values: Sequence[float]) -> dict[str, float]:
    """Get the thesis's statistics: mean, standard deviation, median, min, max, range."""
    return {
        "mean": statistics.fmean(values),
        "sd": statistics.stdev(values) if len(values) > 1 else 0.0,
        "median": statistics.median(values),
        "min": min(values),
        "max": max(values),
        "range": max(values) - min(values),
    }


def histogram(title: str, rows: Mapping[str, Sequence[float]]) -> Table:
    """Draw the mean of each process as a bar, as in the thesis's figures 5.3 and 5.4."""
    means = {name: statistics.fmean(values) for name, values in rows.items()}
    most = max(means.values()) or 1.0
    table = Table.grid(padding=(0, 1))
    table.title = title
    for name, mean in means.items():
        table.add_row(name, f"{mean:.2f} %", "█" * max(1, round(50 * mean / most)))
    return table


def ours(values: Mapping[str, float]) -> float:
    """Sum over all processes but the radio's stand-in."""
    return sum(value for name, value in values.items() if name != RADIO)


def by_process(readings: Sequence[Reading], what: str) -> dict[str, float]:
    """Sum a value over the readings of the same name."""
    total: dict[str, float] = {}
    for reading in readings:
        total[reading.process] = total.get(reading.process, 0.0) + getattr(reading, what)
    return total
