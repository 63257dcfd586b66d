"""Likelihood of a position from powers along a track, with unknown level and path loss.

The model is z = P - 10 n log10(r / 100 m) + G + e, where e is fading that is correlated along
the track (first-order autoregressive). At a given position it is linear in P and n, so P, n and
the size of the fading are integrated out in closed form. The correlation is summed over several
values. Missed pulses are included as "below the threshold".
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows, joined_rows
from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.antenna import AntennaPattern, monopole_gain_db
from uavrt.localization.position.levels.censored_power import (
    PowerFit,
    censored_fit,
    correlation_over_hills,
    dot,
    lasting_correlation,
    regression_sums,
    thinned,
)
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.over_hills import TrackHillLosses, track_error_db
from uavrt.localization.position.tuning import POWER
from uavrt.localization.tuning import LEVELS

_DB = 10.0 / np.log(10.0)

_Floats = NDArray[np.float64]
_Reals = NDArray[np.floating]
"""Array of real numbers, usually in single precision."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerTrack:
    """Expected pulses along a track, each received or missed."""

    latitude_deg: _Floats
    longitude_deg: _Floats
    height_m: _Floats
    snr_db: _Floats
    """Energy of each pulse over the median noise [dB], shape (n,), NaN if missed. It equals the
    SNR if the noise is constant."""
    threshold_db: float | _Floats = LEVELS.threshold_db
    """SNR above which a missed pulse would have been detected [dB]; shape (n,) if it varies."""
    antenna: AntennaPattern | None = None
    """Antenna pattern, which requires `yaw_deg`; None for an upright monopole."""
    yaw_deg: _Floats | None = None
    """Direction of the boresight at each pulse, clockwise from true north [deg], shape (n,)."""
    time_s: _Floats | None = None
    """Times of the pulses [s], ascending, shape (n,); None for a tag that rests."""
    origin_ns: int = 0
    """UTC time of `time_s` 0 [ns]; 0 if unknown."""

    def chosen(self, kept: NDArray[np.bool_]) -> "PowerTrack":
        """Return the part of the track that an index array or a mask of pulses selects."""
        return chosen_rows(self, kept)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PulseGeometry:
    """Horizontal offsets from pulses to positions, shape (places, pulses); they are valid for
    any height.
    """

    east_m: _Reals
    north_m: _Reals
    square_m2: _Reals
    log_square: _Reals
    rise_m: _Reals | None = None
    """Height of the ground relative to that at the take-off [m], shape (places, 1); None for
    level ground."""
    lost_db: _Reals | None = None
    """Loss behind hills for a tag at each position [dB], shape (places, pulses); None for level
    ground."""


