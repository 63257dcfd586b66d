"""Compute the energies of a coded tag's bursts: the mean energy of the pulses at the code's
gaps.

The windows of each column are replaced by the bursts that begin in it, so that folding finds
trains of bursts. If all pulses of the code are present, the train is the tag's.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special, stats

from uavrt.config.tags.code_rules import GAP_TOLERANCE_S
from uavrt.core.messages import Tag
from uavrt.localization.whole_flight.tuning import BURSTS, ENERGY


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BurstColumns:
    """Energies of the bursts that begin in each column (time step)."""

    power: NDArray[np.float32]
    """Mean power of a burst's pulses that no strong signal overlaps, shape (frequencies,
    columns)."""
    seen: NDArray[np.bool_]
    """True where the burst is strong and has the shape of a burst, shape (frequencies,
    columns)."""
    heard: NDArray[np.bool_]
    """True where the burst that begins in the column has a valid energy, shape (columns,)."""
    listened: NDArray[np.bool_]
    """True where the samples of the burst that begins in the column are complete, shape
    (columns,)."""


def pulse_starts_s(tag: Tag) -> NDArray[np.float64]:
    """Start of each pulse relative to the start of the burst, from the tag list [s], shape
    (pulses,).
    """
    return np.concatenate(([0.0], np.cumsum(tag.gaps_s)))


def burst_columns(
    power: NDArray[np.float32],
    seen: NDArray[np.bool_],
    quiet: NDArray[np.bool_],
    whole: NDArray[np.bool_],
    tag: Tag,
    hop_s: float,
) -> BurstColumns:
    """Average the pulses of each burst; the code's gaps are stretched to the best fit."""
    rows, columns = power.shape
    starts_s = pulse_starts_s(tag)
    pulses = len(starts_s)
    best = BurstColumns(
        power=np.zeros((rows, columns), np.float32),
        seen=np.zeros((rows, columns), np.bool_),
        heard=np.zeros(columns, np.bool_),
        listened=np.zeros(columns, np.bool_),
    )
    for stretch in BURSTS.stretches:
        longer = 1.0 + stretch * GAP_TOLERANCE_S / max(float(starts_s[-1]), 1e-9)
        places = np.rint(starts_s * longer / hop_s).astype(np.intp).tolist()
        count = columns - places[-1]
        if count <= 0:
            break
        marks = np.zeros((rows, count), np.int8)
        total = np.zeros((rows, count), np.float32)
        valid = np.zeros((rows, count), np.int8)
        alone = np.zeros(count, np.int8)
        there = np.ones(count, np.bool_)
        for place in places:
            part = slice(place, place + count)
            marks += seen[:, part]
            alone += quiet[part]
            there &= whole[part]
        heard = there & (alone >= max(2, pulses - 1))
        for place in places:
            part = slice(place, place + count)
            use = quiet[part] | (seen[:, part] & ~heard)
            total += np.where(use, power[:, part], np.float32(0.0))
            valid += use
        loud = there & (marks >= BURSTS.loud_pulses) & (valid >= max(2, pulses - 1))
        mean = total / np.maximum(valid, 1)
        np.maximum(best.power[:, :count], mean, out=best.power[:, :count])
        best.seen[:, :count] |= loud
        best.heard[:count] |= heard
        best.listened[:count] |= there
    return best


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SinglePulses:
    """Energies of single pulses, by which the sender of a train of bursts is identified.

    `level` (frequencies, slots) is the largest power over noise of the pulses that begin in
    each slot, 0 without samples. `starts_s` (pulses,) are the starts of the code's pulses
    relative to the start of a burst.
    """

    level: NDArray[np.float32]
    starts_s: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sender:
    """Sender of a train of bursts, as identified by its pulses."""

    shift_s: float | None
    pulses_s: NDArray[np.float64]


