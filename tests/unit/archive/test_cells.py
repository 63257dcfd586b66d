from hypothesis import given
from hypothesis import strategies as st

from uavrt.analysis.archive.steps.recording_cells import cells_of
from uavrt.radio.files.recording_source import Segment

RATE_HZ = 100.0


@st.composite
def segments(draw: st.DrawFn) -> list[Segment]:
    made, first, index = [], 0, draw(st.integers(0, 500))
    for _ in range(draw(st.integers(1, 5))):
        count, lost = draw(st.integers(0, 3000)), draw(st.integers(0, 3000))
        index += lost
        made.append(
            Segment(
                first=first,
                count=count,
                sample_index=index,
                time_ns=index * 10_000_000,
                lost_before=lost,
            )
        )
        first, index = first + count, index + count
    return made


@given(segments(), st.integers(1, 20), st.integers(0, 30))
def test_cells_hold_each_sample_once_beside_what_they_read_before(
    segments: list[Segment], cell_s: int, lead_in_s: int
) -> None:
    cells = cells_of(segments, RATE_HZ, cell_s=cell_s, lead_in_s=lead_in_s)
    total = sum(one.count for one in segments)
    assert bool(cells) == bool(total)
    end = 0
    for cell in cells:
        assert cell.lead_in <= end < cell.end
        # No more is read before than was asked for.
        assert end - cell.lead_in <= lead_in_s * RATE_HZ
        end = cell.end
    assert end == total


def test_the_grid_is_of_the_recordings_own_time_with_what_was_lost() -> None:
    held = [
        Segment(first=0, count=1000, sample_index=0, time_ns=0),
        Segment(
            first=1000, count=1000, sample_index=1500, time_ns=15_000_000_000, lost_before=500
        ),
    ]
    cells = cells_of(held, RATE_HZ, cell_s=12.0, lead_in_s=3.0)
    assert [(one.lead_in, one.end) for one in cells] == [(0, 1000), (900, 1900), (1600, 2000)]
    assert [one.begin_ns for one in cells] == [None, 15_000_000_000, 24_000_000_000]
