"""Follow sudden changes of the noise level, as from throttle or a transmitter nearby.

A rise common to many rows is detected within a tenth of a second. Cells are divided by the
level before any sum, so that pulses in weak and in strong noise get their proper weight.

Levels are estimated in slots of half a pulse and in bands of one frequency bin. A level is a
mean over the longest stretch of slots that agrees with all shorter ones (the intersection of
confidence intervals: Goldenshluger and Nemirovski, Mathematical Methods of Statistics 6, 1997),
backward and forward separately. Where they disagree there is a step, and the higher one is
used.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.native import kernels
from uavrt.detection.search.grid import HOPS_PER_PULSE, ROWS_PER_BIN
from uavrt.detection.search.tuning import LEVEL

SLOT = HOPS_PER_PULSE // 2
"""Number of spectrogram columns in a slot; a slot is the time step of the noise level."""
_MEAN = 1.0 - math.exp(-LEVEL.most_power)
"""Mean power of noise cells after each is limited to `LEVEL.most_power`; without the limit it
is 1."""


@dataclass(slots=True)
class _Stretch:
    """Noise levels of consecutive spectrogram columns."""

    first: int
    common: NDArray[np.float32]
    bands: NDArray[np.float32] | None
    """(bands, slots) ratio of each band's noise level to the common level; None if all are
    equal."""


@dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """Noise levels that change with time: one divides cells, one is for measuring pulses."""

    divisor: NDArray[np.float32]
    """(new slots,) common noise level that divides cells, raised by its possible error."""
    bands: NDArray[np.float32] | None
    """(bands, new slots) ratio of each band's noise level to `divisor`; None if all are
    equal."""
    measured: NDArray[np.float32]
    """(slots,) noise level common to all bands, used to measure the power of pulses."""
    measured_bands: NDArray[np.float32] | None


@dataclass(frozen=True, slots=True, eq=False)
class _Levels:
    """Noise levels of several time slots, each half a pulse long."""

    common: NDArray[np.float32]
    margin: NDArray[np.float32]
    """(slots,) factor on `common` in the search, to allow for the error of the noise level."""
    bands: NDArray[np.float32] | None
    """(bands, new slots) ratio of each band's noise level to `common`; None if all are
    equal."""


class _LevelRecord:
    """Noise levels of the last columns; `keep` is the number of columns stored."""

    def __init__(self, band_of: NDArray[np.intp], keep: int) -> None:
        self._band_of, self._keep = band_of, keep
        self._stretches: list[_Stretch] = []

    def at(self, row: float, column: float) -> float:
        """Noise level at a frequency row and a column; 1.0 before the first record."""
        for stretch in reversed(self._stretches):
            if column >= stretch.first:
                slot = min(int((column - stretch.first) / SLOT), len(stretch.common) - 1)
                level = float(stretch.common[slot])
                if stretch.bands is not None:
                    index = min(max(round(row), 0), len(self._band_of) - 1)
                    level *= float(stretch.bands[self._band_of[index], slot])
                return level
        return 1.0

    def note(
        self, first: int, common: NDArray[np.float32], bands: NDArray[np.float32] | None
    ) -> None:
        """Add the noise levels of the spectrogram columns from `first` on."""
        self._stretches.append(_Stretch(first, common, bands))
        last = first + SLOT * len(common)
        while len(self._stretches) > 1 and self._stretches[1].first < last - self._keep:
            del self._stretches[0]

    def correct(self, measured: NDArray[np.float32], past: int) -> None:
        """Replace the noise levels of slots that may contain a pulse by later estimates."""
        if self._stretches:
            before = self._stretches[-1].common
            upto = min(LEVEL.beside_slots[1], past, len(before))
            before[len(before) - upto :] = measured[past - upto : past]


class Leveller:
    """Tracks the noise level that the rows of one search have in common.

    `keep`: number of columns for which levels are stored. `steepness`: threshold of the search
    divided by K, which determines the margin for a level's error. `circular`: True if the last
    row is next to the first.
    """

    def __init__(
        self, *, rows: int, keep: int, steepness: float, circular: bool = False
    ) -> None:
        count = max(1, round(rows / ROWS_PER_BIN))
        self.band_of = np.minimum(np.arange(rows) // ROWS_PER_BIN, count - 1)
        self._members = np.bincount(self.band_of).astype(np.float32)
        self._sums = np.zeros((count, rows), np.float32)
        self._sums[self.band_of, np.arange(rows)] = 1.0 / self._members[self.band_of]
        self._bins = (rows + ROWS_PER_BIN - 1) / ROWS_PER_BIN
        self._steepness = steepness
        self._circular = circular
        self._now = np.ones(count, np.float32)
        """(bands,) newest noise level of each frequency band."""
        self._usual = np.ones(count, np.float32)
        """(bands,) noise level of each frequency band, averaged since its last change."""
        self._stayed = 0
        # The noise of the rows was just estimated from earlier columns.
        self._past = np.ones((count, LEVEL.learnt_slots), np.float32)
        self._whole = np.ones(LEVEL.learnt_slots, np.float32)
        """(past slots,) weight of each time slot: 0 if it has lost samples, else 1."""
        self.record = _LevelRecord(self.band_of, keep)
        self.unsteady = False
        """True while the noise level changes, or differs between frequency bands."""
        self.uneven = False

    @property
    def rows_now(self) -> NDArray[np.float32]:
        """(rows,) noise level of each frequency row, averaged since its last change."""
        return self._usual[self.band_of]

    def level(
        self,
        power: NDArray[np.float32],
        noise: NDArray[np.float32],
        first: int,
        whole: NDArray[np.bool_] | None = None,
    ) -> None:
        """Divide new columns by their noise, in place; `first`: number of the first column."""
        if not power.shape[1]:
            return
        # The noise level stays unchanged where samples were lost.
        lost = np.zeros(0, np.bool_) if whole is None else ~whole
        usual = share = np.zeros(0, np.float32)
        if lost.any():
            usual = (noise * self._now[self.band_of])[:, np.newaxis]
            share = np.zeros_like(power[:, lost])
            np.divide(power[:, lost], usual, out=share, where=usual > 0.0)
            power[:, lost] = usual
        if kernels() is not None and power.strides[1] == power.itemsize:
            self._level_by_kernel(power, noise, first, whole)
        else:
            self._level_by_numpy(power, noise, first, whole)
        if lost.any():
            power[:, lost] *= share

    def _level_by_numpy(
        self,
        power: NDArray[np.float32],
        noise: NDArray[np.float32],
        first: int,
        whole: NDArray[np.bool_] | None,
    ) -> None:
        cells = power[:, ::SLOT] / noise[:, np.newaxis]
        count = cells.shape[1]
        limit = np.float32(LEVEL.most_power) * self._now[self.band_of]
        new = self._sums @ np.minimum(cells, limit[:, np.newaxis]) / np.float32(_MEAN)
        both = np.concatenate((self._past, new), axis=1)
        weights = np.ones(both.shape[1], np.float32)
        weights[:-count] = self._whole
        if whole is not None:
            weights[-count:] = whole[::SLOT]
        mean = _steady_mean(both, weights, self._members, self._bins)
        if mean is None:
            self._level(power, noise, first, both, weights)
            return
        self.unsteady = self.uneven = False
        total = max(float(weights.sum()), 1.0)
        level = mean * (1.0 + 0.5 * self._steepness * LEVEL.slot_variance / self._bins / total)
        self._now[:] = mean
        self._keep_past(both, weights)
        self.record.note(first, np.full(count, level, np.float32), None)
        self._average()
        power *= np.float32(1.0) / np.float32(level)

    def _keep_past(self, both: NDArray[np.float32], weights: NDArray[np.float32]) -> None:
        past = LEVEL.past_slots
        self._past, self._whole = both[:, -past:].copy(), weights[-past:]

    def _level_by_kernel(
        self,
        power: NDArray[np.float32],
        noise: NDArray[np.float32],
        first: int,
        whole: NDArray[np.bool_] | None,
    ) -> None:
        count = -(-power.shape[1] // SLOT)
        slots = self._past.shape[1] + count
        both = np.empty((len(self._past), slots), np.float32)
        weights = np.empty(slots, np.float32)
        steady = kernels().level(
            *(power, noise, self._now, self._usual, self._stayed, self._members),
            *(self._past, self._whole, whole, self._bins, self._steepness, both, weights),
        )
        if steady is None:
            self._level(power, noise, first, both, weights)
            return
        level, self._stayed = steady
        self.unsteady = self.uneven = False
        self._keep_past(both, weights)
        self.record.note(first, np.full(count, level, np.float32), None)

    def _level(
        self,
        power: NDArray[np.float32],
        noise: NDArray[np.float32],
        first: int,
        both: NDArray[np.float32],
        weights: NDArray[np.float32],
    ) -> None:
        columns = power.shape[1]
        slots = power[:, ::SLOT]
        past = both.shape[1] - slots.shape[1]
        if not self._nearly_steady(both):
            both[:, past:] = _robust(self._sums, self.band_of, slots, noise, both, past)
        found = self._follow(both, weights, past)
        measured, bands = found.measured, found.bands
        self.record.correct(measured, past)
        self.unsteady, self.uneven = True, bands is not None
        self._keep_past(both, weights)
        self.record.note(first, measured[past:].copy(), found.measured_bands)
        self._now[:] = measured[-1]
        if found.measured_bands is not None:
            self._now *= found.measured_bands[:, -1]
        if bands is None:
            power /= np.repeat(found.divisor, SLOT)[:columns]
        else:
            level = (bands * found.divisor)[self.band_of]
            power /= np.repeat(level, SLOT, axis=1)[:, :columns]
        self._average()

    def _nearly_steady(self, both: NDArray[np.float32]) -> bool:
        """True if all noise levels are close to the newest, so cells need no new limits."""
        pieces = both.shape[1] // LEVEL.piece_slots
        some = both[:, both.shape[1] - pieces * LEVEL.piece_slots :]
        common = self._common(some).reshape(pieces, LEVEL.piece_slots).mean(axis=1)
        bands = some.mean(axis=1)
        least = min(float(common.min()), float(bands.min()))
        return least > LEVEL.steady_ratio * max(float(common.max()), float(bands.max()))

    def _average(self) -> None:
        self._stayed = min(self._stayed + 1, LEVEL.most_averaged)
        if bool((np.abs(self._now - self._usual) > LEVEL.same_share * self._usual).any()):
            self._stayed = 1
        self._usual = self._usual + (self._now - self._usual) / np.float32(self._stayed)

    def _common(self, bands: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(self._members @ bands / self._members.sum(), np.float32)

    def _follow(
        self, both: NDArray[np.float32], weights: NDArray[np.float32], past: int
    ) -> _Followed:
        """Noise levels of the present slots, for the search and for measuring pulses; a rise
        among the newest may be a strong pulse, so only the search counts it.
        """
        if kernels() is not None:
            return self._follow_by_kernel(both, weights, past)
        common = np.maximum(self._common(both), np.float32(LEVEL.least_level))
        weights = weights.copy()
        doubtful = _take_out_bursts(common, weights, self._bins)
        levels = measured = self._levels(both, common, weights, past)
        if doubtful.any():
            weights[doubtful] = 0.0
            measured = self._levels(both, common, weights, past)
        divisor = (levels.common * levels.margin)[past:]
        return _Followed(divisor, levels.bands, measured.common, measured.bands)

    def _follow_by_kernel(
        self, both: NDArray[np.float32], weights: NDArray[np.float32], past: int
    ) -> _Followed:
        slots = len(weights)
        divisor = np.empty(slots - past, np.float32)
        bands = np.empty((len(both), slots - past), np.float32)
        measured, measured_bands = np.empty(slots, np.float32), np.empty_like(bands)
        differ, measured_differ = kernels().follow(
            *(both, weights, self._members, past, self._bins, self._steepness),
            *(self._circular, divisor, bands, measured, measured_bands),
        )
        return _Followed(
            divisor,
            bands if differ else None,
            measured,
            measured_bands if measured_differ else None,
        )

    def _levels(
        self,
        both: NDArray[np.float32],
        common: NDArray[np.float32],
        weights: NDArray[np.float32],
        past: int,
    ) -> _Levels:
        """Noise level of each time slot, and from slot `past` on of each frequency band."""
        scale = math.sqrt(LEVEL.slot_variance / self._bins)
        back, begin, least = _longest(common, weights, scale)
        ahead, end, _ = _longest(common[::-1], weights[::-1], scale)
        ahead, end = ahead[::-1], end[::-1]
        sums, total = _sums(common * weights), _sums(weights)
        begin, end = _agreed(back, begin, ahead, len(common) - end, scale, total)
        n = total[end] - total[begin]
        level = np.where(n > 0.0, (sums[end] - sums[begin]) / np.maximum(n, 1e-9), back)
        # Near the newest slot a stretch includes too much from before a rise.
        level[-LEVEL.newest_slots :] = np.maximum(level, least)[-LEVEL.newest_slots :]
        level = np.maximum(level, LEVEL.least_level)
        margin = 0.5 * self._steepness * scale**2 / np.maximum(n, 1.0)
        return _Levels(
            common=np.asarray(level, np.float32),
            margin=np.asarray(1.0 + np.minimum(margin, LEVEL.most_margin), np.float32),
            bands=self._bands(both, weights, begin[past:], end[past:], level[past:]),
        )

    def _bands(
        self,
        both: NDArray[np.float32],
        weights: NDArray[np.float32],
        begin: NDArray[np.intp],
        end: NDArray[np.intp],
        level: NDArray[np.float64],
    ) -> NDArray[np.float32] | None:
        """(bands, slots) noise level of each band over the common one; None if all equal."""
        if len(both) < 4:
            return None
        total, sums = _sums(weights), _sums(both * weights)
        n = np.maximum(total[end] - total[begin], 1e-3)
        ratio = (sums[:, end] - sums[:, begin]) / (n * level)
        levels = _segments(ratio, n, circular=self._circular)
        return levels if bool((levels != levels[0]).any()) else None


def _take_out_bursts(
    common: NDArray[np.float32], weights: NDArray[np.float32], bins: float
) -> NDArray[np.bool_]:
    """Give slots with strong pulses the weight zero; mark new slots that may have pulses."""
    near, far = LEVEL.beside_slots
    width = far - near + 1
    # Later slots are unknown; before the first slot assume the same level.
    padded = np.pad(common, (0, far), mode="edge")
    padded = np.pad(padded, (far, 0), mode="reflect")
    medians = np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1)
    before, after = medians[: len(common)], medians[far + near : far + near + len(common)]
    # Three slots together show weaker pulses, if there are many rows.
    three = np.convolve(np.pad(common, 1, mode="edge"), np.full(3, 1.0 / 3.0), "valid")
    burst = min(
        1.0 + LEVEL.pulse_sigmas * math.sqrt(LEVEL.slot_variance / bins), LEVEL.pulse_ratio
    )
    high = (common > LEVEL.pulse_ratio * before) | (three > burst * before)
    short = high & ((common > LEVEL.pulse_ratio * after) | (three > burst * after))
    weights[short] = 0.0
    doubtful = high.copy()
    doubtful[:-far] = False
    return doubtful


def _sums(values: NDArray[np.float32]) -> NDArray[np.float64]:
    zero = np.zeros((*values.shape[:-1], 1))
    return np.concatenate((zero, np.cumsum(values, axis=-1, dtype=np.float64)), axis=-1)


def _longest(
    common: NDArray[np.float32], weights: NDArray[np.float32], scale: float
) -> tuple[NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]:
    """Mean, start and lower bound of the longest stretch of equal noise up to each slot."""
    sums, total = _sums(common * weights), _sums(weights)
    end = np.arange(1, len(common) + 1)
    mean, first = np.asarray(common, np.float64), end - 1
    low, high = np.zeros(len(common)), np.full(len(common), np.inf)
    least = np.zeros(len(common))
    going = np.ones(len(common), np.bool_)
    for length in LEVEL.stretches:
        begin = np.maximum(end - length, 0)
        some = total[end] - total[begin]
        here = np.where(some > 0, (sums[end] - sums[begin]) / np.maximum(some, 1e-9), mean)
        error = scale / np.sqrt(np.maximum(some, 1e-9))
        surely = here * (1.0 - error)
        error *= LEVEL.differ_sigmas
        low = np.maximum(low, here * (1.0 - error))
        high = np.minimum(high, here * (1.0 + error))
        going &= low <= high
        mean, first = np.where(going, here, mean), np.where(going, begin, first)
        # Not of a longer stretch, which may reach back to before a fall.
        least = np.where(going, np.maximum(least, surely), least)
    return mean, first, least


def _agreed(
    back: NDArray[np.float64],
    begin: NDArray[np.intp],
    ahead: NDArray[np.float64],
    end: NDArray[np.intp],
    scale: float,
    total: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last slot averaged for each slot.

    If the levels before and after the slot agree, both sides are averaged; otherwise the side
    of the higher level.
    """
    at = np.arange(len(back))
    seen, coming = total[at + 1] - total[begin], total[end] - total[at]
    error = np.sqrt(1.0 / np.maximum(seen, 1e-9) + 1.0 / np.maximum(coming, 1e-9))
    apart = np.abs(back - ahead) > LEVEL.differ_sigmas * scale * error * 0.5 * (back + ahead)
    apart &= (seen > 0) & (coming > 0)
    louder = back >= ahead
    return np.where(apart & ~louder, at, begin), np.where(apart & louder, at + 1, end)


