"""`estimate_position`: one door to all estimators of a place."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.errors import UsageError
from uavrt.localization import lenth
from uavrt.localization.bayes_fix import (
    Area,
    GridPosterior,
    ellipse_of,
    grid_posterior,
    normal_radius_m,
)
from uavrt.localization.bearing_evidence import (
    UNKNOWN_SIGMAS_DEG,
    BearingEvidence,
    von_mises,
)
from uavrt.localization.level_evidence import LevelEvidence, Propagation
from uavrt.localization.power_evidence import PowerEvidence, PowerTrack
from uavrt.localization.records import Bearing, Position, PositionGrid, PositionMethod
from uavrt.localization.tangent_plane import TangentPlane, plane_around
from uavrt.plugins import Registry

_Floats = NDArray[np.float64]
LogDensity = Callable[[_Floats, _Floats], _Floats]
"""East and north (places,) to (places,)."""

_BEARING_RANGE_M = 3000.0
_NEAR_M = 100.0
"""Nearer than that all places are equally likely."""
_BEARING_CELLS = 100
_POWER_CELLS = 44
"""Some hundred pulses for each cell: a coarser grid keeps a position under 150 ms."""


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
    """(n,) SNR on boresight: its differences tell of the distance, to the method ``bayes``."""
    level_sigma_db: _Floats | None = None
    """(n,) errors of the levels; 0 when None."""
    height_m: _Floats | None = None
    """(n,) above the tag; 0 when None."""

    @classmethod
    def of(
        cls, latitude_deg: ArrayLike, longitude_deg: ArrayLike, bearings: list[Bearing]
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
        )


PositionEstimator = Callable[[Stations | None, PowerTrack | None], Position]
ADDED_METHODS: Registry[PositionEstimator] = Registry("uavrt.position_methods", {})
"""Estimators that installed packages add, by the name of the method."""


def estimate_position(
    stations: Stations | None = None,
    powers: PowerTrack | None = None,
    *,
    method: PositionMethod | str = "bayes",
    outlier_share: float = 0.05,
    propagation: Propagation | None = None,
    max_range_m: float | None = None,
) -> Position:
    """Estimate where a tag is, from bearings, from powers along a track, or from both.

    Parameters
    ----------
    stations : Stations, optional
        Bearings. One gives a wedge, two or more a place.
    powers : PowerTrack, optional
        Powers; used by the method ``bayes`` only. Pulses that already went into the bearings
        must not be given again.
    method : str
        ``"bayes"`` (the default), or ``"mle"``, ``"rmr"``, ``"mest"`` as the original system
        computes them, or ``"rmr_ahead"``, ``"mest_lenth"`` as they were meant, or one that an
        installed package adds (docs/how-to/extend.md).
    outlier_share : float
        Prior probability that a bearing has nothing to do with the tag.
    propagation : Propagation, optional
        What is known of the path loss.
    max_range_m : float, optional
        How far from the stations or the track the tag may be; 3000 with bearings, else as far
        as the track is long.

    Raises
    ------
    UsageError
        There is nothing to estimate from, arrays differ in length, or the method is unknown or
        does not come to a position; the text says what to use instead.
    """
    _check(stations, powers)
    if method == "bayes":
        return _bayes(
            stations, powers, outlier_share, propagation or Propagation(), max_range_m
        )
    if method not in _LENTH and method in ADDED_METHODS:
        return ADDED_METHODS[method](stations, powers)
    if method not in _LENTH:
        known = ", ".join(["bayes", *_LENTH, *ADDED_METHODS])
        raise UsageError(f"there is no method {method!r}", remedy=f"Known are {known}")
    if stations is None or len(stations.bearing_deg) < 2:
        raise UsageError(f"{method} needs two bearings", remedy="Use the method bayes")
    return _lenth(stations, method)


def _check(stations: Stations | None, powers: PowerTrack | None) -> None:
    if stations is None and powers is None:
        raise UsageError("neither bearings nor powers", remedy="Give one of them")
    if stations is not None:
        fields = [stations.latitude_deg, stations.longitude_deg, stations.bearing_deg]
        _check_lengths(
            "bearings", fields, [stations.sigma_deg, stations.level_db, stations.level_sigma_db]
        )
    if powers is not None:
        fields = [powers.latitude_deg, powers.longitude_deg, powers.height_m]
        _check_lengths("powers", fields, [powers.snr_db, powers.yaw_deg], finite=3)
        if np.count_nonzero(~np.isnan(powers.snr_db)) < 3:
            raise UsageError("fewer than three powers", remedy="Fly nearer, or turn in place")
        if powers.antenna is not None and powers.yaw_deg is None:
            raise UsageError("a directional antenna without headings", remedy="Give yaw_deg")


def _check_lengths(
    what: str, needed: list[_Floats], optional: list[_Floats | None], finite: int = 3
) -> None:
    arrays = [*needed, *(one for one in optional if one is not None)]
    if len({one.shape for one in arrays}) != 1 or not len(needed[0]):
        raise UsageError(f"the arrays of the {what} differ in length or are empty")
    if not all(np.all(np.isfinite(one)) for one in arrays[:finite]):
        raise UsageError(
            f"a value of the {what} is not finite", remedy="Drop the ones without a place"
        )


_LENTH: dict[str, Callable[[lenth.Rays], lenth.PlanePosition | None]] = {
    "mle": lenth.maximum_likelihood,
    "rmr": lambda rays: lenth.repeated_median(rays, as_original=True),
    "mest": lambda rays: lenth.m_estimate(rays, as_original=True),
    "rmr_ahead": lambda rays: lenth.repeated_median(rays, as_original=False),
    "mest_lenth": lambda rays: lenth.m_estimate(rays, as_original=False),
}


def _lenth(stations: Stations, method: str) -> Position:
    plane = plane_around(stations.latitude_deg, stations.longitude_deg)
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    rays = lenth.Rays(east_m=east, north_m=north, bearing_deg=stations.bearing_deg)
    found = _LENTH[method](rays)
    if found is None:
        raise UsageError(
            f"{method} finds no place that fits these bearings", remedy="Use the method bayes"
        )
    latitude, longitude = plane.to_geodetic(found.east_m, found.north_m)
    covariance = found.covariance_m2
    return Position(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        method=method,
        stations=len(east),
        radius50_m=None if covariance is None else normal_radius_m(covariance, 0.5),
        radius95_m=None if covariance is None else normal_radius_m(covariance, 0.95),
        ellipse95=None if covariance is None else ellipse_of(covariance),
    )


def _bayes(
    stations: Stations | None,
    powers: PowerTrack | None,
    outlier_share: float,
    propagation: Propagation,
    max_range_m: float | None,
) -> Position:
    everywhere = [one for one in (stations, powers) if one is not None]
    plane = plane_around(
        np.concatenate([one.latitude_deg for one in everywhere]),
        np.concatenate([one.longitude_deg for one in everywhere]),
    )
    bearings = [] if stations is None else _bearing_evidence(stations, plane, outlier_share)
    levels = None if stations is None else _level_evidence(stations, plane, propagation)
    track = None if powers is None else _power_evidence(powers, plane, propagation)

    tracks = [plane.to_local(one.latitude_deg, one.longitude_deg) for one in everywhere]
    surveyed = _area(tracks, 0.0)
    near_track = _prior_near_track(surveyed, sum(_length_m(*one) for one in tracks))

    def log_likelihood(east_m: _Floats, north_m: _Floats, cell_m: float) -> _Floats:
        total = np.zeros(len(east_m))
        if bearings:
            total += _prior_of_distance(surveyed, east_m, north_m)
            each = [one.log_likelihood(east_m, north_m, cell_m) for one in bearings]
            total += np.logaddexp.reduce(each)
        if levels is not None:
            total += levels.log_likelihood(east_m, north_m)
        if track is not None:
            total += near_track(east_m, north_m) if stations is None else 0.0
            total += track.fit(east_m, north_m).log_likelihood
        return total

    length = float(
        np.hypot(surveyed.east_m - surveyed.west_m, surveyed.north_m - surveyed.south_m)
    )
    margin = max_range_m or (max(300.0, 0.5 * length) if stations is None else _BEARING_RANGE_M)
    cells = _BEARING_CELLS if track is None else _POWER_CELLS
    grid = grid_posterior(log_likelihood, _area(tracks, margin), cells=cells)
    # Powers alone leave mirror images and long tails, where the most probable place is often
    # the wrong one. Of 600 surveys with lasting fading a tenth were more than 41 m off with it,
    # 32 m with the geometric median, 30.7 m with the mean (medians 12, 10 and 11 m).
    point = grid.mean() if stations is None else grid.most_probable()
    east, north = point
    latitude, longitude = plane.to_geodetic(east, north)
    fit = None if track is None else track.fit(np.array([east]), np.array([north]))
    return Position(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        method="bayes",
        stations=0 if stations is None else len(stations.bearing_deg),
        pulses=0 if powers is None else len(powers.snr_db),
        radius50_m=grid.radius_m(0.5, point),
        radius95_m=grid.radius_m(0.95, point),
        ellipse95=grid.ellipse(),
        outlier_probabilities=_outliers(bearings, grid),
        level_db=None if fit is None else float(fit.level_db[0]),
        path_loss_exponent=None if fit is None else float(fit.exponent[0]),
        at_edge=grid.at_edge,
        grid=PositionGrid(
            latitude_deg=plane.latitude_deg,
            longitude_deg=plane.longitude_deg,
            east_m=grid.east_m,
            north_m=grid.north_m,
            probability=grid.probability,
        ),
    )


def _outliers(bearings: list[BearingEvidence], grid: GridPosterior) -> tuple[float, ...] | None:
    """Of the most likely standard deviation, where several are weighed."""
    if not bearings:
        return None
    east, north = grid.places()
    best = int(np.argmax(grid.probability))
    score = [
        one.log_likelihood(east[best : best + 1], north[best : best + 1], grid.cell_m)[0]
        for one in bearings
    ]
    return bearings[int(np.argmax(score))].outlier_probabilities(
        east, north, grid.probability.ravel(), grid.cell_m
    )


def _bearing_evidence(
    stations: Stations, plane: TangentPlane, outlier_share: float
) -> list[BearingEvidence]:
    """One for each standard deviation that the bearings may have; all equally likely."""
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    if stations.posterior is not None:
        densities = [stations.posterior]
    elif stations.sigma_deg is not None:
        densities = [von_mises(stations.bearing_deg, stations.sigma_deg)]
    else:
        densities = [
            von_mises(stations.bearing_deg, np.full(len(east), sigma))
            for sigma in UNKNOWN_SIGMAS_DEG
        ]
    return [BearingEvidence(east, north, one, outlier_share=outlier_share) for one in densities]


def _power_evidence(
    powers: PowerTrack, plane: TangentPlane, propagation: Propagation
) -> PowerEvidence:
    east, north = plane.to_local(powers.latitude_deg, powers.longitude_deg)
    return PowerEvidence(east, north, powers, propagation)


def _level_evidence(
    stations: Stations, plane: TangentPlane, propagation: Propagation
) -> LevelEvidence | None:
    """Levels of the rotations, which have the antenna's gain taken out already."""
    if stations.level_db is None or len(stations.level_db) < 2:
        return None
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    nothing = np.zeros(len(east))
    return LevelEvidence(
        east,
        north,
        nothing if stations.height_m is None else stations.height_m,
        stations.level_db,
        nothing if stations.level_sigma_db is None else stations.level_sigma_db,
        propagation,
    )


