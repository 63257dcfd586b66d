"""`estimate_position`: one door to all estimators of a place."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavrt.errors import UsageError
from uavrt.localization import lenth
from uavrt.localization.angles import difference_deg
from uavrt.localization.bayes_fix import (
    FIRST_CELLS,
    HELD,
    Area,
    Cells,
    LogLikelihood,
    cells_posterior,
    cells_refined,
    ellipse_of,
    map_of,
    most_probable,
    normal_radius_m,
)
from uavrt.localization.bearing_evidence import (
    UNKNOWN_SIGMAS_DEG,
    BearingEvidence,
    Doubts,
    von_mises,
)
from uavrt.localization.common_errors import (
    LEAST_STATIONS,
    UNCHECKED,
    UNKNOWN_SIGMAS,
    UNUSUAL,
    WALKING_M_S,
    WRONG_COMPASS_DEG,
    Explanation,
    Fit,
    FlightBearings,
    cautions_of,
    explanations,
    stations_around,
)
from uavrt.localization.level_evidence import LevelEvidence, Propagation
from uavrt.localization.posterior import LOBE_DEG
from uavrt.localization.power_evidence import PowerTrack
from uavrt.localization.records import (
    Bearing,
    Caution,
    Position,
    PositionGrid,
    PositionMethod,
    SharedError,
    Widening,
)
from uavrt.localization.survey_errors import (
    HEIGHT_SIGMA_M,
    SurveyErrors,
    SurveyEvidence,
    cautions_of_survey,
)
from uavrt.plugins import Registry
from uavrt.tangent_plane import TangentPlane, plane_around

_Floats = NDArray[np.float64]
LogDensity = Callable[[_Floats, _Floats], _Floats]
"""East and north (places,) to (places,)."""

_BEARING_RANGE_M = 3000.0
_NEAR_M = 100.0
"""Nearer than that all places are equally likely."""
HEADING_SIGMA_DEG = 1.5
"""Error that all headings of a flight share, were nothing said of it: a calibrated compass, a
mounting by eye, and the declination."""
_NEGLIGIBLE = 0.005
"""Explanations less probable than that change no circle."""
_BEARING_CELLS = 100
_SURVEY_FIRST_CELLS = 28
_SURVEY_HELD = 2e-3
"""Circles and the mean ask for no smaller cells, each of which costs some hundred pulses."""
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
    time_s: _Floats | None = None
    """(n,) when each was taken, from any origin; None takes it that the tag rests."""

    @classmethod
    def of(
        cls,
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        bearings: list[Bearing],
        time_s: ArrayLike | None = None,
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
        )


PositionEstimator = Callable[[Stations | None, PowerTrack | None], Position]
ADDED_METHODS: Registry[PositionEstimator] = Registry("uavrt.position_methods", {})
"""Estimators that installed packages add, by the name of the method."""


def estimate_position(
    stations: Stations | None = None,
    powers: PowerTrack | None = None,
    *,
    method: PositionMethod | str = "bayes",
    outlier_share: float | None = None,
    heading_sigma_deg: float = HEADING_SIGMA_DEG,
    height_sigma_m: float = HEIGHT_SIGMA_M,
    propagation: Propagation | None = None,
    max_range_m: float | None = None,
    widenings: bool = False,
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
    outlier_share : float, optional
        Prior probability that a bearing has nothing to do with the tag; by default 0.05, and
        0.02 for one to three bearings, of which none can tell the other wrong.
    heading_sigma_deg : float
        Standard deviation of the error that all headings of the flight share (compass,
        mounting, declination). It is estimated where the stations tell it; 0 takes the headings
        for true.
    height_sigma_m : float
        Standard deviation of the error that all heights of the powers share (terrain, a tag on
        a tree). It is estimated where the powers tell it; 0 takes the heights for true.
    propagation : Propagation, optional
        What is known of the path loss.
    max_range_m : float, optional
        How far from the stations or the track the tag may be; 3000 with bearings, else as far
        as the track is long.
    widenings : bool
        Tell also what each error that the bearings, or the powers, may share adds to the radius
        of 95 %, to the method ``bayes``.

    Raises
    ------
    UsageError
        There is nothing to estimate from, arrays differ in length, or the method is unknown or
        does not come to a position; the text says what to use instead.
    """
    _check(stations, powers)
    if method == "bayes":
        few = stations is None or len(stations.bearing_deg) < LEAST_STATIONS
        known = _Known(
            outlier_share=(0.02 if few else 0.05) if outlier_share is None else outlier_share,
            heading_sigma_deg=heading_sigma_deg,
            propagation=propagation or Propagation(),
            max_range_m=max_range_m,
            # Headings that are known leave no compass wrong.
            unusual=UNUSUAL if heading_sigma_deg > 0.0 else UNUSUAL - {"compass"},
            survey=SurveyErrors(height_sigma_m=height_sigma_m),
        )
        return _bayes(stations, powers, known, widenings=widenings)
    if method not in _LENTH and method in ADDED_METHODS:
        return ADDED_METHODS[method](stations, powers)
    if method not in _LENTH:
        names = ", ".join(["bayes", *_LENTH, *ADDED_METHODS])
        raise UsageError(f"there is no method {method!r}", remedy=f"Known are {names}")
    if stations is None or len(stations.bearing_deg) < 2:
        raise UsageError(f"{method} needs two bearings", remedy="Use the method bayes")
    return _lenth(stations, method)


