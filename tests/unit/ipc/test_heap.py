"""What a busy moment took of the memory is given back within a minute."""

import os
import platform

import pytest

from uavrt.ipc.heap import TRIM_PERIOD_S, HeapKeeper
from uavrt.supervisor.usage import own_usage

KEPT = 2_000
"""Bytes; too large for Python's own pools, too small to be mapped each by itself."""


def resident_mb() -> float:
    return own_usage(os.getpid()).memory_mb


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc alone keeps such holes")
def test_holes_in_the_heap_go_back_to_the_system() -> None:
    keeper = HeapKeeper(0.0)
    before_mb = resident_mb()
    burst = [bytearray(KEPT) for _ in range(20_000)]
    last = bytearray(KEPT)  # at the end: without it glibc would give all back by itself
    full_mb = resident_mb()
    assert full_mb - before_mb > 30.0
    burst.clear()
    assert keeper.keep(TRIM_PERIOD_S)
    assert resident_mb() < full_mb - 30.0
    assert len(last) == KEPT


def test_it_is_done_once_a_minute() -> None:
    keeper = HeapKeeper(5.0)
    done = [second for second in range(200) if keeper.keep(float(second))]
    assert done == [65, 125, 185]
