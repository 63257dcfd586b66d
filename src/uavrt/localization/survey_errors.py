"""Errors that all powers of a survey share: a height that is told wrong, pulses of others.

A wrong height (terrain, a tag on a tree, a take-off on a hill) changes where the strength has
its hollow and how steeply it falls; several heights are weighed against each other, with the
place. Pulses of someone else have any strength: a robust fit (Student's law, iteratively
reweighted) finds the place roughly, and what lies far outside the others' scatter there is left
out, and counted.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.bayes_fix import Area
from uavrt.localization.level_evidence import Propagation
from uavrt.localization.power_evidence import PowerEvidence, PowerFit, PowerTrack
from uavrt.localization.records import Caution

HEIGHT_SIGMA_M = 7.0
"""Error of the told height over the tag, were nothing said of it: standard deviation."""
_FAR_WRONG_SHARE = 0.1
_FAR_WRONG_SIGMAS = 4.0
"""Some heights are wrong by far more than is usual."""
_SHIFTS_M = (-30.0, -18.0, -9.0, 0.0, 9.0, 18.0, 28.0, 40.0)
_LEAST_HEIGHT_M = 3.0
_NEGLIGIBLE = 0.04
"""Heights that are less probable than that are not carried on …"""
_MOST_HEIGHTS = 3
"""… nor more of them: each costs as much as the first."""
FOREIGN_SHARE = 0.02
"""Of the pulses, beforehand; each as probable at any strength within 60 dB."""
_ANY_DB = 60.0
_MOST_FOREIGN = 0.25
"""Where more do not fit, the model does not, and nothing is left out."""
_LEAST_PULSES = 20
"""Fewer pulses tell nothing of heights and of others."""
_HEARD_SHARE = 0.95
"""Heights are weighed where fewer pulses than the rest were missed."""
_COARSE, _FINE = 14, 9
_MARGIN_M = 60.0
_FREEDOM = 3.0
_ROUNDS = 4
_CHUNK = 400

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyErrors:
    """What may be wrong with a survey's powers."""

    height_sigma_m: float = HEIGHT_SIGMA_M
    """0: the heights are true."""
    lasting_fading: bool = True
    """Fading may last from pulse to pulse."""
    foreign_pulses: bool = True
    """Some pulses may be someone else's."""


