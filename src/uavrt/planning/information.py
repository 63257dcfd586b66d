"""Predict how much information about the tags' positions a path would give.

Under each hypothesis, the levels of a path's pulses are normally distributed around their
expected values. The distances between the expected values bound the information on the
hypotheses (Kolchinsky and Tracey 2017). Levels below the threshold are set to it, so that
hypotheses without a detection remain equal. The unknown signal strength is common to all pulses
of the path; the part of the distances that it could explain is removed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.levels.level_belief import (
    EXPONENT,
    LASTING,
    LEVEL_AT_100_M,
    antenna_gain_db,
)
from uavrt.localization.position.trackers import Hypotheses, TagPrior
from uavrt.localization.position.tuning import LastingError
from uavrt.planning.beliefs import TagBelief
from uavrt.planning.drone_model.drone_motion import Legs

_Singles = NDArray[np.float32]
_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Listener:
    """Reception of pulses at the drone: height above tags, pulse interval and threshold."""

    above_tags_m: float
    pulse_s: float
    threshold_db: float


def expected_levels_db(
    prior: TagPrior,
    some: Hypotheses,
    legs: Legs,
    listener: Listener,
    walked_m: tuple[_Singles, _Singles] | None = None,
) -> tuple[_Singles, _Singles | float]:
    """Return the expected level of each hypothesis along paths [dB], shape (legs, samples,
    hypotheses), and the variance of the lasting error [dB²], shape (legs, samples).

    Hypotheses of a travelling tag continue at their velocity. `walked_m`, the east and north
    displacement of each hypothesis (legs, 1, hypotheses), is added.
    """
    east, north, yaw, time = (
        one.astype(np.float32)[:, :, None]
        for one in (legs.east_m, legs.north_m, legs.yaw_deg, legs.time_s)
    )
    dx, dy = some.east_m - east, some.north_m - north
    if some.east_m_s.any() or some.north_m_s.any():
        dx, dy = dx + some.east_m_s * time, dy + some.north_m_s * time
    if walked_m is not None:
        dx, dy = dx + walked_m[0], dy + walked_m[1]
    ground = prior.ground.along(east, north, dx, dy, listener.above_tags_m)
    height = listener.above_tags_m - ground.rise_m
    slant2 = dx * dx + dy * dy + height**2
    gain = antenna_gain_db(prior.pattern, yaw, dx, dy, height, np.sqrt(slant2))
    known, slopes = ground.slopes(slant2, height)
    level = some.level.mean[LEVEL_AT_100_M] + gain + known
    for slope, unknown in zip(slopes, some.level.mean[1:], strict=True):
        level += slope * unknown
    if prior.path_gain is not None:
        level = level + prior.path_gain(dx, dy, listener.above_tags_m)
    wrong2: _Singles | float = 0.0
    if ground.doubtful_db is not None:
        one2 = some.level.variance(LASTING) * ground.doubtful_db**2
        wrong2 = np.mean(np.broadcast_to(one2, level.shape), axis=2)
    return np.asarray(level, np.float32), wrong2


def information_nats(
    beliefs: Sequence[TagBelief],
    legs: Legs,
    listener: Listener,
    *,
    hypotheses: int = 64,
    others: Legs | None = None,
) -> _Floats:
    """Information that each path would give on each tag's position [nats], shape (tags, legs).

    In `legs`, each sample represents an equal share of the path's time. `hypotheses` is the
    number drawn for each tag; its logarithm limits the information. Information from `others`,
    the paths of other drones, is excluded.
    """
    out = np.empty((len(beliefs), len(legs.duration_s)))
    for number, belief in enumerate(beliefs):
        some = belief.hypotheses(hypotheses)
        own = _pulses(belief.prior, some, legs, listener)
        if others is None:
            out[number] = _heard_nats(belief.prior, some, own)
            continue
        theirs = _pulses(belief.prior, some, others, listener).as_one()
        both = _heard_nats(belief.prior, some, own.joined(theirs))
        out[number] = both - _heard_nats(belief.prior, some, theirs)
    return np.maximum(out, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Pulses:
    """Expected levels and weights of pulses along candidate paths, with path durations."""

    level_db: _Singles
    """Expected SNR of pulses on each path [dB], shape (legs, samples, hypotheses)."""
    per_db2: _Singles
    """Number of pulses divided by the variance of one pulse's level [1/dB²], shape (legs,
    samples)."""
    alike_db2: _Floats
    """Variance of the lasting error that a path's pulses share [dB²], shape (legs,)."""
    span_s: _Floats

    def as_one(self) -> "_Pulses":
        return _Pulses(
            level_db=self.level_db.reshape(1, -1, self.level_db.shape[2]),
            per_db2=self.per_db2.reshape(1, -1),
            alike_db2=self.alike_db2.mean(keepdims=True),
            span_s=self.span_s.max(keepdims=True),
        )

    def joined(self, one: "_Pulses") -> "_Pulses":
        ways, _, hypotheses = self.level_db.shape
        samples = one.level_db.shape[1]
        level = np.broadcast_to(one.level_db, (ways, samples, hypotheses))
        per = np.broadcast_to(one.per_db2, (ways, samples))
        return _Pulses(
            level_db=np.concatenate([self.level_db, level], axis=1),
            per_db2=np.concatenate([self.per_db2, per], axis=1),
            alike_db2=np.maximum(self.alike_db2, one.alike_db2),
            span_s=np.maximum(self.span_s, one.span_s),
        )


