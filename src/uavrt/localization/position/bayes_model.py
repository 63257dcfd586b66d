"""Prior and likelihood of a tag's position, given bearings and signal powers."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane, plane_around
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.bearings.bearing_evidence import BearingEvidence, von_mises
from uavrt.localization.position.bearings.common_errors import Explanation
from uavrt.localization.position.bearings.observers import Displacement
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.levels.level_evidence import LevelEvidence, Levels, Propagation
from uavrt.localization.position.levels.over_hills import TrackHillLosses
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.position.levels.survey_errors import SurveyEvidence
from uavrt.localization.position.tuning import BEARING_FIX, GRID
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import FLIGHT

_Floats = NDArray[np.float64]
LogDensity = Callable[[_Floats, _Floats], _Floats]
"""Function from east and north of positions (places,) to a log-density (places,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Assumptions about errors, path loss and ground that are made before the flight."""

    outlier_share: float
    heading_sigma_deg: float
    propagation: Propagation
    max_range_m: float | None
    unusual: frozenset[Explanation]
    height_sigma_m: float
    displacements: tuple[Displacement, ...] = ((1.0, 0.0, 0.0),)
    hills: HillLosses | None = None


class Model:
    """Likelihood of a position from bearings and powers together, and the position's prior."""

    def __init__(
        self, stations: Stations | None, powers: PowerTrack | None, known: Known
    ) -> None:
        everywhere = [one for one in (stations, powers) if one is not None]
        self.plane = plane_around(
            np.concatenate([one.latitude_deg for one in everywhere]),
            np.concatenate([one.longitude_deg for one in everywhere]),
        )
        self.known = known
        self.stations, self.powers = stations, powers
        self.tracks = [
            self.plane.to_local(one.latitude_deg, one.longitude_deg) for one in everywhere
        ]
        self._surveyed = _area(self.tracks, 0.0)
        self.hills = self._hills_around()
        self.bearings: list[BearingEvidence] = []
        self._levels: LevelEvidence | None = None
        self.listeners: tuple[Strengths, ...] = ()
        if stations is not None:
            self.bearings = _bearing_evidence(stations, self.plane, known)
            self.listeners = _usable_receivers(stations, self)
            usable = tuple(one for one in self.listeners if one.unused is None)
            self._levels = _level_evidence(stations, usable, self, known.propagation)
        self.track = None if powers is None else _power_evidence(powers, self, known)
        self._near_track = _prior_near_track(
            self._surveyed, sum(_length_m(*one) for one in self.tracks), self._height_m
        )

    def _hills_around(self) -> HillLosses | None:
        known = self.known.hills
        if known is None or known.level:
            return None
        hills, area = known.in_plane(self.plane), self.area
        hills.cover([area.west_m, area.east_m], [area.south_m, area.north_m])
        return hills

    @property
    def area(self) -> Area:
        """Area that contains the tag's possible positions."""
        around = self._surveyed
        length = float(np.hypot(around.east_m - around.west_m, around.north_m - around.south_m))
        margin = max(300.0, 0.5 * length) if self.stations is None else GRID.bearing_range_m
        return _area(self.tracks, self.known.max_range_m or margin)

    @property
    def overflown(self) -> Area:
        """Rectangle around the survey, enlarged by the flight's height."""
        return _area(self.tracks, self._height_m)

    @property
    def shows_m(self) -> float:
        """Cell width that resolves the peak of a survey's likelihood [m], at least 1/16 of the
        survey's side.
        """
        around = self.overflown
        square_m2 = (around.east_m - around.west_m) * (around.north_m - around.south_m)
        return max(
            GRID.peak_heights * self._height_m,
            GRID.least_extent_share * float(np.sqrt(square_m2)),
        )

    def shared_sigma_m(self, point: tuple[float, float], share: float) -> float:
        """Standard deviation of a normal shift that is equivalent to the mixture of all
        possible shifts [m].

        At the probability `share`, circles of both have the same radius. `point` is the
        position.
        """
        away = np.concatenate(self.tracks, axis=1) - np.array(point)[:, None]
        probability, relative, beyond_m = np.transpose(self.known.displacements)
        away_m = np.mean(np.hypot(*away))
        each = np.hypot(np.hypot(relative * away_m, beyond_m), FLIGHT.place_sigma_m)
        sigma = np.sort(each)
        held = 1.0 - (1.0 - share) ** (sigma[:, None] / each) ** 2 @ probability
        return float(np.interp(share, held, sigma))

    @property
    def _height_m(self) -> float:
        return 0.0 if self.powers is None else abs(float(np.median(self.powers.height_m)))

    def log_likelihood(self, east_m: _Floats, north_m: _Floats, cell_m: _Floats) -> _Floats:
        """Log-likelihood of all measurements plus the log-prior of the position, shape
        (places,).
        """
        total = np.zeros(len(east_m))
        if self.bearings:
            total += _prior_of_distance(self._surveyed, east_m, north_m)
            each = [one.log_likelihood(east_m, north_m, cell_m) for one in self.bearings]
            total += each[0] if len(each) == 1 else np.logaddexp.reduce(each)
        if self._levels is not None:
            total += self._levels.log_likelihood(east_m, north_m)
        if self.track is not None:
            total += self._near_track(east_m, north_m) if self.stations is None else 0.0
            total += self.track.fit(east_m, north_m).log_likelihood
        return total


def _bearing_evidence(
    stations: Stations, plane: TangentPlane, known: Known
) -> list[BearingEvidence]:
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    if stations.posterior is not None:
        densities = [stations.posterior]
    elif stations.sigma_deg is not None:
        densities = [von_mises(stations.bearing_deg, stations.sigma_deg)]
    else:
        densities = [
            von_mises(stations.bearing_deg, np.full(len(east), sigma))
            for sigma in BEARING_FIX.unknown_sigmas_deg
        ]
    return [
        BearingEvidence(
            east,
            north,
            one,
            outlier_share=known.outlier_share,
            heading_sigma_deg=known.heading_sigma_deg,
        )
        for one in densities
    ]


def _power_evidence(powers: PowerTrack, model: Model, known: Known) -> SurveyEvidence:
    east, north = model.plane.to_local(powers.latitude_deg, powers.longitude_deg)
    over = TrackHillLosses.of(model.hills, east, north, powers.height_m)
    return SurveyEvidence(east, north, powers, known.propagation, known.height_sigma_m, over)


_HILLS_UNKNOWN = "signal loss behind hills is not computed for fixed receivers"
_NO_LEVELS = "no bearing has a signal strength"


def _usable_receivers(stations: Stations, model: Model) -> tuple[Strengths, ...]:
    """Return the receivers that never turned, each with the reason if its signal levels cannot
    be used here.
    """
    why = None
    if model.hills is not None:
        why = _HILLS_UNKNOWN
    elif stations.level_db is None:
        why = _NO_LEVELS
    return tuple(
        one if why is None or one.unused is not None else replace(one, unused=why)
        for one in stations.listeners
    )


def _level_evidence(
    stations: Stations, listeners: tuple[Strengths, ...], model: Model, propagation: Propagation
) -> LevelEvidence | None:
    heard = stations.with_levels
    if heard is None or heard.level_db is None:
        return None
    east, north = model.plane.to_local(heard.latitude_deg, heard.longitude_deg)
    nothing = np.zeros(len(east))
    places = [model.plane.to_local(one.latitude_deg, one.longitude_deg) for one in listeners]
    sigma = nothing if heard.level_sigma_db is None else heard.level_sigma_db
    height = nothing if heard.height_m is None else heard.height_m
    turning, number = np.unique(heard.receivers, return_inverse=True)
    group = number + len(listeners) if len(turning) > 1 else np.full(len(east), -1)
    levels = Levels(
        east_m=np.concatenate([east, *(one for one, _ in places)]),
        north_m=np.concatenate([north, *(one for _, one in places)]),
        height_m=np.concatenate([height, *(one.height_m for one in listeners)]),
        level_db=np.concatenate([heard.level_db, *(one.level_db for one in listeners)]),
        sigma_db=np.concatenate([sigma, *(one.sigma_db for one in listeners)]),
        group=np.concatenate(
            [group, *(np.full(len(one.level_db), n) for n, one in enumerate(listeners))]
        ),
    )
    if len(levels.level_db) < 2:
        return None
    over = None
    if heard.height_m is not None and not listeners:
        over = TrackHillLosses.of(model.hills, east, north, height)
    return LevelEvidence(levels, listeners, propagation, over)


def _prior_of_distance(around: Area, east_m: _Floats, north_m: _Floats) -> _Floats:
    """Log-prior of a position far from the stations, which is uniform over the logarithm of the
    distance.

    The prior has no effect where bearings cross well. Where they cross at small angles, a
    uniform prior would place the tag in the far end of the wedge, which has the largest area.
    For stations 60 m apart and a tag at 300 m, errors were 136 m at the median and exceeded 2.5
    km in a tenth of the runs. With this prior they are 77 m and 153 m, and the circles contain
    the stated probability.
    """
    middle_east = 0.5 * (around.west_m + around.east_m)
    middle_north = 0.5 * (around.south_m + around.north_m)
    extent = np.hypot(around.east_m - around.west_m, around.north_m - around.south_m)
    distance = np.hypot(east_m - middle_east, north_m - middle_north)
    return np.asarray(
        -2.0 * np.log(np.maximum(distance, max(GRID.near_m, 0.5 * float(extent))))
    )


def _prior_near_track(surveyed: Area, length_m: float, height_m: float) -> LogDensity:
    """Log-prior of a position in a survey by signal power, which is flown where the tag is
    expected.

    The prior is uniform inside the surveyed rectangle; each flight line covers half of the line
    spacing on both sides. Outside, the prior falls by a factor e per quarter of the line
    spacing, which is the rectangle's area divided by the track's length. Power alone hardly
    distinguishes a tag beyond the outermost line from its mirror image. For a single line, a
    tenth of its length replaces the quarter spacing. This distance is at least a quarter of the
    height, since lines closer together than the height cover no larger area.
    """
    wide, high = surveyed.east_m - surveyed.west_m, surveyed.north_m - surveyed.south_m
    scale_m = 0.1 * max(wide, high)
    if min(wide, high) > 0.2 * max(wide, high):
        scale_m = min(scale_m, 0.25 * wide * high / max(length_m, 1.0))
    scale_m = max(scale_m, 0.25 * height_m, 5.0)

    def log_density(east_m: _Floats, north_m: _Floats) -> _Floats:
        outside = np.hypot(
            np.maximum(0.0, np.maximum(surveyed.west_m - east_m, east_m - surveyed.east_m)),
            np.maximum(0.0, np.maximum(surveyed.south_m - north_m, north_m - surveyed.north_m)),
        )
        return np.asarray(-outside / scale_m)

    return log_density


def _length_m(east_m: _Floats, north_m: _Floats) -> float:
    return float(np.hypot(np.diff(east_m), np.diff(north_m)).sum())


def _area(tracks: list[tuple[_Floats, _Floats]], margin_m: float) -> Area:
    east = np.concatenate([one[0] for one in tracks])
    north = np.concatenate([one[1] for one in tracks])
    return Area(
        west_m=float(east.min() - margin_m),
        east_m=float(east.max() + margin_m),
        south_m=float(north.min() - margin_m),
        north_m=float(north.max() + margin_m),
    )