def _segments(
    ratio: NDArray[np.float64], n: NDArray[np.float64], *, circular: bool
) -> NDArray[np.float32]:
    """Split the bands where their noise levels differ; widen the higher side by one band.

    The likeliest split comes first: fitting two means of exponentials instead of one raises the
    log-likelihood by the sum of cells × ln(mean).
    """
    count, slots = ratio.shape
    sums = np.concatenate((np.zeros((1, slots)), np.cumsum(np.maximum(ratio, 1e-9), axis=0)))
    cells = n / LEVEL.slot_variance
    slot = np.arange(slots)
    begin, end = np.zeros((count, slots), np.intp), np.full((count, slots), count)
    split = np.arange(1, count)[:, np.newaxis]
    band = np.arange(count)[:, np.newaxis]
    for _ in range(LEVEL.most_splits):
        low, high = begin[1:], end[1:]
        below, above = split - low, high - split
        first = (sums[1:-1] - sums[low, slot]) / np.maximum(below, 1)
        second = (sums[high, slot] - sums[1:-1]) / np.maximum(above, 1)
        whole = (sums[high, slot] - sums[low, slot]) / (high - low)
        gain = (high - low) * np.log(whole)
        gain -= below * np.log(np.maximum(first, 1e-9)) + above * np.log(second)
        gain[below == 0] = 0.0
        best = gain.argmax(axis=0)
        going = gain[best, slot] * cells > LEVEL.split_log
        if not going.any():
            break
        at, low, high = best + 1, begin[best + 1, slot], end[best + 1, slot]
        end = np.where(going & (band >= low) & (band < at), at, end)
        begin = np.where(going & (band >= at) & (band < high), at, begin)
    mean = (sums[end, slot] - sums[begin, slot]) / (end - begin)
    wide = np.maximum(mean[:-1], mean[1:])
    if circular:
        mean[0] = mean[-1] = np.maximum(mean[0], mean[-1])
    mean[:-1] = np.maximum(mean[:-1], wide)
    mean[1:] = np.maximum(mean[1:], wide)
    return np.asarray(mean, np.float32)


