"""What a busy moment took of the memory of a process is given back."""

import platform

import pytest
from command_line import python

BUSY_MOMENT = """
import os
from uavrt.core.runtime.heap import TRIM_PERIOD_S, HeapKeeper
from uavrt.drone.supervisor.start.usage import own_usage

kept = 2_000  # bytes; too large for Python's own pools, too small to be mapped by itself
keeper = HeapKeeper(0.0)
before_mb = own_usage(os.getpid()).memory_mb
burst = [bytearray(kept) for _ in range(20_000)]
last = bytearray(kept)  # at the end: without it glibc would give all back by itself
full_mb = own_usage(os.getpid()).memory_mb
burst.clear()
assert keeper.keep(TRIM_PERIOD_S)
print(full_mb - before_mb, full_mb - own_usage(os.getpid()).memory_mb, len(last))
"""


"""In a process of its own: the heap of one that ran many tests has holes for all of this."""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc alone keeps such holes")
def test_holes_in_the_heap_go_back_to_the_system() -> None:
    said = python("-c", BUSY_MOMENT, check=True).stdout
    taken_mb, given_back_mb, _ = map(float, said.split())
    assert taken_mb > 30.0
    assert given_back_mb > 30.0


NEW_OBJECTS = """
from uavrt.core.runtime.heap import fill_pools


def pools_of_new_ones():
    new = [bytes(100) for _ in range(200)]
    return len({id(one) // 16_384 for one in new})


old = [bytes(100) for _ in range(20_000)]
old[::20] = [None] * 1_000  # five places in each pool
scattered = pools_of_new_ones()
filling = fill_pools()
print(scattered, pools_of_new_ones(), len(filling))
"""


"""In a process of its own, too: one that ran many tests has more places than are filled."""


def test_after_a_filling_new_objects_stay_together() -> None:
    said = python("-c", NEW_OBJECTS, check=True).stdout
    scattered, together, filling = map(int, said.split())
    assert scattered > 20
    assert together <= 4
    assert filling > 1_000
