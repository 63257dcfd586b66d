"""Estimate a position with any of the available methods: `estimate_position`."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import NotFound, UsageError
from uavrt.core.plugins import Registry
from uavrt.localization.position.bayes_fix import ellipse_of, normal_radius_m
from uavrt.localization.position.bayes_model import Known
from uavrt.localization.position.bayes_position import bayes_position
from uavrt.localization.position.bearings import lenth
from uavrt.localization.position.bearings.common_errors import UNUSUAL
from uavrt.localization.position.bearings.observers import Displacement
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.follow import Follow
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.tuning import COMMON, SURVEY
from uavrt.localization.results import Position, PositionMethod
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import RECEIVERS

_Floats = NDArray[np.float64]
PositionEstimator = Callable[[Stations | None, PowerTrack | None], Position]
ADDED_METHODS: Registry[PositionEstimator] = Registry("uavrt.position_methods", {})
"""Position estimators that installed packages provide, by the name of the method."""


def estimate_position(
    stations: Stations | None = None,
    powers: PowerTrack | None = None,
    *,
    method: PositionMethod | str = "bayes",
    outlier_share: float | None = None,
    heading_sigma_deg: float = COMMON.heading_sigma_deg,
    height_sigma_m: float = SURVEY.height_sigma_m,
    propagation: Propagation | None = None,
    displacement: float | tuple[Displacement, ...] = 0.0,
    max_range_m: float | None = None,
    follow: bool = False,
    hills: HillLosses | None = None,
) -> Position:
    """Estimate where a tag is, from bearings, from powers along a track, or from both.

    Parameters
    ----------
    stations : Stations, optional
        Bearings. One gives a wedge, two or more a position.
    powers : PowerTrack, optional
        Powers, for the method ``bayes``, without pulses already used in the bearings.
    method : str
        ``"bayes"`` (the default); ``"track"``, which follows a tag unless a fixed position
        explains the data; ``"mle"``, ``"rmr"``, ``"mest"`` as UAV-RT computes
        them; ``"rmr_ahead"``, ``"mest_lenth"``, which are corrected; or one of an installed
        package (docs/how-to/extend.md).
    outlier_share : float, optional
        Prior probability that a bearing is unrelated to the tag; by default 0.05, and
        0.02 for one to three bearings, which cannot expose an outlier.
    heading_sigma_deg : float
        Standard deviation of the error that all headings of the flight share (compass,
        mounting, declination); 0 means exact headings. Stations around the tag estimate it.
    height_sigma_m : float
        Standard deviation of the error that all heights of the powers share (terrain, a tag on
        a tree); 0 means exact heights. Many powers estimate it.
    propagation : Propagation, optional
        Knowledge of the path loss.
    displacement : float or tuple of Displacement
        Standard deviation of a position shift that all bearings share, over the distance; or an
        observer's. By hand, bearings often agree with each other better than with the animal.
    max_range_m : float, optional
        Largest distance of the tag from the stations or the track; by default 3000 with
        bearings, else the length of the track.
    follow : bool
        Also compute, with the method ``bayes``, the path of a tag whose timed bearings or
        powers contradict a fixed position.
    hills : HillLosses, optional
        Ground for the method ``bayes``: hills weaken pulses and explain missed ones. Heights
        of stations and powers then count from the ground at the take-off. None is level ground.

    Raises
    ------
    UsageError
        There are no data, powers alone are from one position, arrays differ in length, or the
        method is unknown or finds no position; the text says what to use instead.
    """
    _check(stations, powers)
    if method in ("bayes", "track"):
        few = stations is None or len(stations.bearing_deg) < COMMON.least_stations
        known = Known(
            outlier_share=(0.02 if few else 0.05) if outlier_share is None else outlier_share,
            heading_sigma_deg=heading_sigma_deg,
            propagation=propagation or Propagation(),
            max_range_m=max_range_m,
            # Exact headings exclude a wrong compass.
            unusual=UNUSUAL if heading_sigma_deg > 0.0 else UNUSUAL - {"compass"},
            height_sigma_m=height_sigma_m,
            displacements=displacement
            if isinstance(displacement, tuple)
            else ((1.0, displacement, 0.0),),
            hills=hills,
        )
        when: Follow = "always" if method == "track" else "contradicted" if follow else "never"
        found = bayes_position(stations, powers, known, follow=when)
        return replace(found, method=method) if method == "track" else found
    if method not in _LENTH and method in ADDED_METHODS:
        return ADDED_METHODS[method](stations, powers)
    if method not in _LENTH:
        names = ", ".join(["bayes", "track", *_LENTH, *ADDED_METHODS])
        raise NotFound(f"there is no method {method!r}", remedy=f"Choose from {names}")
    if stations is None or len(stations.bearing_deg) < 2:
        raise UsageError(
            f"the method {method} needs at least two bearings", remedy="Use the method bayes"
        )
    return _lenth(stations, method)


def _check(stations: Stations | None, powers: PowerTrack | None) -> None:
    if stations is None and powers is None:
        raise UsageError(
            "bearings or powers are missing", remedy="Give bearings, powers or both"
        )
    if stations is not None:
        fields = [stations.latitude_deg, stations.longitude_deg, stations.bearing_deg]
        _check_lengths(
            "bearings",
            fields,
            [stations.sigma_deg, stations.level_db, stations.level_sigma_db, stations.time_s],
        )
    if powers is not None:
        fields = [powers.latitude_deg, powers.longitude_deg, powers.height_m]
        _check_lengths("powers", fields, [powers.snr_db, powers.yaw_deg, powers.time_s])
        if np.count_nonzero(~np.isnan(powers.snr_db)) < 3:
            raise UsageError(
                "fewer than three powers are given", remedy="Fly nearer, or turn in place"
            )
        if powers.antenna is not None and powers.yaw_deg is None:
            raise UsageError("a directional antenna needs headings", remedy="Give yaw_deg")
        if (
            stations is None
            and powers.antenna is None
            and _extent_m(powers) < RECEIVERS.one_place_m
        ):
            raise UsageError(
                "signal strengths from one place give neither direction nor distance",
                remedy=f"Fly {RECEIVERS.one_place_m:.0f} m or more past the tag, or turn "
                "an antenna",
            )


def _extent_m(powers: PowerTrack) -> float:
    plane = plane_around(powers.latitude_deg, powers.longitude_deg)
    places = plane.to_local(powers.latitude_deg, powers.longitude_deg)
    spans = [np.subtract(*np.quantile(one, [0.95, 0.05])) for one in places]
    return float(np.hypot(*spans))


def _check_lengths(what: str, needed: list[_Floats], optional: list[_Floats | None]) -> None:
    arrays = [*needed, *(one for one in optional if one is not None)]
    if len({one.shape for one in arrays}) != 1 or not len(needed[0]):
        raise UsageError(f"the arrays of the {what} differ in length or are empty")
    if not all(np.all(np.isfinite(one)) for one in arrays[:3]):
        raise UsageError(
            f"a position, height or bearing among the {what} is not finite",
            remedy=f"Leave out {what} with NaN or infinite values there",
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
            f"the method {method} finds no position that fits these bearings",
            remedy="Use the method bayes",
        )
    latitude, longitude = plane.to_geodetic(found.east_m, found.north_m)
    covariance = _of_few(found.covariance_m2, len(east))
    return Position(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        method=method,
        stations=len(east),
        radius50_m=_radius_m(covariance, 0.5, len(east)),
        radius95_m=_radius_m(covariance, 0.95, len(east)),
        ellipse95=None
        if covariance is None
        else ellipse_of(covariance * _wider(0.95, len(east)) ** 2),
    )


def _of_few(covariance_m2: _Floats | None, stations: int) -> _Floats | None:
    """Covariance of Lenth's estimate, multiplied by n / (n - 2) for n bearings; None for two
    bearings.
    """
    if covariance_m2 is None or stations < 3:
        return None
    return covariance_m2 * (stations / (stations - 2))


def _wider(share: float, stations: int) -> float:
    """Factor by which a confidence region's radius grows because the scatter is estimated
    (Hotelling's T²).

    2 F(2, n - 2) replaces chi-squared with 2 degrees of freedom; the quantiles of both have
    closed formulas.
    """
    left = stations - 2
    squared = left * ((1.0 - share) ** (-2.0 / left) - 1.0)
    return float(np.sqrt(squared / (-2.0 * np.log(1.0 - share))))


def _radius_m(covariance_m2: _Floats | None, share: float, stations: int) -> float | None:
    if covariance_m2 is None:
        return None
    return normal_radius_m(covariance_m2, share) * _wider(share, stations)
