"""Rényi information of measurements along a path (TrackerBots)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.beliefs import TagBelief
from uavrt.planning.drone_model.drone_motion import Legs
from uavrt.planning.information import Listener, expected_levels_db
from uavrt.planning.situation import Situation

_Floats = NDArray[np.float64]


def pulses_along(
    situation: Situation, east_m: _Floats, north_m: _Floats, span_s: float
) -> Legs:
    """Paths sampled at the times of the pulses in a span."""
    time = np.arange(1, max(1, round(span_s / situation.pulse_s)) + 1) * situation.pulse_s
    times = np.broadcast_to(time, (len(east_m), len(time)))
    return situation.vehicle.along(situation.state, east_m, north_m, situation.wind, times)


def renyi_nats(
    beliefs: Sequence[TagBelief],
    legs: Legs,
    listener: Listener,
    rng: np.random.Generator,
    *,
    alpha: float = 0.1,
    measurements: int = 50,
    hypotheses: int = 500,
) -> _Floats:
    """Expected Rényi divergence of the posterior from the prior [nats], shape (tags, legs).

    R = log(Σ w^α w'^(1-α)) / (α - 1), the mean over measurements drawn from the hypotheses. In
    the limit of α = 1 it is Shannon's information.

    `legs`: a pulse at each sample.
    `measurements`: number drawn for each tag and path.
    """
    out = np.empty((len(beliefs), len(legs.duration_s)))
    for number, belief in enumerate(beliefs):
        prior = belief.prior
        some = belief.hypotheses(hypotheses)
        level, _ = expected_levels_db(prior, some, legs, listener)
        true = rng.integers(0, hypotheses, measurements)
        noise = rng.normal(0.0, prior.fading_db, (*level.shape[:2], measurements))
        drawn = np.maximum(level[:, :, true] + noise, listener.threshold_db)
        seen = np.maximum(level, np.float32(listener.threshold_db))
        off = (drawn[:, :, :, None] - seen[:, :, None, :]) / prior.fading_db
        log_p = -0.5 * np.einsum("csmp,csmp->cmp", off, off)
        top = log_p.max(axis=2, keepdims=True)
        p = np.exp(log_p - top)
        if abs(1.0 - alpha) < 1e-3:
            mean = np.maximum(p.mean(axis=2), 1e-300)
            posterior = p / p.sum(axis=2, keepdims=True)
            gain = np.einsum("cmp,cmp->cm", posterior, log_p - top) - np.log(mean)
        else:
            part = np.log(np.mean(p ** (1.0 - alpha), axis=2))
            gain = (part - (1.0 - alpha) * np.log(p.mean(axis=2))) / (alpha - 1.0)
        out[number] = gain.mean(axis=1)
    return out
