"""Errors common to all powers of a survey: a wrong height, pulses of other senders.

A wrong height (terrain, a tag on a tree, a take-off on a hill) changes the place of the minimum
and the slope of the strength; several heights are weighed against each other, with the place.
Pulses of other senders have any strength: a robust fit (Student's law, iteratively reweighted)
finds the approximate place, and pulses far outside the others' scatter there are left out, and
counted.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.censored_power import PowerFit
from uavrt.localization.position.level_evidence import Propagation
from uavrt.localization.position.over_hills import FACTORS, OverHills
from uavrt.localization.position.power_evidence import PowerEvidence, PowerTrack, fit_each
from uavrt.localization.results import Caution

HEIGHT_SIGMA_M = 7.0
"""Standard deviation of a given height over the tag, unless specified."""
_FAR_WRONG_SHARE = 0.1
_FAR_WRONG_SIGMAS = 4.0
"""Standard deviations of rare height errors far beyond the usual."""
_SHIFTS_M = (-30.0, -18.0, -9.0, 0.0, 9.0, 18.0, 28.0, 40.0)
_LEAST_HEIGHT_M = 3.0
_CLOSER_M = np.linspace(-9.0, 9.0, 7)
"""Heights about the mean of those, if it is known to less than `_KNOWN_M`."""
_KNOWN_M = 6.0
"""Standard deviation of the height below which it counts as known."""
_NODES = np.array([-1.5, 0.0, 1.5])
"""Heights weighed with each place, in standard deviations about the mean."""
_LEAST_SIGMA_M = 1.5
_LEAST_BEND = 0.05
"""Least curvature of the parabola through them; its peak must lie between them. Farther out it
exceeds the true value at places where the lowest fits best."""
FOREIGN_SHARE = 0.02
"""Prior share of foreign pulses, each equally probable at any strength within 60 dB."""
_ANY_DB = 60.0
_LOG_FOREIGN = float(np.log(FOREIGN_SHARE / _ANY_DB))
_LOG_OWN = float(np.log(1.0 - FOREIGN_SHARE))
_MOST_READINGS = 4
"""Most choices of foreign pulses that are weighed against each other."""
_NO_MATTER_NATS = 6.0
"""Largest log-probability below the best of a choice that is kept."""
_ALIKE = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Possible shares of its neighbours' fading in a pulse's own."""
_MOST_FOREIGN = 0.25
"""Largest share of outliers; with more, the model is wrong, and nothing is left out."""
_LEAST_PULSES = 20
"""Least number of pulses that determines heights and outliers."""
_HEARD_SHARE = 0.95
"""Least share of heard pulses for which heights are weighed."""
_COARSE, _FINE = 14, 9
_ROUGH_PLACES, _ROUGH_FINE, _ROUGH_PULSES = 2, 7, 400
"""Cells, not neighbours, of a grid twice as fine that are refined, with some of the pulses. A
peak may be narrower than a cell, and the most likely cell that of a mirror image."""
_MARGIN_M = 60.0
_MIRROR_REACH, _MIRROR_CELLS = 1.75, 15
"""Search range for mirror images around the approximate place, in its grid's steps (at most a
line's spacing), and cells along a side of it."""
_MIRROR_NATS = 20.0
"""Largest log-likelihood below the best of such a place with independent pulses: some 4 where
fading is correlated."""
_LEAST_DB = 0.05
"""Resolution of powers; with smaller differences there is no residual."""
_FREEDOM = 3.0
_ROUNDS = 4

_Floats = NDArray[np.float64]