def _steady_mean(
    both: NDArray[np.float32],
    weights: NDArray[np.float32],
    members: NDArray[np.float32],
    bins: float,
) -> float | None:
    """Mean noise level of all slots if it may be constant; None otherwise."""
    common = members / members.sum() @ both * weights
    total = np.maximum(weights.sum(), np.float32(1.0))
    mean = np.maximum(common.sum() / total, np.float32(LEVEL.least_level))
    pieces = len(common) // LEVEL.piece_slots
    tail = slice(len(common) - pieces * LEVEL.piece_slots, None)
    some = weights[tail].reshape(pieces, -1).sum(axis=1)
    sums = common[tail].reshape(pieces, -1).sum(axis=1)
    scale = LEVEL.doubt_sigmas * math.sqrt(LEVEL.slot_variance / bins) * mean
    for _ in range(3):
        away = np.abs(sums - some * mean)
        if not (away <= scale * np.sqrt(np.maximum(some, np.float32(1.0)))).all():
            return None
        pieces //= 2
        if pieces < 2:
            break
        some = some[-2 * pieces :].reshape(pieces, 2).sum(axis=1)
        sums = sums[-2 * pieces :].reshape(pieces, 2).sum(axis=1)
    own = both @ weights / (total * mean)
    tall = np.zeros(len(own) + 1, np.float32)
    np.cumsum(own - np.float32(1.0), out=tall[1:])
    error = LEVEL.band_doubt_sigmas * np.sqrt(
        LEVEL.slot_variance * ROWS_PER_BIN / members[0] / total
    )
    for width in (1, 3, 7):
        if width > len(own) // 2 + 1:
            break
        if not np.abs(tall[width:] - tall[:-width]).max() <= error * math.sqrt(width):
            return None
    return float(mean)


