"""Find one tag that is too weak in each flight by combining several flights.

For each position, frequency and narrow range of intervals, the weighted sums of every flight's
most likely phase are added. A resting tag has one position, and nearly one interval and
frequency, in all flights, but its pulses cannot be counted from flight to flight. So the
numbers of hypotheses for the phases are multiplied, while those for position, frequency and
interval are counted once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

from uavrt.core.messages import Tag
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import (
    FoldedTrain,
    Weights,
    cells_searched,
    chance,
    correlation_slots,
    intervals_searched,
    log_tail,
    low_rank,
    peaks,
    pulse_weights,
    scores,
    train_at,
)
from uavrt.localization.whole_flight.tuning import SEARCH

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Listened:
    """Energies of one flight, and the strength that pulses from each candidate position have in
    it.
    """

    energies: SlotEnergies
    gain: _Floats
    """Energy of a pulse relative to each position's strongest one, shape (places, times): in
    all flights if the tag rests, in this flight if it moves."""
    time_s: _Floats
    """Times of the gains, relative to the start of the first slot [s], shape (times,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTrain:
    """Most likely pulse train of a tag in several flights."""

    false_alarm_probability: float
    """Probability that noise alone gives a train at least as significant as this one anywhere
    in the search."""
    score: float
    log_probability: float
    hypotheses: float
    trains: tuple[FoldedTrain, ...]
    """Pulse train in each flight; its position is a row of that flight's gains."""
    log_trains: tuple[float, ...]
    """Logarithm of the number of independent trains among which each flight's is the best."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Search:
    """Search of several flights for one of a tag's rates, over narrow ranges of intervals."""

    flights: Sequence[Listened]
    weights: Sequence[Weights]
    between_s: tuple[float, float]
    half_s: float
    halves: int
    rate: int

    def best(self, number: int) -> NDArray[np.float32]:
        """Highest score of a flight over all phases, shape (places, frequencies, ranges)."""
        energies, weights = self.flights[number].energies, self.weights[number]
        rows = np.arange(len(energies.energy))
        found = np.full((len(weights.mixing), len(rows), self.halves), -np.inf, np.float32)
        slot_s, low_s = energies.slot_s, self.between_s[0]
        for row, intervals, score in scores(
            energies.energy, rows, weights, slot_s, self.between_s
        ):
            half = ((intervals * slot_s - low_s) / self.half_s).astype(np.intp)
            half = np.clip(half, 0, self.halves - 1)
            first = np.flatnonzero(np.diff(half, prepend=-1))
            top = np.maximum.reduceat(score.max(axis=2), first, axis=1)
            found[:, row, half[first]] = np.maximum(found[:, row, half[first]], top)
        # Each half is in two stretches: a tag between two is in the middle of a third.
        pairs = np.maximum(found[..., :-1], found[..., 1:])
        width = 2 * SEARCH.rows_beside + 1
        return np.asarray(ndimage.maximum_filter1d(pairs, width, axis=1, mode="nearest"))

    def rows(self, number: int) -> NDArray[np.intp]:
        """Row of a flight's frequency that corresponds to each frequency of the first
        flight.
        """
        wanted = self.flights[0].energies.offsets_hz
        own = self.flights[number].energies.offsets_hz
        return np.asarray(np.abs(own[:, np.newaxis] - wanted).argmin(axis=0))

    def train(
        self, number: int, place: int | None, offset_hz: float, stretch: int
    ) -> FoldedTrain:
        """Find the most likely train at a position (None for any), frequency and interval range
        `stretch`.
        """
        energies, weights = self.flights[number].energies, self.weights[number]
        row = int(np.argmin(np.abs(energies.offsets_hz - offset_hz)))
        rows = range(
            max(0, row - SEARCH.rows_beside),
            min(len(energies.energy), row + SEARCH.rows_beside + 1),
        )
        some = weights if place is None else weights.only(place)
        low_s = self.between_s[0] + stretch * self.half_s
        between_s = (low_s, low_s + 2.0 * self.half_s)
        found = peaks(energies.energy, rows, some, energies.slot_s, between_s)
        at = int(np.argmax(found.score))
        log_probability = float(log_tail(found, some, energies)[at])
        one = train_at(
            energies, found, at, log_probability, self.trains_each(number), self.rate
        )
        return one if place is None else replace(one, place=place)

    def trains_each(self, number: int) -> float:
        """Number of independent trains of a flight in one range of intervals."""
        energies = self.flights[number].energies
        cells = cells_searched(len(energies.heard), energies.slot_s, self.between_s)
        own = float(np.mean(correlation_slots(energies) ** -2.0))
        in_stretch = cells * own * min(1.0, 2.0 / self.halves)
        return max(1.0, SEARCH.stretch_hypotheses * in_stretch)


def search_together(
    flights: Sequence[Listened], tag: Tag, *, moves: bool = False
) -> JointTrain:
    """Find a tag's most likely trains in several flights; with `moves` its position may differ
    between flights.
    """
    weights, patterns = _weights(flights, tag, moves=moves)
    found = [
        _likeliest(_search(flights, weights, between_s, rate), tag, patterns, moves=moves)
        for rate, between_s in enumerate(intervals_searched(tag), 1)
    ]
    return min(found, key=lambda one: one.log_probability)


def _weights(
    flights: Sequence[Listened], tag: Tag, *, moves: bool
) -> tuple[list[Weights], list[int]]:
    interval_s = tag.pulse_intervals_s[0]
    each = [pulse_weights(one.gain) for one in flights]
    if moves:
        factors = [low_rank(one) for one in each]
    else:
        mixing, patterns = low_rank(np.concatenate(each, axis=1))
        cuts = np.cumsum([one.shape[1] for one in each])[:-1]
        factors = [(mixing, part) for part in np.split(patterns, cuts, axis=1)]
    weights = [
        Weights.over(patterns, mixing, one.time_s, one.energies, interval_s)
        for one, (mixing, patterns) in zip(flights, factors, strict=True)
    ]
    return weights, [len(patterns) for _, patterns in factors]


def _search(
    flights: Sequence[Listened],
    weights: Sequence[Weights],
    between_s: tuple[float, float],
    rate: int,
) -> _Search:
    low_s, high_s = between_s
    middle_s = 0.5 * (low_s + high_s)
    cell_s = max(
        one.energies.slot_s * middle_s / max(float(one.energies.time_s[-1]), middle_s)
        for one in flights
    )
    half_s = 0.5 * max(SEARCH.stretch * middle_s, SEARCH.least_cells * cell_s)
    halves = max(2, math.ceil((high_s - low_s) / half_s))
    return _Search(
        flights=flights,
        weights=weights,
        between_s=between_s,
        half_s=half_s,
        halves=halves,
        rate=rate,
    )


def _likeliest(
    search: _Search, tag: Tag, patterns: Sequence[int], *, moves: bool
) -> JointTrain:
    """Find the most likely tag position, frequency and range of intervals at one pulse rate."""
    score, skewness = _sums(search, moves=moves)
    at = score.argmax(axis=2)[..., np.newaxis]
    best = np.take_along_axis(score, at, axis=2)[..., 0]
    logs = np.asarray(
        stats.pearson3.logsf(best, np.take_along_axis(skewness, at, axis=2)[..., 0])
    )
    place, row = (int(one) for one in np.unravel_index(int(np.argmin(logs)), logs.shape))
    stretch = int(at[place, row, 0])
    every = range(len(search.flights))
    each = [search.trains_each(number) for number in every]
    shared = score.shape[1] * search.halves * len(tag.pulse_intervals_s)
    if moves:
        each = [
            count * SEARCH.place_hypotheses * many
            for count, many in zip(each, patterns, strict=True)
        ]
    else:
        shared *= patterns[0]
    hypotheses = shared * math.prod(each)
    offset_hz = float(search.flights[0].energies.offsets_hz[row])
    return JointTrain(
        false_alarm_probability=chance(float(logs[place, row]), hypotheses),
        score=float(score[place, row, stretch]),
        log_probability=float(logs[place, row]),
        hypotheses=hypotheses,
        trains=tuple(
            search.train(number, None if moves else place, offset_hz, stretch)
            for number in every
        ),
        log_trains=tuple(math.log(one) for one in each),
    )


def _sums(search: _Search, *, moves: bool) -> tuple[_Floats, _Floats]:
    """Scores of the trains and their skewness, shape (places, frequencies, ranges); one place
    if the tag moves.
    """
    total, square, cube = np.zeros(1), np.zeros(1), np.zeros(1)
    for number, weights in enumerate(search.weights):
        rows = search.rows(number)
        best = search.best(number)[:, rows].astype(np.float64)
        deviation = weights.deviation[rows].T[..., np.newaxis]
        skewness = np.broadcast_to(weights.skewness[rows].T[..., np.newaxis], best.shape)
        if moves:  # each flight has its own position, and all flights count alike
            place = best.argmax(axis=0)[np.newaxis]
            best = np.take_along_axis(best, place, axis=0)
            skewness, deviation = np.take_along_axis(skewness, place, axis=0), np.ones(1)
        total = total + deviation * best
        square = square + deviation**2
        cube = cube + deviation**3 * skewness
    return total / np.sqrt(square), np.broadcast_to(cube / square**1.5, total.shape)