def fit_each(
    several: Sequence["PowerEvidence"], east_m: _Floats, north_m: _Floats
) -> list[PowerFit]:
    """Fit several `PowerEvidence` objects at once whose tracks differ only in height."""
    first = several[0]
    fits = []
    together = max(1, POWER.together // len(first.used))
    for start in range(0, len(east_m), together):
        part = slice(start, start + together)
        seen = first.seen_from(east_m[part], north_m[part], first.used)
        fits.append([one.fitted(seen) for one in several])
    return [joined_rows(own) for own in zip(*fits, strict=True)]


class PowerEvidence:
    """Log-likelihood of positions, given powers along a track.

    `correlation` is that of neighbouring pulses' fading; it is used if pulses were missed (see
    `correlation_at_best`). Without missed pulses the correlation is integrated out.
    """

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        track: PowerTrack,
        propagation: Propagation,
        *,
        correlation: float = 0.0,
        over_hills: TrackHillLosses | None = None,
    ) -> None:
        self.over_hills = over_hills
        self._correlation = correlation
        self._east_m, self._north_m = east_m, north_m
        self._track = track
        self._prior = propagation
        self._heard = ~np.isnan(track.snr_db)
        self._mean_db = float(np.nanmean(track.snr_db))
        missed, self.miss_weight = thinned(np.flatnonzero(~self._heard))
        """Number of misses that each used one represents."""
        self.used = np.concatenate([np.flatnonzero(self._heard), missed])
        """Indices of the used pulses: received ones, then misses, thinned out if many."""

    def losing(self, factor: float) -> "PowerEvidence":
        """Return a copy in which all losses behind hills are multiplied by a factor."""
        other = copy(self)
        if self.over_hills is not None:
            other.over_hills = replace(self.over_hills, factor=factor)
        return other

    def fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        """Fit level and exponent at each of the positions (places,)."""
        return fit_each([self], east_m, north_m)[0]

    def fitted(self, seen: "PulseGeometry") -> PowerFit:
        """Fit level and exponent at positions, given their geometry to the pulses."""
        count = int(self._heard.sum())
        loss, gain = self._propagated(seen, self.used)
        heard = self._over_mean(self.used[:count], loss[:, :count], gain[:, :count])
        if self.over_hills is None and count == len(self._heard):
            fit = _fit_of_heard(*heard, self._prior)
        else:
            limits_db = np.broadcast_to(self._track.threshold_db, self._heard.shape)
            limit_db = limits_db[self.used[count:]] - self._mean_db
            fit = censored_fit(
                *heard,
                loss[:, count:].astype(np.float64),
                limit_db - gain[:, count:].astype(np.float64),
                self.miss_weight,
                self._prior,
                correlation=self._correlation,
            )
        return replace(fit, level_db=fit.level_db + self._mean_db)

    def _with_every_miss(self) -> "PowerEvidence":
        other, missed = copy(self), np.flatnonzero(~self._heard)
        other.used = np.concatenate([np.flatnonzero(self._heard), missed])
        other.miss_weight = np.ones(len(missed))
        return other

    def correlation_at_best(self, east_m: _Floats, north_m: _Floats) -> float:
        """Correlation of neighbouring pulses' fading, at the likeliest of the positions."""
        top = int(np.argmax(self.fit(east_m, north_m).log_likelihood))
        place = east_m[top : top + 1], north_m[top : top + 1]
        every = self._with_every_miss()
        fit = every.fit(*place)
        loss, z = self._heard_from(*place)
        residual = z[0] - (fit.level_db[0] - self._mean_db) - fit.exponent[0] * loss[0]
        if fit.missed_db is not None:
            # Received pulses alone would seem alike: near the threshold all are above the fit.
            residual = np.concatenate([residual, fit.missed_db[0]])[np.argsort(every.used)]
        if self.over_hills is None:
            return lasting_correlation(residual)
        over = self.over_hills.chosen(np.flatnonzero(self._heard))
        lost_db = over.lost_db(*place)[0]
        step_m = np.median(np.hypot(np.diff(self._east_m), np.diff(self._north_m)))
        alike = float(np.clip(POWER.same_error_m / max(step_m, 1e-3), 1.0, len(residual)))
        by_hills = correlation_over_hills(residual, track_error_db(lost_db), alike)
        return max(lasting_correlation(residual), by_hills)

    def fit_with_foreign(self, east_m: _Floats, north_m: _Floats) -> tuple[_Floats, _Floats]:
        """Fit the received pulses at positions (places,), allowing for some from another
        sender.

        Returns residuals (places, received) [dB] and log-likelihood (places,).
        """
        loss, z = self._heard_from(east_m, north_m)
        none = np.zeros((len(loss), 0))
        fit = censored_fit(loss, z, none, none, np.zeros(0), self._prior, foreign=True)
        residual = z - fit.level_db[:, None] - fit.exponent[:, None] * loss
        return residual, fit.log_likelihood

    def _heard_from(self, east_m: _Floats, north_m: _Floats) -> tuple[_Reals, _Reals]:
        """Distance terms and SNR without antenna gain of received pulses, shape (places,
        received) each.

        The distance terms are -10 log10(r / 100 m). The SNR is relative to its mean, minus the
        antenna's gain [dB].
        """
        heard = np.flatnonzero(self._heard)
        return self._over_mean(heard, *self.propagation(east_m, north_m, heard))

    def _over_mean(
        self, heard: NDArray[np.intp], loss: _Reals, gain: _Reals
    ) -> tuple[_Reals, _Reals]:
        return loss, (self._track.snr_db[heard] - self._mean_db).astype(np.float32) - gain

    def propagation(
        self, east_m: _Floats, north_m: _Floats, pulses: NDArray[np.intp]
    ) -> tuple[_Reals, _Reals]:
        """Distance terms -10 log10(r / 100 m) and antenna gain [dB], shape (places, pulses), in
        single precision.
        """
        return self._propagated(self.seen_from(east_m, north_m, pulses), pulses)

    def seen_from(
        self, east_m: _Floats, north_m: _Floats, pulses: NDArray[np.intp]
    ) -> "PulseGeometry":
        """Return the geometry from the drone's positions at pulses to possible tag positions on
        the ground.
        """
        single = np.float32
        dx = east_m.astype(single)[:, None] - self._east_m[pulses].astype(single)[None, :]
        dy = north_m.astype(single)[:, None] - self._north_m[pulses].astype(single)[None, :]
        ground = dx * dx + dy * dy
        log_ground = np.log(np.maximum(ground, single(1e-6)))
        seen = PulseGeometry(east_m=dx, north_m=dy, square_m2=ground, log_square=log_ground)
        if self.over_hills is None:
            return seen
        over = self.over_hills.chosen(pulses)
        rise = over.hills.rise_m(east_m, north_m)[:, np.newaxis].astype(single)
        return replace(seen, rise_m=rise, lost_db=over.lost_db(east_m, north_m))

    def _propagated(
        self, seen: "PulseGeometry", pulses: NDArray[np.intp]
    ) -> tuple[_Reals, _Reals]:
        loss, gain = self._over_level(seen, pulses)
        return loss, gain if seen.lost_db is None else gain - seen.lost_db

    def _over_level(
        self, seen: "PulseGeometry", pulses: NDArray[np.intp]
    ) -> tuple[_Reals, _Reals]:
        single, ground = np.float32, seen.square_m2
        height: _Reals = self._track.height_m[pulses].astype(single)[None, :]
        if seen.rise_m is not None:
            height = height - seen.rise_m
        height = np.maximum(np.abs(height), single(0.5))
        slant = ground + height * height
        log_slant = np.log(slant)
        loss = single(-0.5 * _DB) * (log_slant - single(2.0 * np.log(POWER.reference_m)))
        if self._track.antenna is None or self._track.yaw_deg is None:
            # cos² of the elevation is ground / slant; the scatter floor is that of the pattern
            flat = seen.log_square - log_slant
            return loss, np.maximum(single(_DB) * flat, single(_FLOOR_DB))
        bearing = (
            np.arctan2(seen.east_m, seen.north_m)
            - np.radians(self._track.yaw_deg[pulses])[None, :]
        )
        forward = np.cos(bearing) * np.sqrt(ground / slant)
        right = np.sin(bearing) * np.sqrt(ground / slant)
        down = height / np.sqrt(slant)
        return loss, self._track.antenna.gain_towards_db(forward, right, down)


