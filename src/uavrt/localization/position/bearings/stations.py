"""Bearings of one tag and the positions where they were taken: the input of position
estimates.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.localization.position.bearings.bearing_evidence import density_of
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.results import Bearing

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stations:
    """Bearings of one tag and the positions where they were taken."""

    latitude_deg: _Floats
    longitude_deg: _Floats
    bearing_deg: _Floats
    """Bearings from the stations to the tag, clockwise from true north [deg], shape (n,)."""
    sigma_deg: _Floats | None = None
    """Standard deviation of each bearing [deg], shape (n,); None: one value is estimated for
    all."""
    posterior: _Floats | None = None
    """Probability of each whole degree of each bearing, shape (n, 360); it replaces
    `sigma_deg`."""
    level_db: _Floats | None = None
    """SNR on boresight [dB], shape (n,), NaN if unknown; differences between stations depend on
    the distances."""
    level_sigma_db: _Floats | None = None
    """Standard deviation of each value in `level_db` [dB], shape (n,); None means 0."""
    height_m: _Floats | None = None
    """Height of the antenna above the tag [m], shape (n,); None means 0."""
    receiver: NDArray[np.int64] | None = None
    """Number of the receiver that took each bearing, shape (n,); None if one receiver took
    all."""
    time_s: _Floats | None = None
    """Times of the bearings relative to any origin [s], shape (n,); None for a resting tag."""
    origin_ns: int = 0
    """UTC time of `time_s` 0 [ns]; 0 if unknown."""
    listeners: tuple[Strengths, ...] = ()
    """Signal levels at receivers that never turned, used by the method ``bayes``."""

    @property
    def receivers(self) -> NDArray[np.int64]:
        """Number of the receiver that took each bearing, shape (n,); all 0 if one receiver took
        all.
        """
        if self.receiver is None:
            return np.zeros(len(self.bearing_deg), np.int64)
        return self.receiver

    @classmethod
    def of(
        cls,
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        bearings: list[Bearing],
        time_s: ArrayLike | None = None,
        origin_ns: int = 0,
    ) -> "Stations":
        """Convert estimated bearings to stations."""
        densities = None
        if any(one.posterior is not None for one in bearings):
            densities = np.array(
                [
                    density_of(one.bearing_deg, one.sigma_deg)
                    if one.posterior is None
                    else one.posterior
                    for one in bearings
                ]
            )
        sigmas = [one.sigma_deg for one in bearings if one.sigma_deg is not None]
        whole = len(bearings)
        return cls(
            latitude_deg=np.atleast_1d(np.asarray(latitude_deg, np.float64)),
            longitude_deg=np.atleast_1d(np.asarray(longitude_deg, np.float64)),
            bearing_deg=np.array([one.bearing_deg for one in bearings]),
            sigma_deg=np.array(sigmas) if len(sigmas) == whole else None,
            posterior=densities,
            level_db=_known([one.level_db for one in bearings], np.nan),
            level_sigma_db=_known([one.level_sigma_db for one in bearings], 0.0),
            time_s=None if time_s is None else np.atleast_1d(np.asarray(time_s, np.float64)),
            origin_ns=origin_ns,
        )

    @property
    def with_levels(self) -> "Stations | None":
        """Return a copy with only the stations whose level is known; None if there are no
        levels.
        """
        if self.level_db is None:
            return None
        known = np.isfinite(self.level_db)
        sigma_db, height_m = self.level_sigma_db, self.height_m
        return Stations(
            latitude_deg=self.latitude_deg[known],
            longitude_deg=self.longitude_deg[known],
            bearing_deg=self.bearing_deg[known],
            level_db=self.level_db[known],
            level_sigma_db=None if sigma_db is None else sigma_db[known],
            height_m=None if height_m is None else height_m[known],
            receiver=self.receivers[known],
        )


def _known(values: list[float | None], unknown: float) -> _Floats | None:
    if all(one is None for one in values):
        return None
    return np.array([unknown if one is None else one for one in values])
