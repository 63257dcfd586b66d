"""Summarise a demo: pulses sent, detected, recorded on the drone and received on the ground.

A true pulse counts as detected if the drone recorded a pulse of its tag within `MATCH_TIME_S`
and `MATCH_FREQUENCY_HZ`. It counts as delivered if the ground station received this recorded
pulse. For a coded tag, a burst counts as a pulse.
"""

import bisect
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rich.table import Table

from uavrt.core.messages import Pulse, Tag
from uavrt.core.terminal_tables import table_of
from uavrt.core.units import db_from_power, ns_from_s, power_from_db
from uavrt.simulation.scene.world import TruePulse

DETECTABLE_ENR_DB = 14.0
MATCH_TIME_S = 0.02
"""Largest time error of a detected pulse [s]: a pulse width, ten times the usual error."""
MATCH_FREQUENCY_HZ = 100.0
_ROUNDED_NS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class TagSummary:
    """Numbers and errors of one tag's pulses during detection."""

    transmitted: int
    detectable: int
    """Number of sent pulses with a true energy over noise density (ENR) of 14 dB or more."""
    detected: int
    """Number of pulses found and recorded on the drone."""
    delivered: int
    """Number of detected pulses that the ground station received."""
    detectable_detected: int
    """Number of detectable pulses that were detected."""
    detectable_delivered: int
    false: int
    """Number of recorded pulses that match no true one."""
    snr_error_db: float | None
    """Mean of reported minus true SNR, over the detectable pulses [dB]."""
    frequency_error_hz: float | None
    """Rms error of the reported frequency, over the detectable pulses [Hz]."""
    time_error_ms: float | None
    """Rms error of the reported start time, over the detectable pulses [ms]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoSummary:
    """Result of ``uavrt demo``, printed as the last line with ``--json``."""

    tags: dict[str, TagSummary]
    samples_lost: int
    cpu_seconds: dict[str, float]
    duration_s: float
    flight_directory: str

    def table(self) -> Table:
        """Create a table of the results for a terminal."""
        table = table_of(
            *("tag", "sent", "found", "14 dB or more", "of them found", "on the ground"),
            *("false", "SNR bias", "freq. rms", "time rms"),
            title="What became of every pulse",
            header_style="dim",
        )
        for tag_id, tag in self.tags.items():
            table.add_row(
                tag_id,
                str(tag.transmitted),
                str(tag.detected),
                str(tag.detectable),
                str(tag.detectable_detected),
                str(tag.delivered),
                str(tag.false),
                _with_unit(tag.snr_error_db, "dB"),
                _with_unit(tag.frequency_error_hz, "Hz"),
                _with_unit(tag.time_error_ms, "ms"),
            )
        return table


def summarize_tag(
    tag: Tag,
    truth: Iterable[TruePulse],
    recorded: Sequence[Pulse],
    received_times_ns: Sequence[int],
) -> TagSummary:
    """Compare the recorded and received pulses of one tag with the true pulses of all tags."""
    sent = [pulse for pulse in truth if pulse.tag_id == tag.tag_id]
    if tag.coded:
        sent = true_bursts(sent, 1 + len(tag.gaps_s))
    found = sorted(
        (pulse for pulse in recorded if pulse.tag_id == tag.tag_id),
        key=lambda pulse: pulse.start_time_ns,
    )
    matches = match(sent, found)
    received = sorted(received_times_ns)
    delivered = {id(pulse) for pulse in found if _is_in(received, pulse.start_time_ns)}
    clear = [(true, pulse) for true, pulse in matches if true.enr_db >= DETECTABLE_ENR_DB]
    return TagSummary(
        transmitted=len(sent),
        detectable=sum(true.enr_db >= DETECTABLE_ENR_DB for true in sent),
        detected=len(matches),
        delivered=sum(id(pulse) in delivered for _, pulse in matches),
        detectable_detected=len(clear),
        detectable_delivered=sum(id(pulse) in delivered for _, pulse in clear),
        false=len(found) - len(matches),
        snr_error_db=_mean([pulse.snr_db - true.enr_db for true, pulse in clear]),
        frequency_error_hz=_rms(
            [pulse.frequency_hz - true.frequency_hz for true, pulse in clear]
        ),
        time_error_ms=_rms(
            [(pulse.start_time_ns - true.start_time_ns) / 1e6 for true, pulse in clear]
        ),
    )


def sampled_span(first_ns: int, last_ns: int, recorded: Iterable[Pulse]) -> tuple[int, int]:
    """First and last time of a flight's samples [ns, UTC], extended to include all pulses."""
    limit_ns = ns_from_s(MATCH_TIME_S)
    times = [pulse.start_time_ns for pulse in recorded]
    return (
        min([first_ns, *(time_ns - limit_ns for time_ns in times)]),
        max([last_ns, *(time_ns + limit_ns for time_ns in times)]),
    )


def true_bursts(sent: Sequence[TruePulse], pulses: int) -> list[TruePulse]:
    """Combine the pulses of each complete burst into one pulse of their mean strength."""
    bursts: dict[int, list[TruePulse]] = {}
    for pulse in sent:
        bursts.setdefault(pulse.pulse_index // pulses, []).append(pulse)
    return [
        replace(
            burst[0],
            end_time_ns=burst[-1].end_time_ns,
            enr_db=db_from_power(sum(power_from_db(one.enr_db) for one in burst) / pulses),
        )
        for burst in bursts.values()
        if len(burst) == pulses
    ]


def match(sent: Sequence[TruePulse], found: Sequence[Pulse]) -> list[tuple[TruePulse, Pulse]]:
    """Pair each true pulse with the nearest detected pulse that is free, in time order."""
    times = [pulse.start_time_ns for pulse in found]
    limit_ns = ns_from_s(MATCH_TIME_S)
    taken: set[int] = set()
    pairs: list[tuple[TruePulse, Pulse]] = []
    for true in sent:
        first = bisect.bisect_left(times, true.start_time_ns - limit_ns)
        last = bisect.bisect_right(times, true.start_time_ns + limit_ns)
        near = [
            index
            for index in range(first, last)
            if index not in taken
            and abs(found[index].frequency_hz - true.frequency_hz) <= MATCH_FREQUENCY_HZ
        ]
        if near:
            best = min(near, key=lambda index: abs(times[index] - true.start_time_ns))
            taken.add(best)
            pairs.append((true, found[best]))
    return pairs


def _is_in(times_ns: Sequence[int], time_ns: int) -> bool:
    """True if a sorted list contains a time; times from the link are rounded."""
    place = bisect.bisect_left(times_ns, time_ns - _ROUNDED_NS)
    return place < len(times_ns) and times_ns[place] <= time_ns + _ROUNDED_NS


def _with_unit(value: float | None, unit: str) -> str:
    return "–" if value is None else f"{value:.2f} {unit}"


def _mean(values: Sequence[float]) -> float | None:
    return round(sum(values) / len(values), 3) if values else None


def _rms(values: Sequence[float]) -> float | None:
    if not values:
        return None
    return round(math.sqrt(sum(value**2 for value in values) / len(values)), 3)
