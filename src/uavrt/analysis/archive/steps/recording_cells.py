"""Divide recordings into cells of equal duration, so that results do not depend on the number
of workers.

The detector restarts in each cell. It also reads a lead-in before the cell, two minutes by
default, so that noise estimates and tracks have settled when the cell begins.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.radio.files.recording_source import Segment
from uavrt.radio.timing.sample_times import NominalTimes

CELL_S = 3600.0
LEAD_IN_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """Part of a recording that is searched separately: a range of the file's samples."""

    number: int
    lead_in: int
    """Index in the file of the first sample to read; pulses count only from `begin_ns`."""
    end: int
    begin_ns: int | None
    """Time from which pulses count [ns]; None for the recording's first sample."""


def cells_of(
    segments: Sequence[Segment],
    sample_rate_hz: float,
    *,
    cell_s: float = CELL_S,
    lead_in_s: float = LEAD_IN_S,
) -> list[Cell]:
    """Divide a recording into cells, each with a lead-in before it.

    Cells are counted from the first sample of `segments`; lost samples count as time.
    """
    held = [one for one in segments if one.count]
    if not held:
        return []
    length = round(cell_s * sample_rate_hz)
    lead = round(lead_in_s * sample_rate_hz)
    first = held[0].sample_index
    last = held[-1].sample_index + held[-1].count
    cells = []
    for number in range(math.ceil((last - first) / length)):
        from_index = first + number * length
        begin, begin_ns = _place(held, sample_rate_hz, from_index)
        end, _ = _place(held, sample_rate_hz, min(from_index + length, last))
        if end > begin:
            lead_in, _ = _place(held, sample_rate_hz, max(first, from_index - lead))
            cells.append(
                Cell(
                    number=number,
                    lead_in=lead_in,
                    end=end,
                    begin_ns=begin_ns if number else None,
                )
            )
    return cells


def _place(held: Sequence[Segment], sample_rate_hz: float, index: int) -> tuple[int, int]:
    """Position in the file and time of the first existing sample at or after an index."""
    done = 0
    for segment in held:
        if index < segment.sample_index + segment.count:
            within = max(0, index - segment.sample_index)
            time_ns = NominalTimes(segment.time_ns, sample_rate_hz).time_ns(within)
            return done + within, time_ns
        done += segment.count
    last = held[-1]
    end_ns = last.time_ns + round(last.count / sample_rate_hz * NANOSECONDS_PER_SECOND)
    return done, end_ns
