"""Evidence that the pulses at a listed code's places are that code's.

One likelihood ratio: the listed code, whose pulses are equally strong, against an unlisted one
with some pulses at these places by chance, or against noise. An unlisted code explains all
places but one at the price of the coincidences; the place that it explains worst must then show
a pulse by itself.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FADING = 0.12
"""Standard deviation of the amplitude within a burst, without the noise's."""
_COINCIDENCE = 0.05
"""Chance that a pulse of another code's burst lies at a place: 3 ms of a gap of 57 ms."""
_HIT = 1e-3
"""Least chance that a pulse of any sender lies at a place."""
_HIDES = 0.5
"""Least amplitude of a signal that hides a pulse, relative to the pulse."""
_PLACE_S = 1e-3
"""Largest deviation of a pulse from its place."""
_LOOKS = 20.0
"""Number of independent sums of several bursts, of which the best is used."""
_STRENGTHS = 5.0
"""Log of the ratio of the largest to the smallest possible amplitude of a pulse."""
_ALIGNMENTS = 16.0
"""Number of ways in which a pulse of a burst of four lies at one of four places."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Log-likelihood ratios of the listed code."""

    over_noise: NDArray[np.float64]
    """Code's own pulses against noise, shape (n,)."""
    over_unlisted: NDArray[np.float64]
    """Against unlisted codes, shape (n,)."""
    alone: NDArray[np.float64]
    """Of each place against noise or a pulse of another burst there, shape (n, places)."""
    own: NDArray[np.bool_]
    """True for places with the code's pulse rather than a stronger signal."""


def required_evidence(foreign_per_hour: float, false_per_hour: float) -> float:
    """Log-likelihood ratio required of a listed code's burst.

    `false_per_hour`: allowed false identifications per code.
    """
    return math.log(_ALIGNMENTS * foreign_per_hour / false_per_hour)


def evidence(
    energies: NDArray[np.floating],
    usable: NDArray[np.bool_],
    *,
    foreign_per_hour: float,
    bursts: int = 1,
) -> Evidence:
    """Compare the listed code with noise and with unlisted codes.

    `energies` (n, places): sums over the bursts, in noise energies. `usable` (n, places):
    places without another burst. `bursts`: number summed at each place.
    """
    x = np.sqrt(np.maximum(energies.astype(np.float64), 0.25))
    noise = math.log(2.0) - math.lgamma(bursts) + (2 * bursts - 1) * np.log(x) - x * x
    hit = min(0.1, _HIT + 4.0 * foreign_per_hour / 3600.0 * _PLACE_S)
    foreign = math.log(hit) - np.log(_STRENGTHS * np.maximum(x, math.sqrt(bursts))) - noise
    # Strengths that are tried: that of each place, and their mean.
    mean = np.where(usable, x, 0.0).sum(axis=1) / np.maximum(usable.sum(axis=1), 1)
    tried = np.maximum(np.concatenate((x, mean[:, None]), axis=1), 1.4 * math.sqrt(bursts))
    variance = 0.5 + (FADING * tried[:, :, None]) ** 2 / bursts
    pulse = -((x[:, None] - tried[:, :, None]) ** 2) / (2.0 * variance)
    pulse -= 0.5 * np.log(2.0 * np.pi * variance) + noise[:, None]
    # A weaker signal hides no pulse.
    hidden = np.where(x[:, None] >= _HIDES * tried[:, :, None], foreign[:, None], -np.inf)
    listed = np.where(usable[:, None], np.logaddexp(pulse, hidden), 0.0)
    best = listed.sum(axis=2).argmax(axis=1)
    rows = np.arange(len(x))
    own = usable & (pulse[rows, best] >= hidden[rows, best])
    over_noise = np.where(own, pulse[rows, best], 0.0).sum(axis=1)
    # An unlisted code has pulses in some places, never in all: summed by the first that it
    # lacks.
    lacks = np.logaddexp(0.0, foreign)[:, None] + np.zeros_like(pulse)
    has = math.log(_COINCIDENCE) + pulse
    either = np.where(usable[:, None], np.logaddexp(lacks, has), 0.0)
    before = np.where(usable[:, None], has, 0.0)
    before = np.cumsum(before, axis=2) - before
    behind = either.sum(axis=2, keepdims=True) - np.cumsum(either, axis=2)
    parts = np.where(usable[:, None], lacks + before + behind, -np.inf)
    unlisted = np.logaddexp.reduce(parts, axis=2).max(axis=1)
    alone = listed[rows, best] - lacks[:, 0]
    return Evidence(
        over_noise=over_noise,
        over_unlisted=listed[rows, best].sum(axis=1) - unlisted,
        alone=np.where(usable, alone, 0.0),
        own=own,
    )


def evidence_in_step(alone: NDArray[np.float64], usable: NDArray[np.bool_]) -> float:
    """Log-likelihood ratio of bursts in step against one unlisted code's, also in step.

    `alone` (bursts, places): as in `Evidence`.
    """
    places = alone.sum(axis=0)[usable.any(axis=0)]
    return float(places.min()) - (len(places) - 1) * math.log(_COINCIDENCE)


def evidence_of_sums(
    energies: NDArray[np.float64], *, foreign_per_hour: float, in_step: float
) -> NDArray[np.float64]:
    """Log-likelihood ratio against unlisted codes of bursts that are found only together.

    `energies` (n, bursts, places): in noise energies. `in_step`: chance that an unlisted tag's
    interval is the listed one.
    """
    # One unlisted tag is in step by chance, or the pulses of several are.
    by_one, by_several = (
        evidence(
            each,
            np.ones(each.shape, np.bool_),
            foreign_per_hour=foreign_per_hour,
            bursts=summed,
        ).over_unlisted
        for each, summed in (
            (energies.sum(axis=1), energies.shape[1]),
            (energies.reshape(len(energies), -1), 1),
        )
    )
    return np.minimum(by_one - math.log(min(1.0, _LOOKS * in_step)), by_several)
