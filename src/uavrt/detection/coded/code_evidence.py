"""Compute the evidence that pulses at the positions of a listed code are a burst of that code.

A burst's pulses are equally strong. Alternatives are noise, and an unlisted code, whose pulses
lie at the listed positions with a small probability and never all.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.detection.coded.tuning import LIKELIHOOD


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Log-likelihood ratios of a listed code to other explanations of the received pulses."""

    over_noise: NDArray[np.float64]
    """(n,) log-likelihood ratio of the code's pulses to noise."""
    over_unlisted: NDArray[np.float64]
    """(n,) log-likelihood ratio of the listed code to unlisted codes."""
    alone: NDArray[np.float64]
    """(n, pulses) log-likelihood ratio of each pulse to noise or another burst's pulse."""
    own: NDArray[np.bool_]
    """(n, pulses) True where the code's own pulse is received, not a stronger signal."""


def required_evidence(foreign_per_hour: float, false_per_hour: float) -> float:
    """Log-likelihood ratio required to accept a listed code, for a given error rate [1/h]."""
    return math.log(LIKELIHOOD.alignments * foreign_per_hour / false_per_hour)


def evidence(
    energies: NDArray[np.floating],
    usable: NDArray[np.bool_],
    *,
    foreign_per_hour: float,
    bursts: int = 1,
) -> Evidence:
    """Compare the listed code with noise and with unlisted codes.

    `energies` (n, pulses): pulse energies of the n possible bursts.
    """
    x = np.sqrt(np.maximum(energies.astype(np.float64), 0.25))
    noise = math.log(2.0) - math.lgamma(bursts) + (2 * bursts - 1) * np.log(x) - x * x
    hit = min(0.1, LIKELIHOOD.least_hit + 4.0 * foreign_per_hour / 3600.0 * LIKELIHOOD.place_s)
    foreign = (
        math.log(hit)
        - np.log(LIKELIHOOD.strengths_log * np.maximum(x, math.sqrt(bursts)))
        - noise
    )
    # Strengths tried: that of each pulse position, and their mean.
    mean = np.where(usable, x, 0.0).sum(axis=1) / np.maximum(usable.sum(axis=1), 1)
    tried = np.maximum(np.concatenate((x, mean[:, None]), axis=1), 1.4 * math.sqrt(bursts))
    variance = 0.5 + (LIKELIHOOD.fading * tried[:, :, None]) ** 2 / bursts
    pulse = -((x[:, None] - tried[:, :, None]) ** 2) / (2.0 * variance)
    pulse -= 0.5 * np.log(2.0 * np.pi * variance) + noise[:, None]
    # A weaker signal does not hide a pulse.
    hidden = np.where(
        x[:, None] >= LIKELIHOOD.hiding_amplitude * tried[:, :, None], foreign[:, None], -np.inf
    )
    listed = np.where(usable[:, None], np.logaddexp(pulse, hidden), 0.0)
    best = listed.sum(axis=2).argmax(axis=1)
    rows = np.arange(len(x))
    own = usable & (pulse[rows, best] >= hidden[rows, best])
    over_noise = np.where(own, pulse[rows, best], 0.0).sum(axis=1)
    # An unlisted code has pulses at some positions, never at all: sum over the first position
    # without one.
    lacks = np.logaddexp(0.0, foreign)[:, None] + np.zeros_like(pulse)
    has = math.log(LIKELIHOOD.coincidence) + pulse
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
    """Log-likelihood ratio of listed to unlisted codes, for bursts at the tag's interval."""
    places = alone.sum(axis=0)[usable.any(axis=0)]
    return float(places.min()) - (len(places) - 1) * math.log(LIKELIHOOD.coincidence)


def evidence_of_sums(
    energies: NDArray[np.float64], *, foreign_per_hour: float, in_step: float
) -> NDArray[np.float64]:
    """Log-likelihood ratio to unlisted codes, for bursts that only their sum detects.

    `energies` (n, bursts, pulses). `in_step`: probability that bursts have the tag's interval
    by chance.
    """
    # Either one unlisted tag is in step by chance, or pulses of several tags are.
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
    return np.minimum(by_one - math.log(min(1.0, LIKELIHOOD.sums_tried * in_step)), by_several)
