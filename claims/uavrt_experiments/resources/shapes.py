"""Cost of boundaries between processes: the same flight in each shape of the process table."""

from dataclasses import asdict, dataclass
from typing import Any

from uavrt_experiments.resources.flight import ShapeFlown
from uavrt_experiments.tables import aligned


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeFlight:
    """Measurement of a flight in one shape."""

    shape: ShapeFlown
    processes: int
    """Number of processes with supervisor, nursery, connection and recorder, without the
    radio's program."""
    start_s: float
    """Time until all detectors worked [s]."""
    cpu_percent: float
    """CPU use of all processes [% of one core]."""
    chain_cpu_percent: float
    """CPU use of the processes between radio and pulses [% of one core]; the rest is the same
    in all shapes."""
    pss_mb: float
    latency_p50_ms: float
    """Median age of a radio block's last sample when the slowest process had
    searched it [ms]."""
    latency_p99_ms: float
    lost_samples: float
    pulses: float
    """Number of pulses recorded until the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapesReport:
    """Results of all shapes."""

    tags: int
    seconds: float
    shapes: tuple[ShapeFlight, ...]

    def as_dict(self) -> dict[str, Any]:
        """Get the report as a dictionary for JSON."""
        return asdict(self)

    def rows(self) -> list[list[str]]:
        """Table rows for the columns of `HEADER`."""
        return [
            [
                one.shape,
                str(one.processes),
                f"{one.cpu_percent:.1f}",
                f"{one.chain_cpu_percent:.1f}",
                f"{one.pss_mb:.0f}",
                f"{one.latency_p50_ms:.0f}",
                f"{one.latency_p99_ms:.0f}",
                f"{one.start_s:.2f}",
                f"{one.lost_samples:.0f}",
            ]
            for one in self.shapes
        ]

    def table(self) -> str:
        """Table for a terminal."""
        text = aligned([HEADER, *self.rows()], numbers_from=1)
        return f"{self.tags} tags, {self.seconds:g} s in each shape\n{text}"


HEADER = (
    "shape",
    "processes",
    "CPU %",
    "chain %",
    "PSS MB",
    "p50 ms",
    "p99 ms",
    "start s",
    "lost",
)
"""Column headings. ``chain %``: CPU of the processes between radio and pulses; p50, p99: age of
a radio block's last sample when it had been searched."""
