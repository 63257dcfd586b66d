"""The fast fold against plain sums."""

import numpy as np
import pytest

from uavrt.integration import base_periods, fold, fold_rows, interval_slots


@pytest.mark.parametrize(("period", "slots"), [(7, 56), (11, 100), (10, 1)])
def test_a_fold_without_drift_is_the_sum_of_whole_periods(period: int, slots: int) -> None:
    values = np.random.default_rng(1).normal(size=(slots, 2)).astype(np.float32)
    rows = fold_rows(slots, period)
    padded = np.zeros((rows * period, 2), np.float32)
    padded[:slots] = values
    plain = padded.reshape(rows, period, 2).sum(axis=0)
    assert np.allclose(fold(values, period)[0], plain, atol=1e-5)


@pytest.mark.parametrize("interval", [20.0, 20.31, 20.77])
def test_all_pulses_of_a_train_come_together_in_one_cell(interval: float) -> None:
    count = 32
    slots = 20 * count
    at = 3.5 + interval * np.arange(count)
    at = at[at < slots]
    values = np.zeros((slots, 1), np.float32)
    values[at.astype(int)] = 1.0
    # Two neighbouring slots, as a window wider than a slot sees them.
    seen = np.maximum(values, np.roll(values, 1, axis=0))
    sums = fold(seen, 20)[..., 0]
    row, _ = np.unravel_index(sums.argmax(), sums.shape)
    assert sums.max() >= len(at) - 2
    assert interval_slots(20, len(sums))[row] == pytest.approx(interval, abs=1.5 / count)


def test_base_periods_hold_all_intervals() -> None:
    periods = base_periods(1.194, 1.314, 0.01)
    assert periods.start * 0.01 <= 1.194
    assert periods.stop * 0.01 >= 1.314
