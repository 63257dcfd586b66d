"""Rows of records of arrays."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows, joined_rows


@dataclass(frozen=True, slots=True)
class Levels:
    time_s: NDArray[np.float64]
    place_m: NDArray[np.float64]
    noise_db: NDArray[np.float64] | None
    name: str


LEVELS = Levels(np.arange(4.0), np.arange(8.0).reshape(4, 2), None, "otter")


@pytest.mark.parametrize("which", [slice(1, 3), [1, 2], np.array([False, True, True, False])])
def test_chosen_rows_are_those_of_all_arrays(which: object) -> None:
    some = chosen_rows(LEVELS, which)
    assert some.time_s.tolist() == [1.0, 2.0]
    assert some.place_m.tolist() == [[2.0, 3.0], [4.0, 5.0]]
    assert (some.noise_db, some.name) == (None, "otter")


def test_joined_rows_stand_one_after_the_other() -> None:
    both = joined_rows([LEVELS, replace(chosen_rows(LEVELS, [0]), name="marten")])
    assert both.time_s.tolist() == [0.0, 1.0, 2.0, 3.0, 0.0]
    assert both.place_m.shape == (5, 2)
    assert both.name == "otter"