_FLOOR_DB = float(monopole_gain_db(90.0))


@lru_cache(maxsize=16)
def _correlations(count: int) -> _Floats:
    """Trial correlations of fading, 2.5 standard errors apart in Fisher's transform, shape
    (m,).
    """
    step = min(POWER.widest_step, 2.5 / count**0.5)
    return np.asarray(np.tanh(np.arange(0.0, np.arctanh(POWER.most_correlation), step)))


def _fit_of_heard(x: _Reals, z: _Reals, prior: Propagation) -> PowerFit:
    """Fit positions to received pulses without missed ones; x is the distance term, z the power
    (places, pulses).

    Level, exponent, and the fading's size and correlation are integrated out. The precision of
    a first-order process with correlation rho has three terms, divided by 1 - rho²: the sum
    over all pulses, plus rho² times the sum over the inner pulses, minus 2 rho times the sum
    over adjacent pairs. The prior of the fading's size has the weight of one pulse with typical
    fading, which matters for two or three pulses. The constant is included, so that likelihoods
    of different numbers of pulses can be compared.
    """

    def at(number: int) -> _Floats:
        a, b = (one[:, number].astype(np.float64) for one in (x, z))
        return np.stack([a, b, a * a, a * b, b * b])

    places, count = x.shape
    whole, ends = regression_sums(x, z), at(0) + at(-1)
    (x1, z1), (x0, z0) = (x[:, 1:], z[:, 1:]), (x[:, :-1], z[:, :-1])
    both = [dot(x1, x0), 0.5 * (dot(x1, z0) + dot(x0, z1)), dot(z1, z0)]
    exponent = prior.exponent ** np.arange(3)
    known = np.zeros((5, 1))
    known[2:, 0] = (LEVELS.fading_db / max(prior.exponent_sigma, 1e-3)) ** 2 * exponent
    terms = np.stack(
        [
            whole + known,
            whole - ends - known,
            -2.0 * np.concatenate([whole[:2] - 0.5 * ends[:2], both]),
        ]
    )
    rho = _correlations(count)
    white = (1.0 - rho**2)[:, np.newaxis]
    of_rho = np.stack([np.ones(len(rho)), rho**2, rho], axis=1)
    ones = (of_rho @ [count, max(0, count - 2), -2.0 * (count - 1)])[:, np.newaxis]
    sums = (of_rho @ terms.reshape(3, -1)).reshape(-1, 5, places)
    x_sum, z_sum, xx, xz, zz = np.moveaxis(sums, 1, 0)
    determinant = np.maximum(ones * xx - x_sum * x_sum, 1e-9)
    exponent = (ones * xz - x_sum * z_sum) / determinant
    level = (z_sum - exponent * x_sum) / ones
    residual = np.maximum(zz - level * z_sum - exponent * xz, 1e-9) / white
    score = -0.5 * (np.log(determinant) + count * np.log(residual + LEVELS.fading_db**2))
    score -= 0.5 * (count - 3) * np.log(white)
    top = score.max(axis=0)
    weight = np.exp(score - top)
    total = weight.sum(axis=0)
    constant = special.gammaln(0.5 * count) - 0.5 * count * np.log(np.pi) - np.log(len(rho))
    return PowerFit(
        log_likelihood=top + np.log(total) + constant,
        level_db=(weight * level).sum(axis=0) / total,
        exponent=(weight * exponent).sum(axis=0) / total,
    )
