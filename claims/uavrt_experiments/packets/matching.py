"""Two logs of the same flight, pulse by pulse.

The onboard log is a flight directory or the thesis's ``pulse_pose_log.txt``; the ground's is
our ``pulses.jsonl`` or what QGroundControl printed, lines of
``CustomPluginLog: PULSE tag_id:frequency_hz:time:snr:confirmed 2 148 1700205421.74 70.22 1``
(thesis, Figure 5.6: time and SNR to two decimals).
"""

import re
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.core.units import ns_from_s
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight
from uavrt_experiments.result import Row

QGC_LINE = re.compile(
    r"PULSE tag_id:frequency_hz:time:snr:confirmed (\d+) (\d+) (\d+\.\d+) (-?[\d.]+) (\d)"
)
EXACT_NS = 1_000
"""Largest difference of times that are equal [ns]; a double of seconds on the link resolves
0.24 µs."""
ROUNDED_NS = 10_000_000
"""Largest difference of rounded times [ns]: QGroundControl prints hundredths of a second, and
the original's times were rounded once more."""


@dataclass(frozen=True, slots=True, order=True)
class Seen:
    """A pulse, with the fields that both logs have."""

    tag_id: int
    time_ns: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """Comparison of the pulses of two logs."""

    sent: int
    received: int
    missing: tuple[Seen, ...]
    repeated: int
    """Number of pulses received twice."""
    unknown: int
    """Number of received pulses that are not in the onboard log."""

    def result(self, flight: str) -> Row:
        """Row with the missing pulses, compared with the thesis's flights with 10 and 20 ms."""
        return Row.counted(
            "packets",
            "pulses missing on the ground",
            flight,
            len(self.missing),
            self.sent,
            most=0,
            original={"12 ms": 4, "20 ms": 0}.get(flight),
            note=f"twice {self.repeated}, unknown {self.unknown}",
        )


def read_log(path: Path) -> tuple[list[Seen], int]:
    """Read a log of any known kind; returns its pulses and the resolution of its times [ns].

    Raises `FormatError`: the file is of no known kind.
    """
    if path.is_dir():
        return _seen(read_flight(path).pulse_poses), EXACT_NS
    text = _text(path)
    lines = QGC_LINE.findall(text)
    if lines:
        seen = [Seen(int(line[0]), ns_from_s(float(line[2]))) for line in lines]
        return seen, ROUNDED_NS
    if path.suffix in (".jsonl", ".csv"):
        return _seen(read_pulse_file(path)), EXACT_NS
    return _seen(read_pulse_pose_log(path)), EXACT_NS


def match_logs(onboard: Path, ground: Path) -> Match:
    """Compare two logs; raises `FormatError` if one cannot be read."""
    sent, _ = read_log(onboard)
    got, tolerance_ns = read_log(ground)
    waiting: dict[int, list[int]] = defaultdict(list)
    for pulse in sorted(got):
        waiting[pulse.tag_id].append(pulse.time_ns)
    missing: list[Seen] = []
    repeated = 0
    for pulse in sorted(set(sent)):
        times = waiting[pulse.tag_id]
        found = [t for t in times if abs(t - pulse.time_ns) <= tolerance_ns]
        for time_ns in found:
            times.remove(time_ns)
        if not found:
            missing.append(pulse)
        repeated += max(0, len(found) - 1)
    total = len(set(sent))
    return Match(
        sent=total,
        received=total - len(missing),
        missing=tuple(missing),
        repeated=repeated,
        unknown=sum(map(len, waiting.values())),
    )


def _seen(items: Iterable[PulsePose]) -> list[Seen]:
    return [Seen(item.pulse.tag_id, item.pulse.start_time_ns) for item in items]


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8", "replace")
    except OSError as error:
        raise FormatError(
            f"cannot read {path}: {error.strerror}", remedy="Check its path and permissions"
        ) from error
