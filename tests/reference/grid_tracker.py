"""Probability of every cell for a tag that stays: what the particles are compared with."""

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.position.bearing_evidence import BearingEvidence
from uavrt.localization.position.level_belief import Behind, LevelBelief, Listening
from uavrt.localization.position.loss_error import LossError
from uavrt.localization.position.trackers import (
    _EXPONENTS,
    TagPrior,
    TrackEstimate,
    _estimate,
)

_Floats = NDArray[np.floating]


class GridTracker:
    """Probability of every cell of an area, for a tag that stays.

    Parameters
    ----------
    prior : TagPrior
        Area, strength, antenna.
    cells : int
        Cells along the longer side.
    """

    def __init__(self, prior: TagPrior, *, cells: int = 120) -> None:
        area = prior.area
        self._prior = prior
        width, height = area.east_m - area.west_m, area.north_m - area.south_m
        self._cell_m = max(width, height) / cells
        across, along = (max(2, round(side / self._cell_m)) for side in (width, height))
        east = area.west_m + (np.arange(across) + 0.5) * width / across
        north = area.south_m + (np.arange(along) + 0.5) * height / along
        places_north, places_east = np.meshgrid(north, east, indexing="ij")
        self._east_m, self._north_m = places_east.ravel(), places_north.ravel()
        exponents = _EXPONENTS if prior.exponent_sigma > 0.0 else (prior.exponent,)
        shape = (len(exponents), len(self._east_m))
        self._log_weight = np.zeros(shape)
        self._exponent = np.array(exponents)[:, None]
        self._level = LevelBelief(
            mean_db=np.full(shape, prior.level_db),
            variance_db2=np.full(shape, prior.level_sigma_db**2),
            error=None if prior.hills is None else LossError.unlearnt(shape),
        )
        self._heard_from_m: tuple[float, float] | None = None

    def listen(self, heard: Listening) -> None:
        """Update with a pulse, or that none was heard."""
        prior = self._prior
        if self._level.error is not None:
            here = float(heard.east_m), float(heard.north_m)
            self._level.error = self._level.error.after(self._heard_from_m, here)
            self._heard_from_m = here
        behind = Behind.hills(prior.hills, heard, self._east_m, self._north_m)
        expected = self._level.expected_db(
            heard, self._east_m, self._north_m, self._exponent, prior.pattern, behind
        )
        if prior.path_gain is not None:
            expected = expected + prior.path_gain(
                self._east_m - heard.east_m, self._north_m - heard.north_m, heard.height_m
            )
        self._log_weight += self._level.update(
            heard,
            expected,
            prior.fading_db if behind is None else behind.scatter_db(prior.fading_db),
            missed_share=prior.missed_share,
            chance_share=prior.chance_share,
            behind=behind,
        )

    def take_bearing(
        self, east_m: float, north_m: float, posterior: NDArray[np.float64]
    ) -> None:
        """Update with a bearing's (360,) posterior; its pulses must not count as well."""
        evidence = BearingEvidence(
            np.array([east_m]), np.array([north_m]), posterior[None, :], outlier_share=0.05
        )
        self._log_weight += evidence.log_likelihood(self._east_m, self._north_m, self._cell_m)

    def probability(self) -> _Floats:
        """(cells,) probability, south to north, west to east within."""
        weight = np.exp(self._log_weight - self._log_weight.max()).sum(axis=0)
        return np.asarray(weight / weight.sum())

    def estimate(self) -> TrackEstimate:
        """Report where the tag is, as far as known."""
        joint = np.exp(self._log_weight - self._log_weight.max())
        joint /= joint.sum()
        weight = joint.sum(axis=0)
        level = (joint * self._level.mean_db).sum(axis=0) / np.maximum(weight, 1e-300)
        return _estimate(self._east_m, self._north_m, level, weight)
