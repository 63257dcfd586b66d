"""The fast fold against plain sums."""

import numpy as np
import pytest

from uavrt.core.runtime import native
from uavrt.localization.whole_flight.energies.folding import (
    base_periods,
    fold,
    fold_rows,
    highest,
    interval_slots,
    slots_added,
)


@pytest.mark.parametrize(("period", "slots"), [(7, 56), (11, 100), (10, 1)])
def test_a_fold_without_drift_is_the_sum_of_whole_periods(period: int, slots: int) -> None:
    values = np.random.default_rng(1).normal(size=(2, slots)).astype(np.float32)
    rows = fold_rows(slots, period)
    padded = np.zeros((2, rows * period), np.float32)
    padded[:, :slots] = values
    plain = padded.reshape(2, rows, period).sum(axis=1)
    assert np.allclose(fold(values, period)[:, 0], plain, atol=1e-5)


@pytest.mark.parametrize("interval", [20.0, 20.31, 20.77])
def test_all_pulses_of_a_train_come_together_in_one_cell(interval: float) -> None:
    count = 32
    slots = 20 * count
    at = 3.5 + interval * np.arange(count)
    at = at[at < slots]
    values = np.zeros((1, slots), np.float32)
    values[0, at.astype(int)] = 1.0
    # Two neighbouring slots, as a window wider than a slot sees them.
    seen = np.maximum(values, np.roll(values, 1, axis=1))
    (sums,) = fold(seen, 20)
    row, _ = np.unravel_index(sums.argmax(), sums.shape)
    assert sums.max() >= len(at) - 2
    assert interval_slots(20, len(sums))[row] == pytest.approx(interval, abs=1.5 / count)


def test_base_periods_hold_all_intervals() -> None:
    periods = base_periods(1.194, 1.314, 0.01)
    assert periods.start * 0.01 <= 1.194
    assert periods.stop * 0.01 >= 1.314


SHAPES = [(7, 100, 3), (125, 21_000, 2), (131, 5000, 5), (1, 5, 2), (64, 64, 1)]


@pytest.mark.usefixtures("processor")
@pytest.mark.parametrize(("period", "slots", "many"), SHAPES)
def test_kernels_and_numpy_add_up_the_same(period: int, slots: int, many: int) -> None:
    rng = np.random.default_rng(period)
    values = rng.normal(size=(many, slots)).astype(np.float32)
    rows = fold_rows(slots, period)
    first, end = rows // 3, rows // 3 + max(1, rows // 5)
    whole, part = fold(values, period), fold(values, period, first, end)
    mixing = rng.normal(size=(7, many)).astype(np.float32)
    scale = rng.uniform(0.9, 1.1, rows).astype(np.float32)
    score, cell = highest(whole, mixing, scale)
    with native.numpy_only():
        assert np.array_equal(whole, fold(values, period))
        assert np.array_equal(part, fold(values, period, first, end))
        wanted, wanted_cell = highest(whole, mixing, scale)
    assert np.array_equal(part, whole[:, first:end])
    assert np.allclose(score, wanted, rtol=1e-5)
    assert np.array_equal(cell, wanted_cell)


@pytest.mark.parametrize(("period", "slots", "many"), SHAPES)
def test_the_slots_of_a_cell_are_those_that_it_adds_up(
    period: int, slots: int, many: int
) -> None:
    rng = np.random.default_rng(period)
    values = rng.normal(size=(many, slots)).astype(np.float32)
    sums = fold(values, period)
    for _ in range(20):
        row, phase = int(rng.integers(sums.shape[1])), int(rng.integers(period))
        added = values[:, slots_added(slots, period, row, phase)].sum(axis=1)
        assert np.allclose(added, sums[:, row, phase], atol=1e-4)


@pytest.mark.skipif(native.kernels() is None, reason=native.description())
def test_the_kernels_refuse_sums_that_do_not_fit() -> None:
    kernels = native.kernels()
    values, out = np.zeros((2, 30), np.float32), np.zeros((2, 4, 10), np.float32)
    kernels.train_sums(values, 2, 30, 10, 2, 0, 4, out)
    for wrong in [(2, 30, 10, 1, 0, 2), (2, 30, 10, 2, 1, 4), (2, 30, 0, 2, 0, 4)]:
        with pytest.raises(ValueError, match="train_sums"):
            kernels.train_sums(values, *wrong, out)
    with pytest.raises(ValueError, match="values"):
        kernels.train_sums(values, 3, 30, 10, 2, 0, 4, out)
    with pytest.raises(ValueError, match="out"):
        kernels.train_sums(values, 2, 30, 10, 2, 0, 4, out[:1])
    best, cell, scale = np.zeros(3, np.float32), np.zeros(3, np.int32), np.ones(4, np.float32)
    mixing = np.ones((3, 2), np.float32)
    kernels.train_peaks(out, 2, 4, 10, scale, mixing, best, cell)
    with pytest.raises(ValueError, match="mixing"):
        kernels.train_peaks(out, 2, 4, 10, scale, mixing[:2], best, cell)
    with pytest.raises(ValueError, match="cell"):
        kernels.train_peaks(out, 2, 4, 10, scale, mixing, best, cell[:2])
    with pytest.raises(ValueError, match="train_peaks"):
        kernels.train_peaks(out, 0, 4, 10, scale, mixing, best, cell)
