"""Bearings of one tag and where they were taken: what positions are estimated from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.localization.position.strengths import Strengths
from uavrt.localization.results import Bearing

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stations:
    """Bearings of one tag and where they were taken."""

    latitude_deg: _Floats
    """(n,)."""
    longitude_deg: _Floats
    bearing_deg: _Floats
    """(n,) clockwise from true north."""
    sigma_deg: _Floats | None = None
    """(n,) standard deviations; None lets them be learnt, one for all."""
    posterior: _Floats | None = None
    """(n, 360) probability of whole degrees; goes before `sigma_deg`."""
    level_db: _Floats | None = None
    """(n,) SNR on boresight: its differences show the distance, to the method ``bayes``."""
    level_sigma_db: _Floats | None = None
    """(n,) errors of the levels; 0 when None."""
    height_m: _Floats | None = None
    """(n,) above the tag; 0 when None."""
    receiver: NDArray[np.int64] | None = None
    """(n,) which receiver each is of; None: all are of one."""
    time_s: _Floats | None = None
    """(n,) when each was taken, from any origin; None takes it that the tag rests."""
    origin_ns: int = 0
    """UTC at a `time_s` of 0; 0 where unknown."""
    listeners: tuple[Strengths, ...] = ()
    """What receivers that never turned heard of the tag, to the method ``bayes``."""

    @property
    def receivers(self) -> NDArray[np.int64]:
        """(n,) which receiver each is of."""
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
        """Make stations of estimated bearings, with all that these know."""
        posteriors = [one.posterior for one in bearings if one.posterior is not None]
        sigmas = [one.sigma_deg for one in bearings if one.sigma_deg is not None]
        levels = [one.level_db for one in bearings if one.level_db is not None]
        level_sigmas = [
            one.level_sigma_db for one in bearings if one.level_sigma_db is not None
        ]
        whole = len(bearings)
        return cls(
            latitude_deg=np.atleast_1d(np.asarray(latitude_deg, np.float64)),
            longitude_deg=np.atleast_1d(np.asarray(longitude_deg, np.float64)),
            bearing_deg=np.array([one.bearing_deg for one in bearings]),
            sigma_deg=np.array(sigmas) if len(sigmas) == whole else None,
            posterior=np.array(posteriors) if len(posteriors) == whole else None,
            level_db=np.array(levels) if len(levels) == whole else None,
            level_sigma_db=np.array(level_sigmas) if len(level_sigmas) == whole else None,
            time_s=None if time_s is None else np.atleast_1d(np.asarray(time_s, np.float64)),
            origin_ns=origin_ns,
        )