def _prior_of_distance(around: Area, east_m: _Floats, north_m: _Floats) -> _Floats:
    """Log-prior of a place seen from afar: every doubling of the distance is equally likely.

    It decides nothing where bearings cross well. Where they hardly do, a flat prior would put
    the tag into the far end of the wedge, which has the largest area: stations 60 m apart and a
    tag at 300 m then gave errors of 136 m at the median and 2.5 km in a tenth of the runs, and
    77 m and 153 m with this one; its circles hold what they say.
    """
    middle_east = 0.5 * (around.west_m + around.east_m)
    middle_north = 0.5 * (around.south_m + around.north_m)
    extent = np.hypot(around.east_m - around.west_m, around.north_m - around.south_m)
    distance = np.hypot(east_m - middle_east, north_m - middle_north)
    return np.asarray(-2.0 * np.log(np.maximum(distance, max(_NEAR_M, 0.5 * float(extent)))))


def _prior_near_track(surveyed: Area, length_m: float) -> LogDensity:
    """Log-prior of a power survey: it is flown where the tag is expected.

    Uniform inside the surveyed rectangle; outside, a factor e for each quarter of the lines'
    spacing, which is the rectangle over the track's length: a survey reaches half a spacing to
    both sides of its lines. Power alone hardly tells a tag beyond the outermost line from its
    mirror image. Where no area was flown over, as along a single line, it is a tenth of the
    extent.
    """
    wide, high = surveyed.east_m - surveyed.west_m, surveyed.north_m - surveyed.south_m
    scale_m = 0.1 * max(wide, high)
    if min(wide, high) > 0.2 * max(wide, high):
        scale_m = min(scale_m, 0.25 * wide * high / max(length_m, 1.0))
    scale_m = max(scale_m, 5.0)

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
    """Rectangle around some tracks, with a margin."""
    east = np.concatenate([one[0] for one in tracks])
    north = np.concatenate([one[1] for one in tracks])
    return Area(
        west_m=float(east.min() - margin_m),
        east_m=float(east.max() + margin_m),
        south_m=float(north.min() - margin_m),
        north_m=float(north.max() + margin_m),
    )