def _robust(
    sums: NDArray[np.float32],
    band_of: NDArray[np.intp],
    slots: NDArray[np.float32],
    noise: NDArray[np.float32],
    both: NDArray[np.float32],
    past: int,
) -> NDArray[np.float32]:
    """(bands, slots) mean power of each band's new cells, limited by neighbouring cells."""
    width, most = LEVEL.median_slots, np.float32(LEVEL.most_power)
    half = width // 2
    lead = min(past, half)
    cells = slots / noise[:, np.newaxis]
    x = sums @ cells
    # The usual level of the newest slots is unknown: use the quartile of the bands.
    newest = np.zeros_like(x)
    last = LEVEL.beside_slots[0]
    newest[:, -last:] = np.quantile(x[:, -last:], 0.75, axis=0)
    for _ in range(2):
        around = np.concatenate((both[:, past - lead : past], x), axis=1)
        if len(around) > 2:
            padded = np.pad(around, ((1, 1), (0, 0)), mode="edge")
            around = (padded[:-2] + padded[1:-1] + padded[2:]) / np.float32(3.0)
        padded = np.pad(around, ((0, 0), (half, half)), mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=1)
        usual = np.partition(windows, half, axis=2)[:, lead:, half]
        usual = np.maximum(usual, np.maximum(newest, np.float32(LEVEL.least_level)))
        x = sums @ np.minimum(cells, most * usual[band_of])
        x /= np.float32(_MEAN)
    return x