class SurveyEvidence:
    """Log-likelihood of places, given powers along a track of uncertain height.

    Parameters
    ----------
    east_m, north_m : (n,) float64 arrays
        The track in the local plane.
    track : PowerTrack
        Heights as they are told, powers, antenna.
    propagation : Propagation
        Prior of the path loss exponent.
    errors : SurveyErrors
        What may be wrong.
    """

    def __init__(
        self,
        east_m: _Floats,
        north_m: _Floats,
        track: PowerTrack,
        propagation: Propagation,
        errors: SurveyErrors,
    ) -> None:
        self._east_m, self._north_m, self._track = east_m, north_m, track
        self._propagation, self._errors = propagation, errors
        self.kept = np.ones(len(track.snr_db), bool)
        """(n,) what is not left out as someone else's."""
        self.height_shift_m = 0.0
        """Mean over the weighed heights."""
        self.height_told_probability = 1.0
        """That the height is wrong by less than 10 m."""
        self._heights = [(0.0, self._evidence(0.0))]
        heard = ~np.isnan(track.snr_db)
        if int(heard.sum()) < _LEAST_PULSES:
            return
        place, spread_m, shift_m = self._roughly(heard)
        if errors.foreign_pulses:
            self.kept = ~heard | ~self._foreign(heard, place, shift_m)
            self._heights = [(0.0, self._evidence(0.0))]
        # What is made of misses compares places, but not heights: a flight whose heights
        # were true, with half of its pulses missed, was taken for one 30 m lower.
        if errors.height_sigma_m > 0.0 and np.mean(heard) >= _HEARD_SHARE:
            self._weigh_heights(place, spread_m)

    @property
    def foreign(self) -> int:
        """Pulses that are left out as someone else's."""
        return int(np.sum(~self.kept))

    def fit(self, east_m: _Floats, north_m: _Floats) -> PowerFit:
        """Fit level and exponent at each of some places (places,)."""
        fits = [one.fit(east_m, north_m) for _, one in self._heights]
        if len(fits) == 1:
            return fits[0]
        score = np.stack(
            [
                weight + one.log_likelihood
                for (weight, _), one in zip(self._heights, fits, strict=True)
            ]
        )
        best = np.argmax(score, axis=0)[None]
        return PowerFit(
            log_likelihood=np.logaddexp.reduce(score),
            level_db=np.take_along_axis(np.stack([o.level_db for o in fits]), best, 0)[0],
            exponent=np.take_along_axis(np.stack([o.exponent for o in fits]), best, 0)[0],
        )

    def _evidence(self, shift_m: float) -> PowerEvidence:
        track = self._track
        raised = replace(
            track,
            latitude_deg=track.latitude_deg[self.kept],
            longitude_deg=track.longitude_deg[self.kept],
            height_m=np.maximum(track.height_m[self.kept] + shift_m, _LEAST_HEIGHT_M),
            snr_db=track.snr_db[self.kept],
            yaw_deg=None if track.yaw_deg is None else track.yaw_deg[self.kept],
        )
        return PowerEvidence(
            self._east_m[self.kept],
            self._north_m[self.kept],
            raised,
            self._propagation,
            lasting=self._errors.lasting_fading,
        )

    def _shifts(self) -> tuple[float, ...]:
        """Heights to weigh, none of them under the ground."""
        if self._errors.height_sigma_m <= 0.0:
            return (0.0,)
        lowest = float(np.median(self._track.height_m)) - _LEAST_HEIGHT_M
        return tuple(one for one in _SHIFTS_M if one > -lowest)

    def _roughly(self, heard: NDArray[np.bool_]) -> tuple[tuple[float, float], float, float]:
        """Place, its grid's step, and height shift of the best robust fit."""
        area = Area(
            west_m=float(self._east_m.min()) - _MARGIN_M,
            east_m=float(self._east_m.max()) + _MARGIN_M,
            south_m=float(self._north_m.min()) - _MARGIN_M,
            north_m=float(self._north_m.max()) + _MARGIN_M,
        )
        east = np.linspace(area.west_m, area.east_m, _COARSE)
        north = np.linspace(area.south_m, area.north_m, _COARSE)
        step = max(float(east[1] - east[0]), float(north[1] - north[0]))
        place = self._best_of(east, north, heard, 0.0)[1]
        found = []
        for shift_m in self._shifts()[::2] if len(self._shifts()) > 1 else (0.0,):
            off = np.linspace(-step, step, _FINE)
            found.append(
                (*self._best_of(place[0] + off, place[1] + off, heard, shift_m), shift_m)
            )
        _, best, shift_m = max(found, key=lambda one: one[0])
        return best, step, shift_m

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
            scale = np.sqrt(np.mean(weight * residual**2, axis=1))
            weight = (_FREEDOM + 1.0) / (_FREEDOM + (residual / scale[:, None]) ** 2)
        law = np.log1p((residual / scale[:, None]) ** 2 / _FREEDOM)
        score = -z.shape[1] * np.log(scale) - 0.5 * (_FREEDOM + 1.0) * law.sum(axis=1)
        return residual, scale, score

    def _foreign(
        self, heard: NDArray[np.bool_], place: tuple[float, float], shift_m: float
    ) -> NDArray[np.bool_]:
        """(n,) pulses that are rather someone else's than so far from the others."""
        east, north = np.array([place[0]]), np.array([place[1]])
        residual = self._robust(east, north, heard, shift_m)[0][0]
        sigma = max(1.4826 * float(np.median(np.abs(residual - np.median(residual)))), 1.0)
        own = np.exp(-0.5 * (residual / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi))
        odd = (1.0 - FOREIGN_SHARE) * own < FOREIGN_SHARE / _ANY_DB
        found = np.zeros(len(heard), bool)
        if np.mean(odd) <= _MOST_FOREIGN:
            found[np.flatnonzero(heard)[odd]] = True
        return found

    def _weigh_heights(self, place: tuple[float, float], step_m: float) -> None:
        """Keep the heights that matter, each with the logarithm of its prior."""
        sigma = self._errors.height_sigma_m
        shifts = np.array(self._shifts())
        wide = _FAR_WRONG_SIGMAS * sigma
        prior = (1.0 - _FAR_WRONG_SHARE) * _normal(shifts, sigma)
        prior = (prior + _FAR_WRONG_SHARE * _normal(shifts, wide)) * np.gradient(shifts)
        prior /= prior.sum()
        off = np.linspace(-1.5 * step_m, 1.5 * step_m, _FINE)
        north, east = (one.ravel() for one in np.meshgrid(place[1] + off, place[0] + off))
        each = [self._evidence(float(shift)) for shift in shifts]
        score = np.array(
            [np.logaddexp.reduce(one.fit(east, north).log_likelihood) for one in each]
        ) + np.log(prior)
        weight = np.exp(score - score.max())
        weight /= weight.sum()
        kept = np.argsort(-weight)[:_MOST_HEIGHTS]
        kept = kept[weight[kept] > _NEGLIGIBLE]
        self._heights = [(float(np.log(prior[number])), each[number]) for number in kept]
        self.height_shift_m = float(weight @ shifts)
        self.height_told_probability = float(weight[np.abs(shifts) < 10.0].sum())


def cautions_of_survey(evidence: SurveyEvidence) -> tuple[Caution, ...]:
    """What the operator must know of a survey's powers."""
    found = []
    if evidence.height_told_probability < 0.1:
        text = (
            f"the strengths are those of a height {abs(evidence.height_shift_m):.0f} m "
            f"{'greater' if evidence.height_shift_m > 0.0 else 'less'} than the told one: "
            "check the terrain and where the take-off was"
        )
        found.append(Caution(name="height", text=text))
    if evidence.foreign >= max(2, 0.01 * len(evidence.kept)):
        text = (
            f"{evidence.foreign} of {len(evidence.kept)} pulses do not fit the others and are "
            "left out: perhaps someone else's"
        )
        found.append(Caution(name="foreign", text=text))
    return tuple(found)


def _normal(value: _Floats, sigma: float) -> _Floats:
    return np.asarray(np.exp(-0.5 * (value / sigma) ** 2) / sigma)