def _check(stations: Stations | None, powers: PowerTrack | None) -> None:
    if stations is None and powers is None:
        raise UsageError("neither bearings nor powers", remedy="Give one of them")
    if stations is not None:
        fields = [stations.latitude_deg, stations.longitude_deg, stations.bearing_deg]
        _check_lengths(
            "bearings",
            fields,
            [
                stations.sigma_deg,
                stations.level_db,
                stations.level_sigma_db,
                stations.time_s,
            ],
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Known:
    """What is believed before the flight."""

    outlier_share: float
    heading_sigma_deg: float
    propagation: Propagation
    max_range_m: float | None
    unusual: frozenset[Explanation]
    survey: SurveyErrors


class _Model:
    """The likelihood of places, from all that there is."""

    def __init__(
        self, stations: Stations | None, powers: PowerTrack | None, known: _Known
    ) -> None:
        everywhere = [one for one in (stations, powers) if one is not None]
        self.plane = plane_around(
            np.concatenate([one.latitude_deg for one in everywhere]),
            np.concatenate([one.longitude_deg for one in everywhere]),
        )
        self.known = known
        self.stations, self.powers = stations, powers
        self.bearings: list[BearingEvidence] = []
        self._levels = None
        if stations is not None:
            self.bearings = _bearing_evidence(stations, self.plane, known)
            self._levels = _level_evidence(stations, self.plane, known.propagation)
        self.track = None if powers is None else _power_evidence(powers, self.plane, known)
        self.tracks = [
            self.plane.to_local(one.latitude_deg, one.longitude_deg) for one in everywhere
        ]
        self._surveyed = _area(self.tracks, 0.0)
        self._near_track = _prior_near_track(
            self._surveyed, sum(_length_m(*one) for one in self.tracks)
        )

    @property
    def area(self) -> Area:
        """Where the tag may be."""
        around = self._surveyed
        length = float(np.hypot(around.east_m - around.west_m, around.north_m - around.south_m))
        margin = max(300.0, 0.5 * length) if self.stations is None else _BEARING_RANGE_M
        return _area(self.tracks, self.known.max_range_m or margin)

    def log_likelihood(self, east_m: _Floats, north_m: _Floats, cell_m: _Floats) -> _Floats:
        """(places,) with the prior of the place."""
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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solved:
    """The posterior, whatever explains the bearings, and the point that is told."""

    log_likelihood: LogLikelihood
    cells: Cells
    resting: Cells
    """The posterior of a tag that rests, headings being as usual."""
    agreement: "_Agreement"
    point: tuple[float, float]


def _solved(model: _Model) -> _Solved:
    surveyed = model.track is not None
    cells = cells_posterior(
        model.log_likelihood,
        model.area,
        first_cells=_SURVEY_FIRST_CELLS if surveyed else FIRST_CELLS,
        held=_SURVEY_HELD if surveyed else HELD,
    )
    if model.stations is None:
        # Powers alone leave mirror images and long tails, where the most probable place is
        # often the wrong one. Of 600 surveys with lasting fading a tenth were more than 41 m
        # off with it, 32 m with the geometric median, 30.7 m with the mean (medians 12, 10 and
        # 11 m).
        return _Solved(
            log_likelihood=model.log_likelihood,
            cells=cells,
            resting=cells,
            agreement=_Agreement(),
            point=cells.mean(),
        )
    point = most_probable(cells, model.log_likelihood)
    return _explained(model, cells, point, _agreement(model, point))


def _explained(
    model: _Model, resting: Cells, point: tuple[float, float], agreement: "_Agreement"
) -> _Solved:
    """Add to the places of a resting tag those of the other explanations."""
    log_likelihood: LogLikelihood = model.log_likelihood
    cells = resting
    if agreement.others:
        mixture = _Mixture(
            resting=model.log_likelihood,
            log_evidence=resting.log_evidence,
            others=agreement.others,
        )
        log_likelihood = mixture.log_likelihood
        known = mixture.added_to(
            resting.log_density, resting.east_m, resting.north_m, resting.width_m
        )
        cells = cells_refined(log_likelihood, resting, known)
        point = most_probable(cells, log_likelihood)
    return _Solved(
        log_likelihood=log_likelihood,
        cells=cells,
        resting=resting,
        agreement=agreement,
        point=point,
    )


def _widenings(model: _Model, solved: _Solved) -> tuple[Widening, ...]:
    """What each prior that is on does to the radius, each taken out by itself."""
    known, agreement = model.known, solved.agreement
    radius_m = solved.cells.radius_m(0.95, solved.point)
    without: list[tuple[SharedError, str, float]] = []
    if model.powers is not None:
        without += _widenings_of_survey(model)
    if model.stations is not None and known.heading_sigma_deg > 0.0:
        less = _Model(model.stations, model.powers, replace(known, heading_sigma_deg=0.0))
        text = f"the common heading error of {known.heading_sigma_deg:g}°"
        without.append(("heading", text, _radius95_m(_solved(less))))
    for explanation, text in _UNUSUAL_TEXTS.items():
        if all(fit.explanation != explanation for _, fit in agreement.found):
            continue
        less_m = radius_m
        if any(fit.explanation == explanation for _, fit in agreement.others):
            point = most_probable(solved.resting, model.log_likelihood)
            rest = agreement.without(explanation)
            less_m = _radius95_m(_explained(model, solved.resting, point, rest))
        without.append((explanation, text, less_m))
    found = [
        Widening(prior=prior, text=text, radius95_without_m=less_m, by_m=radius_m - less_m)
        for prior, text, less_m in without
    ]
    return tuple(sorted(found, key=lambda one: -one.by_m))


def _widenings_of_survey(model: _Model) -> list[tuple[SharedError, str, float]]:
    survey = model.known.survey
    less: list[tuple[SharedError, str, SurveyErrors]] = [
        ("fading", "fading that may last", replace(survey, lasting_fading=False)),
        ("foreign", "pulses that may be of others", replace(survey, foreign_pulses=False)),
    ]
    if survey.height_sigma_m > 0.0:
        text = f"the height's error of {survey.height_sigma_m:g} m"
        less.append(("height", text, replace(survey, height_sigma_m=0.0)))
    found = []
    for prior, text, errors in less:
        known = replace(model.known, survey=errors)
        found.append(
            (prior, text, _radius95_m(_solved(_Model(model.stations, model.powers, known))))
        )
    return found


_UNUSUAL_TEXTS: dict[Literal["compass", "walk"], str] = {
    "compass": f"a compass that may be {WRONG_COMPASS_DEG:g}° off",
    "walk": f"an animal that may walk ({WALKING_M_S:g} m/s)",
}


def _radius95_m(solved: _Solved) -> float:
    return solved.cells.radius_m(0.95, solved.point)


def _bayes(
    stations: Stations | None, powers: PowerTrack | None, known: _Known, *, widenings: bool
) -> Position:
    model = _Model(stations, powers, known)
    solved = _solved(model)
    cells, agreement, point = solved.cells, solved.agreement, solved.point
    east, north = point
    latitude, longitude = model.plane.to_geodetic(east, north)
    fit = None if model.track is None else model.track.fit(np.array([east]), np.array([north]))
    map_east, map_north, probability = map_of(
        cells, solved.log_likelihood, _BEARING_CELLS if model.track is None else _POWER_CELLS
    )
    doubts = _doubts(model, cells)
    error, sigma = _heading_error(model, doubts, agreement)
    return Position(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        method="bayes",
        stations=0 if stations is None else len(stations.bearing_deg),
        pulses=0 if powers is None else len(powers.snr_db),
        radius50_m=cells.radius_m(0.5, point),
        radius95_m=cells.radius_m(0.95, point),
        ellipse95=cells.ellipse(),
        outlier_probabilities=None if doubts is None else doubts.outlier_probabilities,
        level_db=None if fit is None else float(fit.level_db[0]),
        path_loss_exponent=None if fit is None else float(fit.exponent[0]),
        at_edge=cells.at_edge,
        grid=PositionGrid(
            latitude_deg=model.plane.latitude_deg,
            longitude_deg=model.plane.longitude_deg,
            east_m=map_east,
            north_m=map_north,
            probability=probability,
        ),
        heading_error_deg=error,
        heading_error_sigma_deg=sigma,
        cautions=agreement.cautions
        + (() if model.track is None else cautions_of_survey(model.track)),
        widenings=_widenings(model, solved) if widenings else (),
        foreign_pulses=0 if model.track is None else model.track.foreign,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Agreement:
    """Whether the bearings agree, and what else than a resting tag explains them."""

    found: tuple[tuple[float, Fit], ...] = ()
    """All explanations with their probabilities, that of a resting tag first."""
    cautions: tuple[Caution, ...] = ()

    @property
    def others(self) -> tuple[tuple[float, Fit], ...]:
        """What else than a resting tag explains the bearings, if that matters."""
        return tuple(one for one in self.found[1:] if one[0] > _NEGLIGIBLE)

    @property
    def best(self) -> Fit | None:
        """The most probable explanation; None when none was sought."""
        return max(self.found, key=lambda one: one[0])[1] if self.found else None

    def without(self, explanation: Explanation) -> "_Agreement":
        """What is left to believe, were an explanation known to be wrong."""
        kept = [one for one in self.found if one[1].explanation != explanation]
        total = sum(probability for probability, _ in kept)
        return _Agreement(
            found=tuple((probability / max(total, 1e-300), fit) for probability, fit in kept),
            cautions=self.cautions,
        )


def _agreement(model: _Model, point: tuple[float, float]) -> _Agreement:
    bearings = _flight_bearings(model)
    if bearings is None:
        return _Agreement(cautions=(UNKNOWN_SIGMAS,))
    if not stations_around(bearings.east_m, bearings.north_m, point):
        middle = (float(np.mean(bearings.east_m)), float(np.mean(bearings.north_m)))
        if not stations_around(bearings.east_m, bearings.north_m, middle):
            return _Agreement(cautions=(UNCHECKED,))
    found = explanations(
        bearings,
        point,
        heading_sigma_deg=model.known.heading_sigma_deg,
        outlier_share=model.known.outlier_share,
        unusual=model.known.unusual,
    )
    _, best = max(found, key=lambda one: one[0])
    around = stations_around(bearings.east_m, bearings.north_m, (best.place[0], best.place[1]))
    return _Agreement(
        found=tuple(found), cautions=cautions_of(best) if around else (UNCHECKED,)
    )


def _flight_bearings(model: _Model) -> FlightBearings | None:
    stations = model.stations
    if stations is None:
        return None
    bearing, sigma = stations.bearing_deg, stations.sigma_deg
    if stations.posterior is not None:
        moments = [_lobe(one) for one in stations.posterior]
        bearing, sigma = (np.array(column) for column in zip(*moments, strict=True))
    east, north = model.plane.to_local(stations.latitude_deg, stations.longitude_deg)
    if sigma is None:
        return None
    return FlightBearings(
        east_m=east,
        north_m=north,
        bearing_deg=bearing,
        sigma_deg=np.maximum(sigma, 0.3),
        time_s=stations.time_s,
    )


def _lobe(posterior: _Floats) -> tuple[float, float]:
    """Mean and standard deviation of the main lobe of whole degrees' probabilities."""
    degrees = np.arange(360.0) * (360.0 / len(posterior))
    off = difference_deg(degrees, float(degrees[int(np.argmax(posterior))]))
    inside = np.abs(off) <= LOBE_DEG
    weight = posterior[inside] / posterior[inside].sum()
    mean = float(weight @ off[inside])
    variance = float(weight @ (off[inside] - mean) ** 2)
    return float(degrees[int(np.argmax(posterior))] + mean), max(variance - 1 / 12, 0.01) ** 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Mixture:
    """Places of a resting tag with headings as usual, and of the other explanations."""

    resting: LogLikelihood
    log_evidence: float
    """Of the resting tag."""
    others: tuple[tuple[float, Fit], ...]

    def log_likelihood(self, east_m: _Floats, north_m: _Floats, cell_m: _Floats) -> _Floats:
        """(places,) of the mixture."""
        resting = self.resting(east_m, north_m, cell_m)
        return self.added_to(resting, east_m, north_m, cell_m)

    def added_to(
        self, resting: _Floats, east_m: _Floats, north_m: _Floats, cell_m: _Floats
    ) -> _Floats:
        """(places,) of the mixture, that of the resting tag being known."""
        rest = 1.0 - sum(probability for probability, _ in self.others)
        parts = [np.log(max(rest, 1e-12)) + resting - self.log_evidence]
        for probability, fit in self.others:
            covariance = fit.covariance_m2[None] + (cell_m[:, None, None] ** 2 / 12) * np.eye(2)
            off = np.stack([east_m, north_m], axis=1) - fit.place
            squares = np.einsum("pi,pij,pj->p", off, np.linalg.inv(covariance), off)
            parts.append(
                np.log(probability / (2.0 * np.pi))
                - 0.5 * (squares + np.log(np.linalg.det(covariance)))
            )
        return np.asarray(np.logaddexp.reduce(parts))


def _heading_error(
    model: _Model, doubts: Doubts | None, agreement: _Agreement
) -> tuple[float | None, float | None]:
    """What all headings err by, as far as the bearings tell."""
    if model.known.heading_sigma_deg <= 0.0 or doubts is None:
        return None, None
    best = agreement.best
    if best is not None and best.explanation != "rest":
        return best.heading_error_deg, best.heading_error_sigma_deg
    if len(model.bearings) != 1:
        return None, None
    return doubts.heading_error_deg, doubts.heading_error_sigma_deg


def _doubts(model: _Model, cells: Cells) -> Doubts | None:
    """Of the most likely standard deviation, where several are weighed."""
    if not model.bearings:
        return None
    top = int(np.argmax(cells.log_density))
    best = slice(top, top + 1)
    score = [
        one.log_likelihood(cells.east_m[best], cells.north_m[best], cells.width_m[best])[0]
        for one in model.bearings
    ]
    return model.bearings[int(np.argmax(score))].doubts(
        cells.east_m, cells.north_m, cells.probability, cells.width_m
    )


def _bearing_evidence(
    stations: Stations, plane: TangentPlane, known: _Known
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


def _power_evidence(powers: PowerTrack, plane: TangentPlane, known: _Known) -> SurveyEvidence:
    east, north = plane.to_local(powers.latitude_deg, powers.longitude_deg)
    return SurveyEvidence(east, north, powers, known.propagation, known.survey)


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
