"""How far a test goes: a share of its seeds and cases in `make test`, all in `make claims`."""

import os
from collections.abc import Sequence
from typing import TypeVar

Case = TypeVar("Case")

ALL = "UAVRT_ALL_SEEDS" in os.environ
"""`make claims` sets it."""


def count(few: int, every: int) -> int:
    """Get how many trials a test makes."""
    return every if ALL else few


def seeds(few: int, every: int) -> range:
    """Get the seeds of a test."""
    return range(count(few, every))


def share(cases: Sequence[Case], one_of: int) -> list[Case]:
    """Get every n-th case, the first among them."""
    return list(cases if ALL else cases[::one_of])
