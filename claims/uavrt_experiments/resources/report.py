"""Results of the resources experiment, in the form of the thesis's tables."""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from uavrt_experiments.resources import thesis
from uavrt_experiments.resources.flight import Reading
from uavrt_experiments.result import Row
from uavrt_experiments.tables import aligned, drawn

GROWTH_LIMIT = 0.01
WRITTEN_LIMIT_MB_H = 40.0
"""Limit of disk writes of all processes in an ordinary flight [MB/h], for the life of a memory
card."""
SAMPLES_LIMIT_MB_H = 54.0
"""Limit of disk writes for a tag's kept channel [MB/h]: 7500 samples a second of 2 bytes."""
BEHIND_LIMIT_S = 2.0
RADIO = "radio (stand-in)"
TOGETHER = "all but the radio"
KEEPER = "receiver"
"""Name of the process that records the tags' channels, which have a separate limit."""
NO_SAMPLES = "all but kept samples"


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """Measurement of all processes over one stretch."""

    minute: float
    """End of the stretch since the start of detection [min]."""
    cpu_percent: dict[str, float]
    """CPU use over the stretch [% of one core], by process."""
    pss_mb: dict[str, float]
    """Mean memory over the last 40 s of the stretch [MB], by process."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """Disk writes of a flight since the start of detection."""

    mb_h: dict[str, float]
    syncs_h: float
    """Calls of fsync per hour by the recorder; other processes make none."""

    @property
    def together_mb_h(self) -> float:
        """Disk writes of all processes except the radio's stand-in, without the kept samples
        [MB/h].
        """
        return ours(self.mb_h) - self.mb_h.get(KEEPER, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """One step of the search for the largest number of tags."""

    tags: int
    cpu_percent: float
    """CPU use of all processes except the radio's stand-in [% of one core]."""
    behind_s: float
    """Age of the slowest detector's newest sample at the end [s]."""
    lost_samples: float

    def rows(self) -> list[Row]:
        """Rows with the figures of real-time operation and their requirements."""
        case = f"{self.tags} tags"
        return [
            Row.counted(
                *("resources", "behind the radio, s", case, self.behind_s),
                most=BEHIND_LIMIT_S,
                note=f"{self.cpu_percent:.0f} % of a core",
            ),
            Row.counted("resources", "samples lost", case, self.lost_samples, most=0),
        ]

    @property
    def real_time(self) -> bool:
        """True if the system processed everything in real time."""
        return all(row.met for row in self.rows())


@dataclass(frozen=True, slots=True, kw_only=True)
class ResourceReport:
    """Results of the whole resources experiment."""

    tags: int
    moments: tuple[Moment, ...]
    written: Written
    lost_samples: float
    loads: tuple[Load, ...] = field(default=())

    @property
    def growth(self) -> dict[str, float]:
        """Relative growth of each process's memory between the first moment and the last.

        Forked processes share pages until one of them writes, so growth of a single process
        need not be a leak. The sum of all, without the radio's stand-in, shows leaks.
        """
        first, last = self.moments[0].pss_mb, self.moments[-1].pss_mb
        growth = {name: last[name] / first[name] - 1.0 for name in last if first.get(name)}
        return growth | {TOGETHER: ours(last) / ours(first) - 1.0}

    @property
    def most_tags(self) -> int | None:
        """Largest number of tags searched in real time."""
        return max((load.tags for load in self.loads if load.real_time), default=None)

    def as_dict(self) -> dict[str, Any]:
        """Get the report as a dictionary for JSON."""
        return {
            "tags": self.tags,
            "moments": [
                {"minute": m.minute, "cpu_percent": m.cpu_percent, "pss_mb": m.pss_mb}
                for m in self.moments
            ],
            "written_mb_h": self.written.mb_h | {NO_SAMPLES: self.written.together_mb_h},
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

    def rows(self) -> list[Row]:
        """Rows with requirements: memory growth, disk writes, tags in real time."""
        first, last = self.moments[0].pss_mb, self.moments[-1].pss_mb
        first, last = (pss | {TOGETHER: ours(pss)} for pss in (first, last))
        found = [
            Row.counted(
                *("resources", "growth of memory (PSS), %", name, 100.0 * growth),
                most=100.0 * GROWTH_LIMIT,
                note=f"{first[name]:.1f} to {last[name]:.1f} MB",
            )
            for name, growth in self.growth.items()
        ]
        written = self.written.mb_h | {NO_SAMPLES: self.written.together_mb_h}
        # The steady tags have a channel each.
        limits = {NO_SAMPLES: WRITTEN_LIMIT_MB_H, KEEPER: self.tags * SAMPLES_LIMIT_MB_H}
        found += [
            Row.counted(
                *("resources", "written to disks, MB/h", name, rate),
                most=limits.get(name),
                note=f"{self.written.syncs_h:.0f} fsync/h" if name == "recorder" else "",
            )
            for name, rate in written.items()
        ]
        found.append(Row.counted("resources", "samples lost", "all", self.lost_samples))
        return found + [row for load in self.loads for row in load.rows()]

    def table(self) -> str:
        """Table for a terminal: our figures, then the thesis's."""
        here = {
            name: [m.cpu_percent[name] for m in self.moments]
            for name in self.moments[0].cpu_percent
        }
        minutes = [m.minute for m in self.moments]
        parts = [
            cpu_table(f"CPU, per cent of a core, {self.tags} tags, here", minutes, here),
            drawn(self.rows()),
            cpu_table("Thesis, Table 5.2: UDOO X86", thesis.MINUTES, thesis.UDOO_CPU),
            cpu_table("Thesis, Table 5.5: Dell T1700", thesis.MINUTES, thesis.DELL_CPU),
        ]
        if self.loads:
            parts.append(
                f"most tags in real time here: {self.most_tags or 'none'}; the thesis "
                f"extrapolates {thesis.EXTRAPOLATED_TAGS} for the UDOO"
            )
        return "\n\n".join(parts)


def cpu_table(title: str, minutes: Sequence[float], rows: Mapping[str, Sequence[float]]) -> str:
    """Table like the thesis's 5.2 and 5.4 side by side, with its figures as requirements."""
    means = {name: statistics.fmean(values) for name, values in rows.items()}
    most = max(means.values()) or 1.0
    statistic_names = ("mean", "sd", "median", "min", "max", "range")
    lines = [["process", *(f"{minute:g} min" for minute in minutes), *statistic_names]]
    lines += [
        [name, *(f"{value:.2f}" for value in (*values, *summary(values).values()))]
        for name, values in rows.items()
    ]
    text = aligned(lines, numbers_from=1).splitlines()
    bars = ["", *("█" * max(1, round(20 * mean / most)) for mean in means.values())]
    return "\n".join((title, *(f"{a}  {b}".rstrip() for a, b in zip(text, bars, strict=True))))


def summary(values: Sequence[float]) -> dict[str, float]:
    """The thesis's statistics: mean, standard deviation, median, min, max, range."""
    return {
        "mean": statistics.fmean(values),
        "sd": statistics.stdev(values) if len(values) > 1 else 0.0,
        "median": statistics.median(values),
        "min": min(values),
        "max": max(values),
        "range": max(values) - min(values),
    }


def ours(values: Mapping[str, float]) -> float:
    """Sum of a value over all processes except the radio's stand-in."""
    return sum(value for name, value in values.items() if name != RADIO)


def by_process(readings: Sequence[Reading], what: str) -> dict[str, float]:
    """Sum of a value over the readings with the same process name."""
    total: dict[str, float] = {}
    for reading in readings:
        total[reading.process] = total.get(reading.process, 0.0) + getattr(reading, what)
    return total
