"""Cost of the borders between processes: the same flight in each shape of the table."""

from dataclasses import asdict, dataclass
from typing import Any

from uavrt_experiments.resources.flight import ShapeFlown
from uavrt_experiments.tables import aligned


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeFlight:
    """One shape's flight."""

    shape: ShapeFlown
    processes: int
    """Number with supervisor, nursery, connection and recorder; without the radio's program."""
    start_s: float
    """Time until all detectors worked."""
    cpu_percent: float
    """Percent of one core, all of them."""
    chain_cpu_percent: float
    """Percent of one core between radio and pulses: the rest is the same in all shapes."""
    pss_mb: float
    latency_p50_ms: float
    """Age of a radio block's last sample when the slowest process had searched it."""
    latency_p99_ms: float
    lost_samples: float
    pulses: float
    """Pulses recorded until the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapesReport:
    """Results of all shapes."""

    tags: int
    seconds: float
    shapes: tuple[ShapeFlight, ...]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def rows(self) -> list[list[str]]:
        """For a table; see `HEADER`."""
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
"""``chain``: the processes between radio and pulses; p50, p99: age of a radio block's last
sample when it had been searched."""