def sender_of(
    single: SinglePulses,
    slot_s: float,
    row: int,
    time_s: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> Sender:
    """Determine by the energies of single pulses whether a train has this code.

    A burst of another code has pulses at some positions of this code and none at others. The
    same appears for this code if a later pulse was mistaken for the first.
    """
    own = Sender(shift_s=0.0, pulses_s=np.zeros(0))
    capped = np.minimum(single.level[row].astype(np.float64), BURSTS.most_energy)
    # Neighbouring slots belong to the pulse, too: the train's times are approximate.
    near = ndimage.maximum_filter1d(capped, 3)
    listened = near > 0.0
    reach = 2 * round(single.starts_s[-1] / slot_s)
    at = np.floor(time_s / slot_s).astype(np.intp)
    inside = (at >= reach) & (at + reach < len(near))
    at, weight = at[inside], weight[inside]
    if not len(at):
        return own
    floor, variance = float(near[listened].mean()), float(near[listened].var())
    over = np.where(listened, near - floor, 0.0)
    picked, places = _picked(over, at, single.starts_s, slot_s)
    off = _inequality(picked, weight, variance)
    lags = np.arange(-reach, reach + 1)
    profile = weight @ over[at[:, np.newaxis] + lags]
    deviation = 1.4826 * float(np.median(np.abs(profile - np.median(profile))))
    sums = weight @ picked
    outside = np.abs(np.subtract.outer(lags, places)).min(axis=1) > ENERGY.slots_beside
    stands_out = BURSTS.sender_sigmas * deviation
    strange = outside & (profile > max(stands_out, 0.5 * float(sums.mean())))
    chance = BURSTS.doubtful_chance if strange.any() else BURSTS.unequal_chance
    if off <= _limit(chance, len(sums)):
        return own
    spread = ndimage.maximum_filter1d(profile, 3)
    tried = lags[(lags >= -reach // 2) & (lags + places[-1] <= reach)]
    weakest = np.min([spread[tried + reach + place] for place in places], axis=0)
    best = int(weakest.argmax())
    if weakest[best] > stands_out:
        shift = int(tried[best])
        again, _ = _picked(over, at + shift, single.starts_s, slot_s)
        if _inequality(again, weight, variance) <= _limit(BURSTS.unequal_chance, len(sums)):
            return Sender(shift_s=shift * slot_s, pulses_s=np.zeros(0))
    foreign = lags[profile > stands_out] * slot_s
    return Sender(shift_s=None, pulses_s=np.asarray(foreign))


def _inequality(
    over: NDArray[np.float64], weight: NDArray[np.float64], variance: float
) -> float:
    """Chi-square of a burst's pulse energies under the hypothesis that all pulses are equally
    strong.
    """
    strength = np.maximum(over.mean(axis=1), 0.0)
    varies = variance + 2.0 * strength + (BURSTS.burst_scatter * strength) ** 2
    sums = weight @ over
    middle = float(sums.mean())
    expected = float(weight**2 @ varies) + (BURSTS.mean_scatter * middle) ** 2
    return float(((sums - middle) ** 2).sum()) / max(expected, 1e-12)


def _limit(chance: float, pulses: int) -> float:
    return float(stats.chi2.isf(chance, pulses - 1))


def _picked(
    values: NDArray[np.float64],
    at: NDArray[np.intp],
    starts_s: NDArray[np.float64],
    slot_s: float,
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return energies (bursts, pulses) at the stretch of the gaps that fits best, and the
    pulses' slots.
    """
    found = []
    for stretch in BURSTS.stretches:
        longer = 1.0 + stretch * GAP_TOLERANCE_S / max(float(starts_s[-1]), 1e-9)
        places = np.rint(starts_s * longer / slot_s).astype(np.intp)
        found.append((values[at[:, np.newaxis] + places], places))
    return max(found, key=lambda one: float(one[0].sum()))


def colliding_starts_s(
    foreign_s: NDArray[np.float64], starts_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Starts of bursts that share one of the given pulses, relative to the bursts of the
    train.
    """
    return np.unique(np.round(np.subtract.outer(foreign_s, starts_s).ravel(), 9))


def exponentials(mean: float, pulses: int) -> float:
    """Number of bursts of noise among which the largest mean pulse energy has the given
    mean.
    """
    energy = np.arange(0.0, 12.0, 0.01)
    law = special.gammainc(pulses, pulses * energy)
    many = np.geomspace(1.0, 40.0, 400)
    means = (1.0 - law ** many[:, np.newaxis]).sum(axis=1) * 0.01
    return float(many[int(np.argmin(np.abs(means - mean)))])


def log_ratio_parts(
    energy: NDArray[np.float64], strength: NDArray[np.float64], pulses: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Density and distribution function of a burst's mean energy, each divided by that of
    noise.

    The sum over p pulses of strength S has a noncentral chi-square distribution with 2 p
    degrees of freedom (Johnson, Kotz and Balakrishnan 1995, Continuous Univariate Distributions
    2, 29).
    """
    total, power = pulses * energy, pulses * strength
    x = 2.0 * np.sqrt(total * power)
    order = pulses - 1
    logs = (
        x
        - power
        + np.log(np.maximum(special.ive(order, x), 1e-300))
        - 0.5 * order * np.log(np.maximum(total * power, 1e-300))
        + math.lgamma(pulses)
    )
    density = np.exp(np.minimum(logs, 600.0))
    held = stats.ncx2.cdf(2.0 * total, 2 * pulses, 2.0 * power)
    law = held / np.maximum(special.gammainc(pulses, total), 1e-300)
    return np.asarray(density), np.asarray(law)