def _pulses(prior: TagPrior, some: Hypotheses, legs: Legs, listener: Listener) -> _Pulses:
    samples = legs.time_s.shape[1]
    spans = legs.time_s[:, -1] * samples / max(samples - 0.5, 0.5)
    walked = _walked_m(some, spans)
    level, wrong2 = expected_levels_db(prior, some, legs, listener, walked)
    level = np.maximum(level, np.float32(listener.threshold_db))
    pulses = spans / samples / listener.pulse_s * (1.0 - prior.missed_share)
    noise2 = prior.fading_db**2 + _walked_db2(some, legs, spans, listener.above_tags_m)
    alike2, apart2 = _lasting_variance(
        prior.ground.lasting_error, wrong2, legs, spans / listener.pulse_s
    )
    noise2 = noise2 + apart2
    per_pulse = (pulses[:, None] / noise2).astype(np.float32)
    return _Pulses(level_db=level, per_db2=per_pulse, alike_db2=alike2, span_s=spans)


def _lasting_variance(
    law: LastingError | None, wrong2: _Singles | float, legs: Legs, pulses: _Floats
) -> tuple[_Floats, _Floats | float]:
    """Variance of the lasting error [dB²]: the part common to a path (legs,) and the part per
    pulse (legs, samples).

    All pulses of a turn in place have the same error, so the turn still shows the direction to
    the tag. Along a path the error changes slowly, so pulses that are close together count as
    one.
    """
    if law is None or isinstance(wrong2, float):
        return np.zeros(len(pulses)), 0.0
    far = np.hypot(np.diff(legs.east_m), np.diff(legs.north_m)).sum(axis=1)
    alike = np.exp(-far / law.correlation_m)
    together = np.maximum(
        pulses * np.minimum(law.correlation_m / np.maximum(far, 1.0), 1.0), 1.0
    )
    apart2 = ((1.0 - alike) * together)[:, None] * wrong2
    return alike * wrong2.mean(axis=1), apart2


def _heard_nats(prior: TagPrior, some: Hypotheses, heard: _Pulses) -> _Floats:
    """Information of a path's expected pulses on the tag's position [nats], shape (legs,)."""
    root = np.sqrt(heard.per_db2)
    scaled = heard.level_db * root[:, :, None]
    scaled -= scaled.mean(axis=2, keepdims=True)
    # Of K pulses with a common unknown level of variance v, the mean counts only as
    # 1 / (σ² / K + v).
    drift2 = prior.level_drift_db_per_root_s**2 * heard.span_s
    spread = (
        float(np.mean(some.level.variance(LEVEL_AT_100_M))) + drift2 / 3.0 + heard.alike_db2
    )
    share = np.sqrt(spread / (1.0 + spread * heard.per_db2.sum(axis=1)))
    whole = np.einsum("csp,cs->cp", scaled, root * share[:, None])
    off = minus_quarter_squares(scaled, whole)
    np.minimum(off, 0.0, out=off)
    np.exp(off, out=off)
    return np.asarray(-np.mean(np.log(off.mean(axis=1)), axis=1))


def minus_quarter_squares(scaled: _Singles, whole: _Singles) -> _Singles:
    """(legs, hypotheses, hypotheses) -¼ (distance² - difference of w²) of all pairs.

    For s (legs, samples, hypotheses) and w (legs, hypotheses) it is -¼ (|s_i - s_j|² - (w_i -
    w_j)²). This equals ½ (s_i · s_j - w_i w_j) - ¼ q_i - ¼ q_j with q = |s|² - w², so that one
    matrix product computes it.
    """
    quarter = np.einsum("csp,csp->cp", scaled, scaled)
    quarter -= whole * whole
    quarter *= -0.25
    legs, samples, count = scaled.shape
    left = np.empty((legs, samples + 3, count), np.float32)
    right = np.empty_like(left)
    left[:, :samples], right[:, :samples] = 0.5 * scaled, scaled
    left[:, samples], right[:, samples] = -0.5 * whole, whole
    left[:, samples + 1], right[:, samples + 1] = quarter, 1.0
    left[:, samples + 2], right[:, samples + 2] = 1.0, quarter
    return np.asarray(np.matmul(left.transpose(0, 2, 1), right))


def _walked_m(some: Hypotheses, spans_s: _Floats) -> tuple[_Singles, _Singles] | None:
    """Displacement to the east and north of each hypothesis of a walking tag until each path's
    end [m]; None if no hypothesis walks.
    """
    if not some.wandering_m_per_root_s.any():
        return None
    steps = np.random.default_rng(0).normal(size=(2, 1, 1, len(some.east_m)))
    walk = np.sqrt(spans_s)[:, None, None] * some.wandering_m_per_root_s * steps
    return walk[0].astype(np.float32), walk[1].astype(np.float32)


def _walked_db2(some: Hypotheses, legs: Legs, spans_s: _Floats, above_tags_m: float) -> _Floats:
    """Variance of the level caused by the tag's walk until the path's end [dB²], shape (legs,
    samples).
    """
    walk2 = float(np.mean(some.wandering_m_per_root_s**2))
    if walk2 == 0.0:
        return np.zeros_like(legs.time_s)
    dx = some.east_m - legs.east_m[:, :, None]
    dy = some.north_m - legs.north_m[:, :, None]
    slope2 = np.mean(1.0 / (dx * dx + dy * dy + above_tags_m**2), axis=2)
    per_neper = 10.0 / np.log(10.0) * float(np.mean(some.level.mean[EXPONENT]))
    left = np.maximum(spans_s[:, None] - legs.time_s, 0.0)
    return np.asarray(per_neper**2 * slope2 * walk2 * left)
