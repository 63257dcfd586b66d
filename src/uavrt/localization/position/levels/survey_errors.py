"""Estimate errors common to all powers of a survey: a wrong height, and pulses of other
senders.

A wrong height (by terrain, a tag on a tree, or a take-off on a hill) shifts the minimum and
changes the slope of the signal strength. Several heights are compared together with the
position. Pulses of other senders may have any strength. A fit that allows for them finds the
approximate position. Pulses that deviate there much more than most are excluded and counted.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.levels.censored_power import PowerFit
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.over_hills import HILL_FACTORS, TrackHillLosses
from uavrt.localization.position.levels.power_evidence import (
    PowerEvidence,
    PowerTrack,
    fit_each,
)
from uavrt.localization.position.tuning import SURVEY
from uavrt.localization.results import Caution
from uavrt.localization.tuning import LEVELS

_FOREIGN_PER_DB = LEVELS.outlier_share / LEVELS.any_strength_db
_LOG_FOREIGN = float(np.log(_FOREIGN_PER_DB))
_LOG_OWN = float(np.log(1.0 - LEVELS.outlier_share))

_Floats = NDArray[np.float64]


class SurveyEvidence:
    """Log-likelihood of positions, given powers along a track whose height is uncertain."""

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        track: PowerTrack,
        propagation: Propagation,
        height_sigma_m: float,
        over_hills: TrackHillLosses | None = None,
    ) -> None:
        self._over_hills = over_hills
        self._east_m, self._north_m, self._track = east_m, north_m, track
        self._propagation = propagation
        self._height_sigma_m = _height_sigma_m(track, height_sigma_m)
        self.kept = np.ones(len(track.snr_db), bool)
        """(n,) True for pulses that are not attributed to other senders."""
        self.height_shift_m = 0.0
        """Estimated error of the stated height above the tag [m]."""
        self.height_right_probability = 1.0
        """Probability that the height above the tag is wrong by less than 10 m."""
        self._correlation = 0.0
        heard = ~np.isnan(track.snr_db)
        if over_hills is not None or not np.all(heard):
            self._correlation = self._correlation_of_fading()
        shifts_m, self._log_prior = np.zeros(1), np.zeros(1)
        readings = [self.kept]
        if int(heard.sum()) >= SURVEY.least_pulses:
            place, spread_m, shift_m = self._rough_fit(heard)
            readings = self._readings(heard, place, spread_m, shift_m)
            self.kept = readings[0]
            # Misses allow positions to be compared, but not heights: a flight with true heights
            # and half of its pulses missed was estimated 30 m too low.
            if self._height_sigma_m > 0.0 and np.mean(heard) >= SURVEY.received_share:
                shifts_m = self._weigh_heights(place, spread_m)
                self._log_prior = _log_prior_of_height(shifts_m, self._height_sigma_m)
        self._evidences = [
            (
                [self._evidence(float(shift), kept) for shift in shifts_m],
                _log_prior_of_reading(kept),
            )
            for kept in readings
        ]
        """Evidences for all height errors, and log-prior, for each set of the tag's pulses."""

    @property
    def foreign(self) -> int:
        """Number of pulses attributed to other senders."""
        return int(np.sum(~self.kept))

    def fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        """Fit level and exponent at each of the positions (places,)."""
        if self._over_hills is None:
            return _over_readings(
                [
                    (self._fit_heights(heights, east_m, north_m), log_prior)
                    for heights, log_prior in self._evidences
                ]
            )
        score = np.full(len(east_m), -np.inf)
        middle = None
        ((own, _),) = self._evidences
        for factor, share in HILL_FACTORS:
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
        height_m = np.maximum(track.height_m + shift_m, SURVEY.least_height_m)
        over = self._over_hills
        return PowerEvidence(
            self._east_m[kept],
            self._north_m[kept],
            replace(track, height_m=height_m),
            self._propagation,
            correlation=self._correlation,
            over_hills=None if over is None else over.chosen(kept),
        )

    def _correlation_of_fading(self) -> float:
        """Correlation of neighbouring pulses' fading, which is needed if pulses were missed or
        over hills.
        """
        axes = reversed(self._coarsely(SURVEY.coarse_cells))
        north, east = (one.ravel() for one in np.meshgrid(*axes))
        return self._evidence(0.0).correlation_at_best(east, north)

    def _coarsely(self, count: int) -> tuple[_Floats, _Floats]:
        margin_m = SURVEY.margin_m
        east, north = (
            np.linspace(float(axis.min()) - margin_m, float(axis.max()) + margin_m, count)
            for axis in (self._east_m, self._north_m)
        )
        return east, north

    def _shifts(self) -> tuple[float, ...]:
        """Candidate height errors for which the drone is still above the ground [m]."""
        if self._height_sigma_m <= 0.0:
            return (0.0,)
        lowest = float(np.median(self._track.height_m)) - SURVEY.least_height_m
        return tuple(one for one in SURVEY.shifts_m if one > -lowest)

    def _rough_fit(self, heard: NDArray[np.bool_]) -> tuple[tuple[float, float], float, float]:
        """Return position, search radius [m] and height error [m] of the best approximate
        fit.
        """
        some = np.zeros(len(heard), bool)
        pulses = np.flatnonzero(heard)
        some[pulses[:: -(-len(pulses) // SURVEY.rough_pulses)]] = True
        east, north = self._coarsely(2 * SURVEY.coarse_cells)
        step = max(float(east[1] - east[0]), float(north[1] - north[0]))
        y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
        score = self._evidence(0.0, some).fit_with_foreign(x, y)[1]
        off = np.linspace(-step, step, SURVEY.rough_fine)
        shifts = self._shifts()[::2] if len(self._shifts()) > 1 else (0.0,)
        found = []
        for _ in range(SURVEY.rough_places):
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
        _, score = self._evidence(shift_m, heard).fit_with_foreign(x, y)
        top = int(np.argmax(score))
        return float(score[top]), (float(x[top]), float(y[top]))

    def _readings(
        self,
        heard: NDArray[np.bool_],
        place: tuple[float, float],
        step_m: float,
        shift_m: float,
    ) -> list[NDArray[np.bool_]]:
        """Return probable sets of the tag's own pulses, as masks (n,), the most probable first.

        A pulse is excluded where another sender is more probable than its deviation. That
        depends on the tag's position: a monopole receives little from directly below the drone,
        so a weak pulse of another sender looks like one of a tag there. Positions near the
        approximate one and below weak pulses are examined. With missed pulses or over hills,
        only pulses that are outliers at all positions are excluded, since likelihoods of
        different sets cannot be compared.
        """
        reach_m = SURVEY.mirror_reach * step_m
        off = np.linspace(-reach_m, reach_m, SURVEY.mirror_cells)
        north, east = (one.ravel() for one in np.meshgrid(place[1] + off, place[0] + off))
        near = np.hypot(self._east_m - place[0], self._north_m - place[1])
        beneath = heard & (near <= reach_m)
        east = np.concatenate([east, self._east_m[beneath]])
        north = np.concatenate([north, self._north_m[beneath]])
        residual, score = self._evidence(shift_m, heard).fit_with_foreign(east, north)
        residual = residual[score > score.max() - SURVEY.mirror_nats]
        innovation, sigma = _unlike_neighbours(residual)
        own = np.exp(-0.5 * (innovation / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
        own *= 1.0 - LEVELS.outlier_share
        odd = own < _FOREIGN_PER_DB
        found: list[NDArray[np.bool_]] = []
        if self._over_hills is None and np.all(heard):
            mixed = np.log(own + _FOREIGN_PER_DB).sum(axis=1)
            near_best = np.flatnonzero(mixed > mixed.max() - SURVEY.mirror_nats)
            for number in near_best[np.argsort(-mixed[near_best], kind="stable")]:
                if not any(np.array_equal(odd[number], one) for one in found):
                    found.append(odd[number])
                if len(found) == SURVEY.most_readings:
                    break
        else:
            found.append(np.all(odd, axis=0))
        readings = []
        for one in found:
            if np.mean(one) <= SURVEY.most_foreign:
                kept = np.ones(len(heard), bool)
                kept[np.flatnonzero(heard)[one]] = False
                readings.append(kept)
        if len(readings) > 1:
            near_best = score > score.max() - SURVEY.mirror_nats
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
            least = max(weighed) - SURVEY.readings_nats
            readings = [readings[number] for number in order if weighed[number] >= least]
        return readings or [np.ones(len(heard), bool)]

    def _weigh_heights(self, place: tuple[float, float], step_m: float) -> _Floats:
        """Estimate the height error; return three values that represent its distribution
        [m].
        """
        shifts = np.array(self._shifts())
        weight = self._weights(shifts, place, step_m)
        mean = float(weight @ shifts)
        variance = float(weight @ (shifts - mean) ** 2)
        self.height_shift_m = mean
        self.height_right_probability = float(weight[np.abs(shifts) < 10.0].sum())
        lowest = SURVEY.least_height_m - float(np.median(self._track.height_m))
        if variance < SURVEY.known_m**2:
            shifts = mean + np.array(SURVEY.closer_m)
            shifts = shifts[shifts > lowest]
            weight = self._weights(shifts, place, step_m)
            mean = float(weight @ shifts)
            variance = float(weight @ (shifts - mean) ** 2)
        nodes = max(variance**0.5, SURVEY.least_sigma_m) * np.array(SURVEY.nodes)
        nodes += max(mean, lowest - float(nodes[0]))
        return np.asarray(nodes)

    def _weights(self, shifts_m: _Floats, place: tuple[float, float], step_m: float) -> _Floats:
        off = np.linspace(-1.5 * step_m, 1.5 * step_m, SURVEY.fine_cells)
        north, east = (one.ravel() for one in np.meshgrid(place[1] + off, place[0] + off))
        each = [self._evidence(float(shift)) for shift in shifts_m]
        fits = fit_each(each, east, north)
        score = np.array([np.logaddexp.reduce(one.log_likelihood) for one in fits])
        prior = _log_prior_of_height(shifts_m, self._height_sigma_m)
        score += prior + np.log(np.gradient(shifts_m))
        weight = np.exp(score - score.max())
        return np.asarray(weight / weight.sum())


def cautions_of_survey(evidence: SurveyEvidence) -> tuple[Caution, ...]:
    """Cautions for the operator about a survey's heights and about pulses of other senders."""
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
            f"{evidence.foreign} of {len(evidence.kept)} pulses do not fit the other pulses "
            "and are not used: they may come from another transmitter"
        )
        found.append(Caution(name="foreign", text=text))
    return tuple(found)


def _height_sigma_m(track: PowerTrack, sigma_m: float) -> float:
    """Standard deviation of the stated height's error [m], limited for a receiver near the
    ground.
    """
    most_m = SURVEY.height_share * abs(float(np.median(track.height_m)))
    return min(sigma_m, most_m) if most_m >= SURVEY.least_sigma_m else 0.0


def _log_prior_of_height(shifts_m: _Floats, sigma_m: float) -> _Floats:
    """Log-prior of errors of the stated height, a mixture of usual and gross errors, shape
    (n,).
    """
    usual = (1.0 - SURVEY.far_wrong_share) * _normal(shifts_m, sigma_m)
    far_wrong = SURVEY.far_wrong_share * _normal(shifts_m, SURVEY.far_wrong_sigmas * sigma_m)
    return np.asarray(np.log(usual + far_wrong))


def _log_prior_of_reading(kept: NDArray[np.bool_]) -> float:
    """Log-prior that the pulses selected by `kept` (n,) are the tag's and all others another
    sender's.
    """
    return float(np.sum(~kept)) * _LOG_FOREIGN + float(np.sum(kept)) * _LOG_OWN


def _unlike_neighbours(residual: _Floats) -> tuple[_Floats, _Floats]:
    """Return how far residuals (places, n) deviate from a prediction by their neighbours, and
    its standard deviation.
    """
    padded = np.pad(residual, ((0, 0), (2, 2)), mode="reflect")
    count = residual.shape[1]
    around = np.stack([padded[:, first : first + count] for first in (0, 1, 3, 4)])
    around = np.sort(around, axis=0)
    level = 0.5 * (around[1] + around[2])
    middle = np.median(residual, axis=1)[:, None]
    each = np.stack(
        [residual - middle - alike * (level - middle) for alike in SURVEY.fading_shares]
    )
    size = 1.4826 * np.median(np.abs(each), axis=2)
    best = np.argmin(size, axis=0)
    places = np.arange(len(residual))
    return each[best, places], np.maximum(size[best, places], 1.0)[:, None]


def _over_readings(fits: Sequence[tuple[PowerFit, float]]) -> PowerFit:
    """Sum the likelihoods over several candidate sets of the tag's pulses.

    Level and exponent are those of the most likely set.
    """
    if len(fits) == 1:
        return fits[0][0]
    score = np.stack([fit.log_likelihood + log_prior for fit, log_prior in fits])
    return _most_likely([fit for fit, _ in fits], score, np.logaddexp.reduce(score))


def _most_likely(fits: Sequence[PowerFit], score: _Floats, log_likelihood: _Floats) -> PowerFit:
    best = np.argmax(score, axis=0)[None]
    return PowerFit(
        log_likelihood=log_likelihood,
        level_db=np.take_along_axis(np.stack([one.level_db for one in fits]), best, 0)[0],
        exponent=np.take_along_axis(np.stack([one.exponent for one in fits]), best, 0)[0],
    )


def _over_heights(score: _Floats) -> _Floats:
    """Logarithm of likelihoods at three heights (3, places), integrated over the height by a
    parabola, shape (places,).
    """
    low, middle, high = score
    bend = np.maximum(middle - 0.5 * (low + high), SURVEY.least_bend)
    slope = 0.5 * (high - low)
    vertex = np.clip(0.5 * slope / bend, -1.0, 1.0)
    return np.asarray(middle + (slope - bend * vertex) * vertex - 0.5 * np.log(bend))


def _normal(value: _Floats, sigma: float) -> _Floats:
    return np.asarray(np.exp(-0.5 * (value / sigma) ** 2) / sigma)
