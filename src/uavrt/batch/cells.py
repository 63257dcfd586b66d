"""Cut recordings into cells on a fixed grid, so that results are the same for any workers.

The detector restarts in each cell. Each cell also reads some seconds of the one before, so that
noise and tracks are settled when its own time begins.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.radio.recording import Segment
from uavrt.radio.times import NominalTimes
from uavrt.units import NANOSECONDS_PER_SECOND

CELL_S = 3600.0
LEAD_IN_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A piece of a recording that is searched by itself; places are samples in the file."""

    number: int
    lead_in: int
    """First sample to read."""
    end: int
    begin_ns: int | None
    """Pulses from this time on count; None: from the recording's first sample."""


def cells_of(
    segments: Sequence[Segment],
    sample_rate_hz: float,
    *,
    cell_s: float = CELL_S,
    lead_in_s: float = LEAD_IN_S,
) -> list[Cell]:
    """Cut a recording.

    `segments`: places of its samples.
    `sample_rate_hz`: of the recording [Hz].
    `cell_s`: distance of the grid's lines, from the recording's first sample on; lost samples
    count as time.
    `lead_in_s`: time before each cell that is read again.
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
    """File place and time of the first sample at or after an index."""
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
