"""Results of the recovery experiment."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from uavrt_experiments.result import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Kill:
    """One process that was killed or stopped, and the time until the system recovered."""

    process: str
    """Name of the process; ``"power"`` for all at once."""
    how: str
    """Signal sent: ``"SIGKILL"``, ``"SIGSTOP"``, or ``"6 SIGKILL"`` for a burst."""
    resumed_s: float
    limit_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryReport:
    """Results of the whole recovery experiment."""

    seed: int
    kills: tuple[Kill, ...]
    pulses_recorded: int
    """Number of pulses confirmed to be on disk before one of the kills."""
    pulses_detected: int
    """Number of pulses that a detector reported to the supervisor."""
    pulses_promised: int
    """Number of pulses that may not be lost: those detected and recorded, less those not yet
    confirmed on disk when everything was killed at once."""
    without_pose: int
    """Number of pulses recorded without a pose."""
    lost_from_database: int
    """Number of promised pulses missing in the flight's database."""
    lost_from_log: int
    lost_on_ground: int
    orphans: int
    """Number of processes that outlived a killed supervisor by more than a second."""
    flights: int
    """Number of flight directories; there must be one, whatever the interruptions."""
    faults: tuple[str, ...] = field(default=())
    """Sentences about failed recoveries."""

    @property
    def ok(self) -> bool:
        """True if everything recovered in time and nothing was lost."""
        return not self.faults and all(row.met for row in self.rows())

    def rows(self) -> list[Row]:
        """Table rows of the figures with their requirements."""
        found = []
        for (name, how), kills in self.groups().items():
            times = _summary([kill.resumed_s for kill in kills])
            found.append(
                Row.counted(
                    "recovery",
                    "resumed at the latest after, s",
                    f"{name}, {how}",
                    max(kill.resumed_s for kill in kills),
                    len(kills),
                    most=kills[0].limit_s,
                    note=f"min {times['min']:.2f}, median {times['median']:.2f}",
                )
            )
        lost = (
            ("flight.sqlite", self.lost_from_database),
            ("the log", self.lost_from_log),
            ("the ground", self.lost_on_ground),
        )
        promised = f"{self.pulses_detected} detected, {self.without_pose} without a pose"
        found += [
            Row.counted(
                *("recovery", "promised pulses that are missing", where, count),
                self.pulses_promised,
                most=0,
                note=promised,
            )
            for where, count in lost
        ]
        note = f"{self.flights} flight(s)"
        orphans = ("recovery", "left behind by a killed supervisor", "processes", self.orphans)
        return [*found, Row.counted(*orphans, most=0, note=note)]

    def groups(self) -> dict[tuple[str, str], list[Kill]]:
        """Kills grouped by kind; all detectors are one group."""
        groups: dict[tuple[str, str], list[Kill]] = {}
        for kill in self.kills:
            name = kill.process.partition("-")[0]
            groups.setdefault((name, kill.how), []).append(kill)
        return groups

    def as_dict(self) -> dict[str, Any]:
        """Get the report as a dictionary for JSON."""
        return {
            "seed": self.seed,
            "kills": len(self.kills),
            "resumed_s": {
                f"{name} {how}": _summary([kill.resumed_s for kill in kills])
                | {"limit_s": kills[0].limit_s, "count": len(kills)}
                for (name, how), kills in self.groups().items()
            },
            "pulses_recorded": self.pulses_recorded,
            "pulses_detected": self.pulses_detected,
            "pulses_promised": self.pulses_promised,
            "without_pose": self.without_pose,
            "lost_from_database": self.lost_from_database,
            "lost_from_log": self.lost_from_log,
            "lost_on_ground": self.lost_on_ground,
            "orphans": self.orphans,
            "flights": self.flights,
            "faults": list(self.faults),
            "ok": self.ok,
        }


def _summary(values: Sequence[float]) -> dict[str, float]:
    return {
        "min": round(min(values), 3),
        "median": round(statistics.median(values), 3),
        "max": round(max(values), 3),
    }