class SurveyEvidence:
    """Log-likelihood of places, given powers along a track of uncertain height.

    `east_m`, `north_m` (n,): the track in the local plane.
    `track`: heights as reported, powers, antenna.
    `over_hills`: losses behind hills; None is level.
    """

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        track: PowerTrack,
        propagation: Propagation,
        height_sigma_m: float,
        over_hills: OverHills | None = None,
    ) -> None:
        self._over_hills = over_hills
        self._east_m, self._north_m, self._track = east_m, north_m, track
        self._propagation, self._height_sigma_m = propagation, height_sigma_m
        self.kept = np.ones(len(track.snr_db), bool)
        """(n,) pulses that are not attributed to other senders."""
        self.height_shift_m = 0.0
        """Mean over the weighed heights."""
        self.height_right_probability = 1.0
        """Probability that the height is wrong by less than 10 m."""
        self._correlation = 0.0
        heard = ~np.isnan(track.snr_db)
        if over_hills is not None or not np.all(heard):
            self._correlation = self._lasting()
        shifts_m, self._log_prior = np.zeros(1), np.zeros(1)
        readings = [self.kept]
        if int(heard.sum()) >= _LEAST_PULSES:
            place, spread_m, shift_m = self._roughly(heard)
            readings = self._readings(heard, place, spread_m, shift_m)
            self.kept = readings[0]
            # What is made of misses compares places, but not heights: a flight whose heights
            # were true, with half of its pulses missed, was taken for one 30 m lower.
            if height_sigma_m > 0.0 and np.mean(heard) >= _HEARD_SHARE:
                shifts_m = self._weigh_heights(place, spread_m)
                self._log_prior = self._log_prior_of(shifts_m)
        self._read = [
            (
                [self._evidence(float(shift), kept) for shift in shifts_m],
                _log_prior_of_reading(kept),
            )
            for kept in readings
        ]
        """Evidences of the heights for each choice of used pulses, and its prior."""

    @property
    def foreign(self) -> int:
        """Number of pulses attributed to other senders."""
        return int(np.sum(~self.kept))

    def fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        """Fit level and exponent at each of some places (places,)."""
        if self._over_hills is None:
            return _over_readings(
                [
                    (self._fit_heights(heights, east_m, north_m), log_prior)
                    for heights, log_prior in self._read
                ]
            )
        score = np.full(len(east_m), -np.inf)
        middle = None
        ((own, _),) = self._read
        for factor, share in FACTORS:
            heights = [one.losing(factor) for one in own]
            found = self._fit_heights(heights, east_m, north_m)
            score = np.logaddexp(score, found.log_likelihood + np.log(share))
            middle = found if factor == 1.0 else middle
        assert middle is not None
        return replace(middle, log_likelihood=score)

    def _fit_heights(
        self, heights: list[PowerEvidence], east_m: _Floats, north_m: _Floats
    ) -> PowerFit:
        if len(heights) == 1:
            return heights[0].fit(east_m, north_m)
        fits = fit_each(heights, east_m, north_m)
        score = np.stack([one.log_likelihood for one in fits]) + self._log_prior[:, None]
        return _most_likely(fits, score, _over_heights(score))

    def _evidence(self, shift_m: float, kept: NDArray[np.bool_] | None = None) -> PowerEvidence:
        kept = self.kept if kept is None else kept
        track = self._track.chosen(kept)
        height_m = np.maximum(track.height_m + shift_m, _LEAST_HEIGHT_M)
        over = self._over_hills
        return PowerEvidence(
            self._east_m[kept],
            self._north_m[kept],
            replace(track, height_m=height_m),
            self._propagation,
            correlation=self._correlation,
            over_hills=None if over is None else over.chosen(kept),
        )

    def _lasting(self) -> float:
        """Correlation of neighbouring pulses' fading, where pulses were missed."""
        north, east = (one.ravel() for one in np.meshgrid(*reversed(self._coarsely(_COARSE))))
        return self._evidence(0.0).correlation_at_best(east, north)

    def _coarsely(self, count: int) -> tuple[_Floats, _Floats]:
        """East and north of a coarse grid over the survey."""
        east, north = (
            np.linspace(float(axis.min()) - _MARGIN_M, float(axis.max()) + _MARGIN_M, count)
            for axis in (self._east_m, self._north_m)
        )
        return east, north

    def _shifts(self) -> tuple[float, ...]:
        """Heights to weigh, all above the ground."""
        if self._height_sigma_m <= 0.0:
            return (0.0,)
        lowest = float(np.median(self._track.height_m)) - _LEAST_HEIGHT_M
        return tuple(one for one in _SHIFTS_M if one > -lowest)

    def _roughly(self, heard: NDArray[np.bool_]) -> tuple[tuple[float, float], float, float]:
        """Place, its search radius, and height shift of the best robust fit."""
        some = np.zeros(len(heard), bool)
        pulses = np.flatnonzero(heard)
        some[pulses[:: -(-len(pulses) // _ROUGH_PULSES)]] = True
        east, north = self._coarsely(2 * _COARSE)
        step = max(float(east[1] - east[0]), float(north[1] - north[0]))
        y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
        score = self._robust(x, y, some, 0.0)[2]
        off = np.linspace(-step, step, _ROUGH_FINE)
        shifts = self._shifts()[::2] if len(self._shifts()) > 1 else (0.0,)
        found = []
        for _ in range(_ROUGH_PLACES):
            top = int(np.argmax(score))
            found += [
                (*self._best_of(x[top] + off, y[top] + off, some, shift_m), shift_m)
                for shift_m in shifts
            ]
            score[np.hypot(x - x[top], y - y[top]) < 1.5 * step] = -np.inf
        _, best, shift_m = max(found, key=lambda one: one[0])
        return best, 2.0 * step, shift_m

    def _best_of(
        self, east: _Floats, north: _Floats, heard: NDArray[np.bool_], shift_m: float
    ) -> tuple[float, tuple[float, float]]:
        y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
        _, _, score = self._robust(x, y, heard, shift_m)
        top = int(np.argmax(score))
        return float(score[top]), (float(x[top]), float(y[top]))

    def _robust(
        self, east_m: _Floats, north_m: _Floats, heard: NDArray[np.bool_], shift_m: float
    ) -> tuple[_Floats, _Floats, _Floats]:
        """Residuals (places, heard), their scale (places,), and Student's score (places,)."""
        evidence = self._evidence(shift_m)
        loss, gain = evidence.propagation(east_m, north_m, np.flatnonzero(heard[self.kept]))
        z = self._track.snr_db[heard & self.kept] - gain
        weight = np.ones_like(z)
        prior = (4.0 / self._propagation.exponent_sigma) ** 2
        for _ in range(_ROUNDS):
            ones, x = weight.sum(axis=1), np.sum(weight * loss, axis=1)
            level_sum, xz = np.sum(weight * z, axis=1), np.sum(weight * loss * z, axis=1)
            xx = np.sum(weight * loss**2, axis=1) + prior
            xz = xz + prior * self._propagation.exponent
            slope = (ones * xz - x * level_sum) / np.maximum(ones * xx - x * x, 1e-9)
            level = (level_sum - slope * x) / ones
            residual = z - level[:, None] - slope[:, None] * loss
            scale = np.sqrt(np.mean(weight * residual**2, axis=1) + _LEAST_DB**2)
            weight = (_FREEDOM + 1.0) / (_FREEDOM + (residual / scale[:, None]) ** 2)
        law = np.log1p((residual / scale[:, None]) ** 2 / _FREEDOM)
        score = -z.shape[1] * np.log(scale) - 0.5 * (_FREEDOM + 1.0) * law.sum(axis=1)
        return residual, scale, score

    def _readings(
        self,
        heard: NDArray[np.bool_],
        place: tuple[float, float],
        step_m: float,
        shift_m: float,
    ) -> list[NDArray[np.bool_]]:
        """Choices of used pulses (n,), the most probable first.

        Pulses are left out if another sender is more probable than their deviation. That
        depends on the place: right beneath the drone a monopole receives nothing, and a weak
        foreign pulse looks like a tag there. So outliers are determined for places around the
        approximate one, and beneath weak pulses. Where pulses were missed, or over hills,
        likelihoods of different pulses do not compare; then only outliers at all of those
        places are left out.
        """
        off = np.linspace(-_MIRROR_REACH * step_m, _MIRROR_REACH * step_m, _MIRROR_CELLS)
        north, east = (one.ravel() for one in np.meshgrid(place[1] + off, place[0] + off))
        near = np.hypot(self._east_m - place[0], self._north_m - place[1])
        beneath = heard & (near <= _MIRROR_REACH * step_m)
        east = np.concatenate([east, self._east_m[beneath]])
        north = np.concatenate([north, self._north_m[beneath]])
        residual, _, score = self._robust(east, north, heard, shift_m)
        residual = residual[score > score.max() - _MIRROR_NATS]
        innovation, sigma = _unlike_neighbours(residual)
        own = np.exp(-0.5 * (innovation / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
        odd = (1.0 - FOREIGN_SHARE) * own < FOREIGN_SHARE / _ANY_DB
        found: list[NDArray[np.bool_]] = []
        if self._over_hills is None and np.all(heard):
            mixed = np.log((1.0 - FOREIGN_SHARE) * own + FOREIGN_SHARE / _ANY_DB).sum(axis=1)
            near_best = np.flatnonzero(mixed > mixed.max() - _MIRROR_NATS)
            for number in near_best[np.argsort(-mixed[near_best], kind="stable")]:
                if not any(np.array_equal(odd[number], one) for one in found):
                    found.append(odd[number])
                if len(found) == _MOST_READINGS:
                    break
        else:
            found.append(np.all(odd, axis=0))
        readings = []
        for one in found:
            if np.mean(one) <= _MOST_FOREIGN:
                kept = np.ones(len(heard), bool)
                kept[np.flatnonzero(heard)[one]] = False
                readings.append(kept)
        if len(readings) > 1:
            near_best = score > score.max() - _MIRROR_NATS
            weighed = [
                np.logaddexp.reduce(
                    self._evidence(shift_m, kept)
                    .fit(east[near_best], north[near_best])
                    .log_likelihood
                )
                + _log_prior_of_reading(kept)
                for kept in readings
            ]
            order = np.argsort(weighed)[::-1]
            least = max(weighed) - _NO_MATTER_NATS
            readings = [readings[number] for number in order if weighed[number] >= least]
        return readings or [np.ones(len(heard), bool)]

    def _weigh_heights(self, place: tuple[float, float], step_m: float) -> _Floats:
        """Distribution of the height error, and three heights that represent it."""
        shifts = np.array(self._shifts())
        weight = self._weights(shifts, place, step_m)
        mean = float(weight @ shifts)
        variance = float(weight @ (shifts - mean) ** 2)
        self.height_shift_m = mean
        self.height_right_probability = float(weight[np.abs(shifts) < 10.0].sum())
        lowest = _LEAST_HEIGHT_M - float(np.median(self._track.height_m))
        if variance < _KNOWN_M**2:
            shifts = mean + _CLOSER_M
            shifts = shifts[shifts > lowest]
            weight = self._weights(shifts, place, step_m)
            mean = float(weight @ shifts)
            variance = float(weight @ (shifts - mean) ** 2)
        nodes = max(variance**0.5, _LEAST_SIGMA_M) * _NODES
        nodes += max(mean, lowest - float(nodes[0]))
        return np.asarray(nodes)

    def _weights(self, shifts_m: _Floats, place: tuple[float, float], step_m: float) -> _Floats:
        """(shifts,) probability of each, over the places around one."""
        off = np.linspace(-1.5 * step_m, 1.5 * step_m, _FINE)
        north, east = (one.ravel() for one in np.meshgrid(place[1] + off, place[0] + off))
        each = [self._evidence(float(shift)) for shift in shifts_m]
        fits = fit_each(each, east, north)
        score = np.array([np.logaddexp.reduce(one.log_likelihood) for one in fits])
        score += self._log_prior_of(shifts_m) + np.log(np.gradient(shifts_m))
        weight = np.exp(score - score.max())
        return np.asarray(weight / weight.sum())

    def _log_prior_of(self, shifts_m: _Floats) -> _Floats:
        sigma = self._height_sigma_m
        usual = (1.0 - _FAR_WRONG_SHARE) * _normal(shifts_m, sigma)
        far_wrong = _FAR_WRONG_SHARE * _normal(shifts_m, _FAR_WRONG_SIGMAS * sigma)
        return np.asarray(np.log(usual + far_wrong))


def cautions_of_survey(evidence: SurveyEvidence) -> tuple[Caution, ...]:
    """Cautions on a survey's powers."""
    found = []
    if evidence.height_right_probability < 0.1:
        text = (
            f"signal strengths fit a height {abs(evidence.height_shift_m):.0f} m "
            f"{'greater' if evidence.height_shift_m > 0.0 else 'less'} than reported: "
            "check the terrain and the take-off position"
        )
        found.append(Caution(name="height", text=text))
    if evidence.foreign >= max(2, 0.01 * len(evidence.kept)):
        text = (
            f"{evidence.foreign} of {len(evidence.kept)} pulses do not fit the others and are "
            "left out: perhaps someone else's"
        )
        found.append(Caution(name="foreign", text=text))
    return tuple(found)


def _log_prior_of_reading(kept: NDArray[np.bool_]) -> float:
    """Log-prior of a choice of used pulses (n,); the others are of any strength."""
    return float(np.sum(~kept)) * _LOG_FOREIGN + float(np.sum(kept)) * _LOG_OWN


def _unlike_neighbours(residual: _Floats) -> tuple[_Floats, _Floats]:
    """Deviation of pulses from their neighbours' estimate, (places, n), and its usual size.

    Correlated fading makes neighbours similar, so a pulse may be an outlier among them that is
    usual elsewhere. The similarity is measured by medians, which one outlier does not move.
    """
    padded = np.pad(residual, ((0, 0), (2, 2)), mode="reflect")
    count = residual.shape[1]
    around = np.stack([padded[:, first : first + count] for first in (0, 1, 3, 4)])
    around = np.sort(around, axis=0)
    level = 0.5 * (around[1] + around[2])
    middle = np.median(residual, axis=1)[:, None]
    each = np.stack([residual - middle - alike * (level - middle) for alike in _ALIKE])
    size = 1.4826 * np.median(np.abs(each), axis=2)
    best = np.argmin(size, axis=0)
    places = np.arange(len(residual))
    return each[best, places], np.maximum(size[best, places], 1.0)[:, None]


def _over_readings(fits: Sequence[tuple[PowerFit, float]]) -> PowerFit:
    """Sum the likelihood over choices of used pulses; level and exponent of the best."""
    if len(fits) == 1:
        return fits[0][0]
    score = np.stack([fit.log_likelihood + log_prior for fit, log_prior in fits])
    return _most_likely([fit for fit, _ in fits], score, np.logaddexp.reduce(score))


def _most_likely(fits: Sequence[PowerFit], score: _Floats, log_likelihood: _Floats) -> PowerFit:
    """Level and exponent of the fit with the best score (fits, places) at each place."""
    best = np.argmax(score, axis=0)[None]
    return PowerFit(
        log_likelihood=log_likelihood,
        level_db=np.take_along_axis(np.stack([one.level_db for one in fits]), best, 0)[0],
        exponent=np.take_along_axis(np.stack([one.exponent for one in fits]), best, 0)[0],
    )


def _over_heights(score: _Floats) -> _Floats:
    """(places,) logarithm of the integral over three heights (3, places), one step apart.

    The score's parabola for each place also finds heights between the three.
    """
    low, middle, high = score
    bend = np.maximum(middle - 0.5 * (low + high), _LEAST_BEND)
    slope = 0.5 * (high - low)
    vertex = np.clip(0.5 * slope / bend, -1.0, 1.0)
    return np.asarray(middle + (slope - bend * vertex) * vertex - 0.5 * np.log(bend))


def _normal(value: _Floats, sigma: float) -> _Floats:
    return np.asarray(np.exp(-0.5 * (value / sigma) ** 2) / sigma)
