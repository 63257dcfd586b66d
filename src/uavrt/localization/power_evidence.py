"""What powers heard along a track say about a place, with level and path loss unknown.

The model is z = P - 10 n log10(r / 100 m) + G + e, e being fading that lasts along the track
(first-order autoregressive). For a given place it is linear in P and n, so that both, and the
fading's size, integrate out in closed form; the correlation is summed over some values. Misses
enter as "below the threshold".
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern, monopole_gain_db
from uavrt.localization.censored_power import censored_fit, thinned
from uavrt.localization.level_evidence import Propagation

REFERENCE_M = 100.0
_TYPICAL_FADING_DB = 4.0
_DB = 10.0 / np.log(10.0)
_TOGETHER = 120_000
"""Numbers that are worked on at once: what the processor's cache holds."""
_CORRELATIONS = (0.0, 0.3, 0.5, 0.7, 0.85, 0.93)

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerTrack:
    """Pulses heard, or listened for in vain, along a track."""

    latitude_deg: _Floats
    """(n,) of the drone."""
    longitude_deg: _Floats
    height_m: _Floats
    """(n,) of the drone above the tag."""
    snr_db: _Floats
    """(n,) NaN for a miss."""
    threshold_db: float = 10.0
    """SNR that a missed pulse must have had to be heard."""
    antenna: AntennaPattern | None = None
    """None is an upright monopole; else `yaw_deg` must be given."""
    yaw_deg: _Floats | None = None
    """(n,) boresight, clockwise from true north."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerFit:
    """Level and path loss at each place."""

    log_likelihood: _Floats
    """(places,)."""
    level_db: _Floats
    """(places,) SNR at 100 m."""
    exponent: _Floats
    """(places,) path loss exponent."""


class PowerEvidence:
    """Log-likelihood of places, given powers along a track.

    Parameters
    ----------
    east_m, north_m : (n,) float64 arrays
        The track in the local plane.
    track : PowerTrack
        Heights, powers, antenna.
    propagation : Propagation
        Prior of the path loss exponent.
    lasting : bool
        Fading may last from pulse to pulse.
    """

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        track: PowerTrack,
        propagation: Propagation,
        *,
        lasting: bool = True,
    ) -> None:
        self._correlations = _CORRELATIONS if lasting else _CORRELATIONS[:1]
        self._east_m, self._north_m = east_m, north_m
        self._track = track
        self._prior = propagation
        self._heard = ~np.isnan(track.snr_db)

    def fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        """Fit level and exponent at each of some places (places,)."""
        if not np.all(self._heard):
            return self._fit(east_m, north_m)  # misses weigh all places together
        size = max(1, _TOGETHER // len(self._heard))
        parts = [
            self._fit(east_m[first : first + size], north_m[first : first + size])
            for first in range(0, len(east_m), size)
        ]
        return PowerFit(
            log_likelihood=np.concatenate([one.log_likelihood for one in parts]),
            level_db=np.concatenate([one.level_db for one in parts]),
            exponent=np.concatenate([one.exponent for one in parts]),
        )

    def _fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        heard = np.flatnonzero(self._heard)
        missed, miss_weight = thinned(np.flatnonzero(~self._heard))
        loss, gain = self.propagation(east_m, north_m, heard)
        z = self._track.snr_db[heard] - gain
        if not len(missed):
            return _uncensored(loss, z, self._prior, self._correlations)
        missed_loss, missed_gain = self.propagation(east_m, north_m, missed)
        limit = self._track.threshold_db - missed_gain
        fitted = censored_fit(
            loss,
            z,
            missed_loss,
            limit,
            miss_weight,
            self._prior,
            lasting=len(self._correlations) > 1,
        )
        return PowerFit(
            log_likelihood=fitted.log_likelihood,
            level_db=fitted.level_db,
            exponent=fitted.exponent,
        )

    def propagation(
        self, east_m: _Floats, north_m: _Floats, pulses: NDArray[np.intp]
    ) -> tuple[_Floats, _Floats]:
        """(places, pulses): -10 log10(r / 100 m), and the antenna's gain [dB].

        In single precision, which is several times as fast and errs by a millionth of a dB.
        """
        single = np.float32
        dx = east_m.astype(single)[:, None] - self._east_m[pulses].astype(single)[None, :]
        dy = north_m.astype(single)[:, None] - self._north_m[pulses].astype(single)[None, :]
        ground = dx * dx + dy * dy
        height = np.maximum(np.abs(self._track.height_m[pulses]), 0.5).astype(single)[None, :]
        slant = ground + height * height
        log_slant = np.log(slant)
        loss = (-0.5 * _DB * (log_slant - 2.0 * np.log(REFERENCE_M))).astype(np.float64)
        if self._track.antenna is None or self._track.yaw_deg is None:
            # cos² of the elevation is ground / slant; the scatter floor is that of the pattern
            flat = np.log(np.maximum(ground, single(1e-6))) - log_slant
            return loss, np.maximum(_DB * flat, _FLOOR_DB).astype(np.float64)
        bearing = np.arctan2(dx, dy) - np.radians(self._track.yaw_deg[pulses])[None, :]
        forward = np.cos(bearing) * np.sqrt(ground / slant)
        right = np.sin(bearing) * np.sqrt(ground / slant)
        down = height / np.sqrt(slant)
        return loss, self._track.antenna.gain_towards_db(forward, right, down)


_FLOOR_DB = float(monopole_gain_db(90.0))


def _uncensored(
    loss: _Floats, z: _Floats, prior: Propagation, correlations: tuple[float, ...]
) -> PowerFit:
    sums = _Sums.of(loss, z, prior)
    score = np.stack([sums.log_marginal(rho) for rho in correlations])
    top = score.max(axis=0)
    weight = np.exp(score - top)
    rho = np.array(correlations) @ weight / weight.sum(axis=0)
    level, exponent = sums.solution(rho)
    return PowerFit(
        log_likelihood=np.log(weight.mean(axis=0)) + top, level_db=level, exponent=exponent
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Sums:
    """Products of the regression, for any correlation along the track.

    The precision of a first-order process with correlation rho is, up to 1 / (1 - rho²), the
    sum over all pulses, plus rho² over the inner ones, minus rho over neighbours both ways.
    """

    whole: _Floats
    """(5, places): sums of x, z, xx, xz, zz; x the loss, z the power."""
    inner: _Floats
    both: _Floats
    count: int
    prior: Propagation

    @classmethod
    def of(cls, x: _Floats, z: _Floats, prior: Propagation) -> "_Sums":
        def dot(a: _Floats, b: _Floats) -> _Floats:
            return np.asarray(np.einsum("ij,ij->i", a, b))

        def at(number: int) -> _Floats:
            a, b = x[:, number], z[:, number]
            return np.stack([a, b, a * a, a * b, b * b])

        whole = np.stack([x.sum(1), z.sum(1), dot(x, x), dot(x, z), dot(z, z)])
        ends = at(0) + at(-1)
        (x1, z1), (x0, z0) = (x[:, 1:], z[:, 1:]), (x[:, :-1], z[:, :-1])
        lagged = np.stack([dot(x1, x0), 0.5 * (dot(x1, z0) + dot(x0, z1)), dot(z1, z0)], axis=0)
        return cls(
            whole=whole,
            inner=whole - ends,
            both=2.0 * np.concatenate([whole[:2] - 0.5 * ends[:2], lagged]),
            count=x.shape[1],
            prior=prior,
        )

    def _normal(self, rho: float | _Floats) -> tuple[float | _Floats, _Floats]:
        ones = self.count + rho**2 * max(0, self.count - 2) - 2.0 * rho * (self.count - 1)
        scale = 1.0 / (1.0 - rho**2)
        return ones * scale, (self.whole + rho**2 * self.inner - rho * self.both) * scale

    def _regressed(self, rho: float | _Floats) -> tuple[_Floats, _Floats, _Floats, _Floats]:
        """Level, exponent, residual (prior's included) and determinant, for each place."""
        prior = (_TYPICAL_FADING_DB / max(self.prior.exponent_sigma, 1e-3)) ** 2
        expected = self.prior.exponent
        ones, (x, z, xx, xz, zz) = self._normal(rho)
        xx, xz, zz = xx + prior, xz + prior * expected, zz + prior * expected**2
        determinant = np.maximum(ones * xx - x * x, 1e-9)
        exponent = (ones * xz - x * z) / determinant
        level = (z - exponent * x) / ones
        residual = np.maximum(zz - level * z - exponent * xz, 1e-9)
        return level, exponent, residual, determinant

    def log_marginal(self, rho: float) -> _Floats:
        """(places,) log-likelihood with level, exponent and fading's size integrated out.

        The size has a prior as if one pulse with the typical fading had been seen, which
        matters when there are but two or three.
        """
        _, _, residual, determinant = self._regressed(rho)
        size = residual + _TYPICAL_FADING_DB**2
        whitening = -0.5 * (self.count - 1) * np.log(1.0 - rho**2)
        return np.asarray(
            whitening - 0.5 * np.log(determinant) - 0.5 * self.count * np.log(size)
        )

    def solution(self, rho: float | _Floats) -> tuple[_Floats, _Floats]:
        """(places,) level and exponent."""
        level, exponent, _, _ = self._regressed(rho)
        return level, exponent
