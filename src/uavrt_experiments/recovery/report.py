"""Results of the experiment."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from uavrt_experiments.result import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Kill:
    """One process ended or stopped, and the recovery time of the system."""

    process: str
    """``"power"`` for everything at once."""
    how: str
    """``"SIGKILL"``, ``"SIGSTOP"``, or ``"6 SIGKILL"`` for a burst."""
    resumed_s: float
    limit_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoveryReport:
    """Results of the whole experiment."""

    seed: int
    kills: tuple[Kill, ...]
    pulses_recorded: int
    """Pulses confirmed to be on disk, all before one kill or another."""
    pulses_detected: int
    """Pulses reported to the supervisor by a detector."""
    pulses_promised: int
    """Those and the recorded ones, less those not yet confirmed on disk when everything was
    killed at once: none of them may be lost."""
    without_pose: int
    """Pulses recorded without a pose."""
    lost_from_database: int
    """Of those promised, as in the two below."""
    lost_from_log: int
    lost_on_ground: int
    orphans: int
    """Processes that outlived a killed supervisor by more than a second."""
    flights: int
    """Number of flight directories: one for any number of interruptions."""
    faults: tuple[str, ...] = field(default=())
    """Sentences on what did not recover."""

    @property
    def ok(self) -> bool:
        """True if everything recovered in time and nothing was lost."""
        return not self.faults and all(row.met for row in self.rows())

    def rows(self) -> list[Row]:
        """Figures with their bars."""
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
        """Kills grouped by kind, detectors as one."""
        groups: dict[tuple[str, str], list[Kill]] = {}
        for kill in self.kills:
            name = kill.process.partition("-")[0]
            groups.setdefault((name, kill.how), []).append(kill)
        return groups

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
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
