"""Search a whole flight for one tag, over interval, phase, frequency and position together.

The statistic for a position is the sum of the slots' energies, one slot for each pulse, each
weighted by ``w = S / (1 + S)``. S is the energy over noise of a pulse from that position,
computed from antenna gain and distance. These weights are locally most powerful for weak
pulses, and bounded for strong ones. In noise, the tail of the sum's distribution is that of a
shifted gamma distribution. Its variance and skewness are those of sums of the flight's own
energies; they are exact for equal weights and white noise without jitter
(docs/explanation/whole-flight.md).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from uavrt.core.columns import chosen_rows, joined_rows
from uavrt.core.messages import Tag
from uavrt.localization.number_kinds import Fixed, Guard
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.energies.folding import (
    base_periods,
    fold,
    fold_rows,
    highest,
    interval_slots,
    slots_added,
)
from uavrt.localization.whole_flight.tag_places import distinct
from uavrt.localization.whole_flight.tuning import SEARCH

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class FoldedTrain:
    """Most likely pulse train of a whole flight."""

    false_alarm_probability: float
    """Probability that noise alone gives a train at least as significant as this one anywhere
    in the search."""
    score: float
    """Weighted sum of energies [standard deviations]; for strong pulses, their weighted
    number."""
    interval_s: float
    """Pulse interval in the middle of the flight [s]."""
    phase_s: float
    """Middle of the first pulse's slot, relative to the start of the first slot [s]."""
    offset_hz: float
    place: int
    """Index of the tag's candidate position, which is a row of the weights."""
    hypotheses: float
    """Number of independent hypotheses tested in the search for the train."""
    log_probability: float
    """Natural logarithm of the probability that noise alone gives at least this train's sum."""
    rate: int = 1
    """Number of the tag's pulse interval that this train has, counted from 1."""
    loud: bool = False
    """True if each pulse of the train is strong enough to be detected alone."""
    drift: float = 0.0
    """Relative change of the pulse interval from the first slot to the last."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Weights:
    """Weight of a pulse in each slot, for each candidate position, as a mixture of few
    patterns.
    """

    basis: NDArray[np.float32]
    """Weights of the energy slots, shape (patterns, slots); trains are summed for each
    pattern."""
    mixing: NDArray[np.float32]
    """Coefficients that mix the patterns to each position's weights, shape (places,
    patterns)."""
    deviation: _Floats
    """Standard deviation of a train's weighted energy sum in noise, shape (frequencies,
    places)."""
    skewness: _Floats
    """Skewness of a train's weighted energy sum in noise, shape (frequencies, places)."""
    interval_s: float
    """Pulse interval for which deviation and skewness are valid [s]; a train with a longer one
    has fewer pulses."""
    spread: Fixed[float] = 1.0
    """Share of the flight's time that has much weight, averaged over positions; 1 for equal
    weights."""

    @classmethod
    def of(
        cls, basis: _Floats, mixing: _Floats, energies: SlotEnergies, interval_s: float
    ) -> "Weights":
        """Derive standard deviation and skewness of a train's sum from the flight's own
        energies.

        A train has one pulse in each interval, at a random phase, so a slot contains one with
        the probability slot / interval. The cumulants of the sum are those of all slots'
        weighted energies, multiplied by this probability. So hum, tones and changing levels are
        included.
        """
        shape = (len(energies.energy), len(mixing))
        square, cube = np.zeros(shape), np.zeros(shape)
        moments = np.zeros((3, len(mixing)))
        for first in range(0, basis.shape[1], SEARCH.moment_slots):
            part = slice(first, first + SEARCH.moment_slots)
            weight = (mixing @ basis[:, part]).T.astype(np.float32)
            energy = energies.energy[:, part]
            power = weight**2
            square += energy**2 @ power
            cube += energy**3 @ (power * weight)
            along = (np.arange(len(power)) + first + 0.5) / basis.shape[1]
            moments += np.stack((along**0, along, along**2)) @ power
        each = energies.slot_s / interval_s
        deviation = np.sqrt(np.maximum(each * square, 1e-12))
        return cls(
            basis=basis.astype(np.float32),
            mixing=mixing.astype(np.float32),
            deviation=deviation,
            skewness=np.maximum(each * cube / deviation**3, SEARCH.least_skewness),
            interval_s=interval_s,
            spread=_spread(*moments),
        )

    @classmethod
    def over(
        cls,
        patterns: _Floats,
        mixing: _Floats,
        time_s: _Floats,
        energies: SlotEnergies,
        interval_s: float,
    ) -> "Weights":
        """Interpolate patterns (patterns, times) to the slots of a flight; the weight is 0
        without samples.
        """
        basis = np.stack([np.interp(energies.time_s, time_s, one) for one in patterns])
        basis[:, ~energies.heard] = 0.0
        return cls.of(basis, mixing, energies, interval_s)

    def only(self, place: int) -> "Weights":
        """Return the weights of one position alone, as a single pattern."""
        return Weights(
            basis=self.mixing[[place]] @ self.basis,
            mixing=np.ones((1, 1), np.float32),
            deviation=self.deviation[:, [place]],
            skewness=self.skewness[:, [place]],
            interval_s=self.interval_s,
        )

    def scaled(self, row: int) -> NDArray[np.float32]:
        """Return mixing coefficients for which the sums at a frequency have variance 1 in
        noise.
        """
        return np.asarray(self.mixing / self.deviation[row][:, np.newaxis], np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Peaks:
    """Highest cells of a search, one for each position, frequency and fold."""

    place: NDArray[np.intp]
    row: NDArray[np.intp]
    """Row of the train's frequency in the slot energies."""
    interval: _Floats
    """Interval between the train's pulses [slots]."""
    phase: NDArray[np.intp]
    """Slot of the train's first pulse [slots]."""
    score: _Floats


def _spread(count: _Floats, sums: _Floats, squares: _Floats) -> float:
    """Effective duration of the pulse weights as a share of the flight, averaged over
    positions: √12 times the standard deviation of time under the weights, at most 1.
    """
    some = np.maximum(count, 1e-30)
    variance = np.maximum(squares / some - (sums / some) ** 2, 0.0)
    return float(np.minimum(np.sqrt(12.0 * variance), 1.0).mean())


def pulse_weights(gain: _Floats, design_enr: float = SEARCH.design_enr) -> _Floats:
    """Convert pulse energies relative to the strongest to weights, for arrays of any shape."""
    strength = np.asarray(design_enr * gain)
    above = 1.0 + strength
    strength /= above
    return strength


def low_rank_weights(
    gain: _Floats, time_s: _Floats, energies: SlotEnergies, interval_s: float
) -> Weights:
    """Reduce the gains of all positions to few patterns that are folded, and coefficients that
    mix them.
    """
    mixing, patterns = low_rank(pulse_weights(gain))
    return Weights.over(patterns, mixing, time_s, energies, interval_s)


def low_rank(weights: _Floats) -> tuple[_Floats, _Floats]:
    """Factorise weights into coefficients (places, patterns) and patterns (patterns, times)."""
    left, values, right = np.linalg.svd(weights, full_matrices=False)
    kept = np.cumsum(values**2) / max(float(np.sum(values**2)), 1e-30)
    rank = int(np.searchsorted(kept, SEARCH.kept_variance)) + 1
    return np.asarray(left[:, :rank] * values[:rank]), np.asarray(right[:rank])


def peaks(
    values: NDArray[np.float32],
    rows: Sequence[int] | NDArray[np.intp],
    weights: Weights,
    slot_s: float,
    between_s: tuple[float, float],
) -> Peaks:
    """Fold the frequencies `rows` at all intervals between two given ones; return the highest
    cells.
    """
    found: list[Peaks] = []
    for at, intervals, sums, scale in _folds(values, rows, weights, slot_s, between_s):
        score, cell = highest(sums, weights.scaled(at), scale)
        row, phase = np.divmod(cell, sums.shape[-1])
        found.append(
            Peaks(
                place=np.arange(len(cell)),
                row=np.full(len(cell), at),
                interval=intervals[row],
                phase=phase,
                score=score.astype(np.float64),
            )
        )
    return joined_rows(found)


def scores(
    values: NDArray[np.float32],
    rows: Sequence[int] | NDArray[np.intp],
    weights: Weights,
    slot_s: float,
    between_s: tuple[float, float],
) -> Iterator[tuple[int, _Floats, NDArray[np.float32]]]:
    """Fold several frequencies at all intervals between two given ones, and yield the scores of
    each fold.

    Yields the number of the frequency, the intervals (n,) [slots], and the weighted sums
    (places, n, phases) in standard deviations, as float32.
    """
    for at, intervals, sums, scale in _folds(values, rows, weights, slot_s, between_s):
        score = weights.scaled(at) @ sums.reshape(len(sums), -1)
        yield at, intervals, score.reshape(-1, *sums.shape[1:]) * scale[:, np.newaxis]


def _folds(
    values: NDArray[np.float32],
    rows: Sequence[int] | NDArray[np.intp],
    weights: Weights,
    slot_s: float,
    between_s: tuple[float, float],
) -> Iterator[tuple[int, _Floats, NDArray[np.float32], NDArray[np.float32]]]:
    """For each fold, yield the number of the frequency, the intervals [slots], and the
    patterns' sums with their scales.
    """
    patterns = len(weights.basis)
    low_s, high_s = between_s
    slots = values.shape[1]
    chunk = max(1, SEARCH.side_by_side // patterns)
    for begin in range(0, len(rows), chunk):
        some = np.asarray(rows[begin : begin + chunk], np.intp)
        weighed = (values[some][:, np.newaxis] * weights.basis).reshape(-1, slots)
        for period in base_periods(low_s, high_s, slot_s):
            intervals = interval_slots(period, fold_rows(slots, period))
            used = _rows_used(intervals * slot_s, low_s, high_s)
            if not len(used):
                continue
            sums = fold(weighed, period, int(used[0]), int(used[-1]) + 1)
            # The variance is for the number of pulses for which the weights were made.
            scale = np.sqrt(intervals[used] * slot_s / weights.interval_s).astype(np.float32)
            for which, at in enumerate(some.tolist()):
                own = sums[which * patterns : (which + 1) * patterns]
                yield at, intervals[used], own, scale


def cells_searched(slots: int, slot_s: float, between_s: tuple[float, float]) -> float:
    """Number of distinguishable cells (interval and phase) in the folds of one frequency.

    Distinguishable cells differ by at least a slot over all pulses. A fold has rows for up to
    twice the number of periods; only the true number counts.
    """
    low_s, high_s = between_s
    cells = 0.0
    for period in base_periods(low_s, high_s, slot_s):
        rows = fold_rows(slots, period)
        used = _rows_used(interval_slots(period, rows) * slot_s, low_s, high_s)
        cells += len(used) * period * min(1.0, slots / period / rows)
    return cells


def hypotheses_of(energies: SlotEnergies, weights: Weights, tag: Tag) -> float:
    """Number of independent hypotheses in the search for weak pulses.

    If the drone only passes a position, only a part of the flight has weight for it. Trains
    whose intervals differ by one cell are then indistinguishable, so the number of cells is
    multiplied by that share (`Weights.spread`).
    """
    own = float(np.sum(correlation_slots(energies) ** -2.0))
    cells = _cells(energies, tag) * len(weights.basis) * own * weights.spread
    independent = SEARCH.hypotheses * (SEARCH.burst_hypotheses if energies.pulses > 1 else 1.0)
    return independent * cells


def correlation_slots(energies: SlotEnergies) -> _Floats:
    """Number of slots over which each frequency's energies are correlated; 1 if they are
    independent.

    A narrow line of hum changes slowly, so it has few independent slots. The number is the sum
    of the squared correlation over all lags.
    """
    energy = energies.energy
    power = np.maximum(np.sum(energy**2, axis=1, dtype=np.float64), 1e-9)
    alike = [
        np.einsum("fs,fs->f", energy[:, :-lag], energy[:, lag:]) / power
        if lag < energy.shape[1]
        else np.zeros(len(energy))
        for lag in SEARCH.lags
    ]
    squares = np.square([np.ones(len(energy)), *alike])
    return np.asarray(2.0 * np.trapezoid(squares, (0, *SEARCH.lags), axis=0))


def _cells(energies: SlotEnergies, tag: Tag) -> float:
    slots = len(energies.heard)
    return sum(
        cells_searched(slots, energies.slot_s, between) for between in intervals_searched(tag)
    )


def search_flight(
    energies: SlotEnergies,
    weights: Weights,
    tag: Tag,
    *,
    most: Guard[int] = 20,
    few_patterns: int = SEARCH.few_patterns,
) -> list[FoldedTrain]:
    """Find the most likely trains of a tag, the least probable in noise first.

    All rates of the tag are searched: weak pulses by their weighted energies, strong pulses by
    their number, since the energies exclude them.
    """
    folded = weights if len(weights.basis) <= few_patterns else _coarser(weights, energies)
    weak = _weak_trains(energies, weights, folded, tag, most)
    loud = _loud_trains(energies, tag, most)
    both = sorted([*weak, *loud], key=lambda one: one.false_alarm_probability)
    if both and both[0].loud:  # of trains of the same pulses, the most central
        first = next(one for one in loud if one.rate == both[0].rate)
        both = [first, *(one for one in both if one is not first)]
    return both[:most]


def intervals_searched(tag: Tag) -> list[tuple[float, float]]:
    """Shortest and longest interval that are searched for each rate [s]."""
    slack_s = tag.interval_uncertainty_s
    return [(one - slack_s, one + slack_s) for one in tag.pulse_intervals_s]


def log_tail(found: Peaks, weights: Weights, energies: SlotEnergies) -> _Floats:
    """Natural logarithm of the probability that noise alone reaches each peak."""
    ratio = np.sqrt(found.interval * energies.slot_s / weights.interval_s)
    skewness = weights.skewness[found.row, found.place] * ratio
    return np.asarray(stats.pearson3.logsf(found.score, skewness))


def chance(log_probability: float, hypotheses: float) -> float:
    """Probability that noise gives at least one of `hypotheses` results with this probability
    each.
    """
    return -math.expm1(-math.exp(min(math.log(hypotheses) + log_probability, 700.0)))


def _weak_trains(
    energies: SlotEnergies, weights: Weights, folded: Weights, tag: Tag, most: int
) -> list[FoldedTrain]:
    rows = np.arange(len(energies.energy))
    hypotheses = hypotheses_of(energies, weights, tag)
    trains = []
    for rate, between in enumerate(intervals_searched(tag), 1):
        found = peaks(energies.energy, rows, folded, energies.slot_s, between)
        logs = log_tail(found, folded, energies)
        if folded is not weights:
            found = _in_full(found, logs, weights, energies)
            logs = log_tail(found, weights, energies)
        trains += [
            train_at(energies, found, at, float(logs[at]), hypotheses, rate)
            for at in np.argsort(logs, kind="stable")[:most].tolist()
        ]
    return trains


def _coarser(weights: Weights, energies: SlotEnergies) -> Weights:
    kept = np.cumsum(np.sum(weights.mixing.astype(np.float64) ** 2, axis=0))
    rank = int(np.searchsorted(kept, SEARCH.coarse_variance * kept[-1])) + 1
    mixing = weights.mixing[:, :rank].astype(np.float64)
    mixing = mixing[distinct(mixing, SEARCH.coarse_correlation)]
    basis = weights.basis[:rank].astype(np.float64)
    return Weights.of(basis, mixing, energies, weights.interval_s)


def _in_full(found: Peaks, logs: _Floats, weights: Weights, energies: SlotEnergies) -> Peaks:
    slots = energies.energy.shape[1]
    period = np.floor(found.interval).astype(np.intp)
    cells: dict[tuple[int, int, int, int], int] = {}
    for at in np.argsort(logs, kind="stable").tolist():
        steps = fold_rows(slots, int(period[at])) - 1
        row = round((found.interval[at] - period[at]) * steps)
        cells.setdefault((int(found.row[at]), int(period[at]), row, int(found.phase[at])), at)
        if len(cells) == SEARCH.examined_cells:
            break
    chosen = np.fromiter(cells.values(), np.intp)
    turned = np.ascontiguousarray(weights.basis.T)
    sums = np.empty((len(cells), len(weights.basis)), np.float32)
    for which, (frequency, base, row, phase) in enumerate(cells):
        added = slots_added(slots, base, row, phase)
        sums[which] = energies.energy[frequency, added] @ turned[added]
    scale = np.sqrt(found.interval[chosen] * energies.slot_s / weights.interval_s)
    every = np.arange(len(chosen))
    score = (sums @ weights.mixing.T) / weights.deviation[found.row[chosen]]
    score *= scale[:, np.newaxis]
    skewness = weights.skewness[found.row[chosen]] * scale[:, np.newaxis]
    place = np.asarray(stats.pearson3.logsf(score, skewness)).argmin(axis=1)
    those = chosen_rows(found, chosen)
    return replace(those, place=place, score=score[every, place].astype(np.float64))


def _loud_trains(energies: SlotEnergies, tag: Tag, most: int) -> list[FoldedTrain]:
    """Find trains of strong pulses; by chance, the number of strong pulses in N slots is
    binomial.
    """
    counts = np.count_nonzero(energies.loud, axis=1)
    rows = np.flatnonzero(counts >= SEARCH.least_marks)
    if not len(rows):
        return []
    trains = []
    plain = plain_weights(energies)
    marks = _marks(energies, rows, min(low_s for low_s, _ in intervals_searched(tag)))
    parts = [
        peaks(marks, rows, plain, energies.slot_s, between)
        for between in intervals_searched(tag)
    ]
    cells = _cells(energies, tag) * len(energies.energy)
    hypotheses = SEARCH.loud_hypotheses * cells
    for rate, found in enumerate(parts, 1):
        logs = loud_tail(energies, found, plain)
        order, logs = _through_middles(logs, found, energies)
        trains += [
            train_at(energies, found, at, float(logs[at]), hypotheses, rate, loud=True)
            for at in order[:most].tolist()
        ]
    return trains


def _through_middles(
    logs: _Floats, found: Peaks, energies: SlotEnergies
) -> tuple[NDArray[np.intp], _Floats]:
    """Return indices of strong pulses' trains, the most likely and most central first, and
    log-probabilities.

    Frequencies next to a pulse's have fewer marks and can give less likely trains of the same
    pulses; all these trains get their lowest probability.
    """
    order = np.argsort(logs, kind="stable")
    if not len(order):
        return order, logs
    alike = order[logs[order] <= SEARCH.same_marks_share * logs[order[0]]]
    seen = found.score[alike] / np.sqrt(found.interval[alike] * energies.slot_s)
    central = alike[np.argsort(-seen, kind="stable")]
    shared = logs.copy()
    shared[alike] = logs[order[0]]
    return np.concatenate((central, order[len(alike) :])), shared


def _marks(
    energies: SlotEnergies, rows: NDArray[np.intp], shortest_s: float
) -> NDArray[np.float32]:
    """Mark strong pulses: 1 for each slot, plus less than a half in total for central slots.

    A pulse marks the slots within its jitter and the frequencies of its flanks, so many trains
    have equally many marks. The train through the pulses' middles, at the strongest frequency,
    has the most.
    """
    marks = np.zeros(energies.loud.shape, np.float32)
    most = math.ceil(energies.loud.shape[1] * energies.slot_s / shortest_s) + 1
    loudest = np.maximum(energies.level.max(axis=0), 1e-9)
    for row in rows.tolist():
        loud = energies.loud[row]
        at = np.arange(len(loud))
        before = at - np.maximum.accumulate(np.where(loud, -1, at))
        after = np.minimum.accumulate(np.where(loud, len(at), at)[::-1])[::-1] - at
        middle = np.minimum(before, after) / np.maximum(np.maximum(before, after), 1)
        more = middle * energies.level[row] / loudest
        marks[row] = np.where(loud, 1.0 + SEARCH.middle_weight / most * more, 0.0)
    return marks


def loud_tail(energies: SlotEnergies, found: Peaks, plain: Weights) -> _Floats:
    """Log-probability of at least as many strong pulses by chance as in each peak."""
    listened = max(int(np.count_nonzero(energies.listened)), 1)
    share = np.count_nonzero(energies.loud, axis=1)[found.row] / listened
    seen = found.score / np.sqrt(found.interval * energies.slot_s / plain.interval_s)
    pulses = np.ceil(listened / found.interval)
    return np.asarray(stats.binom.logsf(np.rint(seen) - 1.0, pulses, share))


def plain_weights(energies: SlotEnergies) -> Weights:
    """Return equal weights in all slots, for one position."""
    return Weights(
        basis=np.ones((1, len(energies.heard)), np.float32),
        mixing=np.ones((1, 1), np.float32),
        deviation=np.ones((len(energies.energy), 1)),
        skewness=np.ones((len(energies.energy), 1)),
        interval_s=1.0,
    )


def train_at(
    energies: SlotEnergies,
    found: Peaks,
    at: int,
    log_probability: float,
    hypotheses: float,
    rate: int,
    *,
    loud: bool = False,
) -> FoldedTrain:
    """Convert one cell of a search to a train, given the number of hypotheses tested."""
    return FoldedTrain(
        false_alarm_probability=chance(log_probability, hypotheses),
        score=float(found.score[at]),
        interval_s=float(found.interval[at]) * energies.slot_s,
        phase_s=(float(found.phase[at]) + 0.5) * energies.slot_s,
        offset_hz=float(energies.offsets_hz[found.row[at]]),
        place=int(found.place[at]),
        hypotheses=hypotheses,
        log_probability=log_probability,
        rate=rate,
        loud=loud,
    )


def _rows_used(intervals_s: _Floats, low_s: float, high_s: float) -> NDArray[np.intp]:
    rows = len(intervals_s)
    half_s = 0.5 * (intervals_s[-1] - intervals_s[0]) / max(rows - 1, 1)
    used = np.flatnonzero((intervals_s >= low_s - half_s) & (intervals_s <= high_s + half_s))
    # The last row of a period is the first of the next.
    return used[used < rows - 1] if len(used) > 1 else used
