"""Search for pulse trains whose interval changes steadily over a flight.

With an interval ``T (1 + d (t/D - 1/2))`` over a flight of length D, pulses are T apart on the
time scale ``u = D/d ln((1 + d (t/D - 1/2)) / (1 - d/2))``. For several values of d, the slots
are ordered by u and folded, in slots of double length and with few patterns. Then the most
likely cells are examined in full.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from uavrt.core.columns import joined_rows
from uavrt.core.messages import Tag
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import (
    FoldedTrain,
    Weights,
    chance,
    intervals_searched,
    log_tail,
    peaks,
    search_flight,
)
from uavrt.localization.whole_flight.tag_places import distinct
from uavrt.localization.whole_flight.tuning import SEARCH

_Floats = NDArray[np.float64]


def train_times_s(phase_s: float, interval_s: float, drift: float, span_s: float) -> _Floats:
    """Times of a train's pulses relative to the start of the first slot [s]; the last one may
    exceed `span_s`.
    """
    count = max(0, int((span_s * (1.0 + abs(drift)) - phase_s) / interval_s) + 2)
    return real_time_s(
        phase_s + np.arange(count).astype(np.float64) * interval_s, drift, span_s
    )


def real_time_s(even_s: _Floats, drift: float, span_s: float) -> _Floats:
    """Convert times on a clock that drifts with the tag to real time [s]."""
    if not drift:
        return even_s
    grown = np.expm1(even_s * drift / span_s) * (1.0 - 0.5 * drift) / drift
    return np.asarray(span_s * grown)


def even_time_s(time_s: _Floats, drift: float, span_s: float) -> _Floats:
    """Convert real time to times on a clock that drifts with the tag [s]."""
    if not drift:
        return time_s
    grown = np.log1p(time_s * drift / (span_s * (1.0 - 0.5 * drift)))
    return np.asarray(span_s * grown / drift)


def even_order(energies: SlotEnergies, drift: float) -> NDArray[np.intp]:
    """Index of the slot at each step of a clock that drifts with the tag."""
    span_s = len(energies.heard) * energies.slot_s
    at = real_time_s(energies.time_s, drift, span_s) / energies.slot_s
    return np.asarray(np.clip(at.astype(np.intp), 0, len(energies.heard) - 1))


def drifts_searched(most: float, span_s: float, slot_s: float) -> _Floats:
    """Relative changes of the interval that are searched, including 0."""
    step = 8.0 * SEARCH.drift_step_slots * slot_s / span_s
    count = int(np.ceil(most / step))
    return np.linspace(-most, most, 2 * count + 1) if count else np.zeros(1)


def search_drifting(
    energies: SlotEnergies, weights: Weights, tag: Tag, most_drift: float
) -> FoldedTrain:
    """Find the most likely train of a tag whose interval changes by up to the share
    `most_drift`.
    """
    steady = search_flight(energies, weights, tag, most=1)[0]
    span_s = len(energies.heard) * energies.slot_s
    sag_slots = most_drift * span_s / 4.0 / energies.slot_s
    if steady.loud or sag_slots < 1.0:
        return steady
    hypotheses = steady.hypotheses * (1.0 + sag_slots / SEARCH.drift_independent_slots)
    best = replace(
        steady,
        hypotheses=hypotheses,
        false_alarm_probability=chance(steady.log_probability, hypotheses),
    )
    coarse = _coarse(energies)
    few = _few_places(weights, coarse)
    rows = np.arange(len(energies.energy))
    for rate, between in enumerate(intervals_searched(tag), 1):
        found, drifts, logs = [], [], []
        for drift in drifts_searched(most_drift, span_s, energies.slot_s).tolist():
            order = even_order(coarse, drift)
            turned = replace(few, basis=np.ascontiguousarray(few.basis[:, order]))
            cells = peaks(coarse.energy[:, order], rows, turned, coarse.slot_s, between)
            found.append(cells)
            drifts.append(np.full(len(cells.score), drift))
            logs.append(log_tail(cells, few, coarse))
        every, drift_of, log = joined_rows(found), np.concatenate(drifts), np.concatenate(logs)
        for at in np.argsort(log, kind="stable")[: SEARCH.drift_cells].tolist():
            start = replace(
                best,
                rate=rate,
                loud=False,
                drift=float(drift_of[at]),
                interval_s=float(every.interval[at]) * coarse.slot_s,
                phase_s=(float(every.phase[at]) + 0.5) * coarse.slot_s,
            )
            one = _refined(energies, weights, start, int(every.row[at]))
            if one.log_probability < best.log_probability:
                best = one
    return best


def _coarse(energies: SlotEnergies) -> SlotEnergies:
    count = len(energies.heard) // 2
    pairs = energies.energy[:, : 2 * count].reshape(len(energies.energy), count, 2)
    heard = np.asarray(energies.heard[: 2 * count].reshape(count, 2).all(axis=1))
    larger = pairs.max(axis=2)
    some = larger[:, heard].astype(np.float64)
    if some.size:
        mean, sigma = some.mean(axis=1), np.maximum(some.std(axis=1), 1e-6)
        larger = ((larger - mean[:, np.newaxis]) / sigma[:, np.newaxis]).astype(np.float32)
    larger[:, ~heard] = 0.0
    return replace(energies, energy=larger, heard=heard, slot_s=2.0 * energies.slot_s)


def _few_places(weights: Weights, coarse: SlotEnergies) -> Weights:
    basis = weights.basis[: SEARCH.drift_patterns, : 2 * len(coarse.heard) : 2].copy()
    basis[:, ~coarse.heard] = 0.0
    mixing = weights.mixing[:, : SEARCH.drift_patterns].astype(np.float64)
    mixing = mixing[distinct(mixing, SEARCH.drift_correlation)]
    return Weights.of(basis.astype(np.float64), mixing, coarse, weights.interval_s)


def _refined(
    energies: SlotEnergies, weights: Weights, start: FoldedTrain, row: int
) -> FoldedTrain:
    """Find the most likely pulse train near a cell of the coarse search, in the finer cells of
    the full search.
    """
    slot_s, slots = energies.slot_s, len(energies.heard)
    span_s = slots * slot_s
    count = max(2, int(span_s / start.interval_s))
    number = np.arange(count + 2)
    steps = np.arange(-2.0, 3.0)
    drifts = start.drift + 8.0 * slot_s / span_s * np.array([-1.0, 0.0, 1.0])
    shape = (len(drifts), len(steps), len(steps))
    drift, interval_s, phase_s = (
        one[..., np.newaxis]
        for one in np.meshgrid(
            drifts,
            start.interval_s + steps * slot_s / (count - 1),
            start.phase_s + steps * slot_s,
            indexing="ij",
        )
    )
    safe = np.where(np.abs(drift) < 1e-9, 1e-9, drift)
    even_s = phase_s + number * interval_s
    time_s = span_s * np.expm1(even_s * safe / span_s) * (1.0 - 0.5 * safe) / safe
    at = np.floor(time_s / slot_s).astype(np.intp)
    inside = (at >= 0) & (at < slots)
    at = np.clip(at, 0, slots - 1)
    basis = np.where(inside, weights.basis[:, at], np.float32(0.0))
    scale = np.sqrt(interval_s[..., 0] / weights.interval_s)
    best, kept = start.log_probability, start
    for near in range(max(0, row - 1), min(len(energies.energy), row + 2)):
        sums = np.einsum("rdipn,dipn->rdip", basis, energies.energy[near][at])
        score = np.einsum("xr,rdip->xdip", weights.scaled(near), sums) * scale
        ratio = np.sqrt(start.interval_s / weights.interval_s)
        place = score.reshape(len(score), -1).argmax(axis=1)
        top = score.reshape(len(score), -1)[np.arange(len(score)), place]
        skewness = weights.skewness[near] * ratio
        logs = stats.pearson3.logsf(top.astype(np.float64), skewness)
        which = int(np.argmin(logs))
        if logs[which] < best:
            best = float(logs[which])
            d, i, p = (int(x) for x in np.unravel_index(int(place[which]), shape))
            kept = replace(
                start,
                false_alarm_probability=chance(best, start.hypotheses),
                score=float(top[which]),
                interval_s=float(interval_s[d, i, p, 0]),
                phase_s=float(phase_s[d, i, p, 0]),
                drift=float(drift[d, i, p, 0]),
                offset_hz=float(energies.offsets_hz[near]),
                place=which,
                log_probability=best,
            )
    return kept
