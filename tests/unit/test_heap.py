"""What a busy moment took of the memory is given back within a minute."""

import sys

from uavrt.core.runtime.heap import HeapKeeper


def test_it_is_done_once_in_a_period() -> None:
    keeper = HeapKeeper(5.0, period_s=60.0)
    done = [second for second in range(200) if keeper.keep(float(second))]
    assert done == [65, 125, 185]


def test_tuples_that_python_keeps_for_later_are_freed() -> None:
    kept = [tuple(number for number in range(5)) for _ in range(3_000)]
    kept.clear()
    before = sys.getallocatedblocks()
    HeapKeeper(0.0).keep(60.0)
    assert before - sys.getallocatedblocks() > 1_500
