"""Estimate a position by the method ``bayes``: the posterior of a resting tag, and other
explanations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.localization.angles import difference_deg
from uavrt.localization.bearing.tuning import PATTERN
from uavrt.localization.position.bayes_fix import (
    Cells,
    LogLikelihood,
    cells_posterior,
    cells_refined,
    most_probable,
)
from uavrt.localization.position.bayes_model import Known, Model
from uavrt.localization.position.bearings.bearing_evidence import Doubts
from uavrt.localization.position.bearings.common_errors import (
    UNCHECKED,
    UNKNOWN_SIGMAS,
    Explanation,
    Fit,
    FlightBearings,
    cautions_of,
    cautions_of_outliers,
    explanations,
    stations_around,
)
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.follow import Follow, followed
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.levels.survey_errors import cautions_of_survey
from uavrt.localization.position.tuning import GRID
from uavrt.localization.results import Caution, Position, PositionGrid

_Floats = NDArray[np.float64]


def bayes_position(
    stations: Stations | None,
    powers: PowerTrack | None,
    known: Known,
    *,
    follow: Follow = "never",
) -> Position:
    """Estimate a position from bearings, powers or both, with cautions for the operator."""
    model = Model(stations, powers, known)
    solved = _solved(model)
    cells, agreement, point = solved.cells, solved.agreement, solved.point
    east, north = point
    half_m, sigma_m = (model.shared_sigma_m(point, share) for share in (0.5, 0.95))
    latitude, longitude = model.plane.to_geodetic(east, north)
    fit = None if model.track is None else model.track.fit(np.array([east]), np.array([north]))
    map_east, map_north, probability = cells.map(GRID.map_cells, sigma_m)
    doubts = _doubts(model, cells)
    error, sigma = _heading_error(model, doubts, agreement)
    position = Position(
        latitude_deg=float(latitude),
        longitude_deg=float(longitude),
        method="bayes",
        stations=0 if stations is None else len(stations.bearing_deg),
        pulses=0 if powers is None else len(powers.snr_db),
        radius50_m=cells.radius_m(0.5, point, half_m),
        radius95_m=cells.radius_m(0.95, point, sigma_m),
        ellipse95=cells.ellipse(sigma_m),
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
        cautions=agreement.cautions_of(doubts)
        + (() if model.track is None else cautions_of_survey(model.track))
        + _cautions_of_ground(known),
        foreign_pulses=0 if model.track is None else model.track.foreign,
        listeners=tuple(one.outcome for one in model.listeners),
    )
    return position if follow == "never" else followed(position, model, follow)


def _cautions_of_ground(known: Known) -> tuple[Caution, ...]:
    notes = () if known.hills is None else known.hills.cautions()
    return tuple(Caution(name="ground", text=text) for text in notes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solved:
    """Posterior that includes all explanations of the bearings, and the reported point."""

    cells: Cells
    agreement: "_Agreement"
    point: tuple[float, float]


def _solved(model: Model) -> _Solved:
    surveyed = model.track is not None
    cells = cells_posterior(
        model.log_likelihood,
        model.area,
        first_cells=GRID.survey_first_cells if surveyed else GRID.first_cells,
        held=GRID.survey_held if surveyed else GRID.held,
        growth=GRID.survey_growth if surveyed else 1.0,
        within=model.overflown if surveyed else None,
        shows_m=model.shows_m if surveyed else np.inf,
    )
    if model.stations is None:
        # Powers alone leave mirror images and long tails, where the most probable place is
        # often the wrong one. Of 600 surveys with lasting fading a tenth were more than 41 m
        # off with it, 32 m with the geometric median, 30.7 m with the mean (medians 12, 10 and
        # 11 m).
        return _Solved(
            cells=cells,
            agreement=_Agreement(),
            point=cells.likely_mean(model.log_likelihood),
        )
    point = most_probable(cells, model.log_likelihood)
    return _with_explanations(model, cells, point, _agreement(model, point))


def _with_explanations(
    model: Model, resting: Cells, point: tuple[float, float], agreement: "_Agreement"
) -> _Solved:
    """Add the positions given by other explanations of the bearings to a resting tag's
    posterior.
    """
    cells = resting
    if agreement.others:
        mixture = _Mixture(
            resting=model.log_likelihood,
            log_evidence=resting.log_evidence,
            others=agreement.others,
        )
        known = mixture.added_to(
            resting.log_density, resting.east_m, resting.north_m, resting.width_m
        )
        cells = cells_refined(mixture.log_likelihood, resting, known)
        point = most_probable(cells, mixture.log_likelihood)
    return _Solved(cells=cells, agreement=agreement, point=point)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Agreement:
    """Whether the bearings are consistent, and explanations of them other than a resting
    tag.
    """

    found: tuple[tuple[float, Fit], ...] = ()
    """Explanations of the bearings with their probabilities; the resting tag is the first."""
    reported: Fit | None = None
    unchecked: tuple[Caution, ...] = ()
    """Caution that errors common to all bearings cannot be detected; empty if they can."""

    @property
    def others(self) -> tuple[tuple[float, Fit], ...]:
        """Explanations other than a resting tag whose probability is not negligible."""
        return tuple(one for one in self.found[1:] if one[0] > GRID.negligible)

    @property
    def best(self) -> Fit | None:
        return max(self.found, key=lambda one: one[0])[1] if self.found else None

    def cautions_of(self, doubts: Doubts | None) -> tuple[Caution, ...]:
        outliers = () if doubts is None else doubts.outlier_probabilities
        if self.reported is None:
            return cautions_of_outliers(outliers) + self.unchecked
        return cautions_of(self.reported, outliers or None) + self.unchecked


def _agreement(model: Model, point: tuple[float, float]) -> _Agreement:
    bearings = _flight_bearings(model)
    if bearings is None:
        return _Agreement(unchecked=(UNKNOWN_SIGMAS,))
    if not stations_around(bearings.east_m, bearings.north_m, point):
        middle = (float(np.mean(bearings.east_m)), float(np.mean(bearings.north_m)))
        if not stations_around(bearings.east_m, bearings.north_m, middle):
            return _Agreement(reported=_resting(model, bearings, point), unchecked=(UNCHECKED,))
    found = _explanations(model, bearings, point, model.known.unusual)
    _, best = max(found, key=lambda one: one[0])
    if stations_around(bearings.east_m, bearings.north_m, best.middle_of(bearings)):
        return _Agreement(found=found, reported=best)
    return _Agreement(found=found, reported=found[0][1], unchecked=(UNCHECKED,))


def _explanations(
    model: Model,
    bearings: FlightBearings,
    point: tuple[float, float],
    unusual: frozenset[Explanation],
) -> tuple[tuple[float, Fit], ...]:
    found = explanations(
        bearings,
        point,
        heading_sigma_deg=model.known.heading_sigma_deg,
        outlier_share=model.known.outlier_share,
        unusual=unusual,
    )
    return tuple(found)


def _resting(model: Model, bearings: FlightBearings, point: tuple[float, float]) -> Fit | None:
    if len(bearings.bearing_deg) < 2:
        return None
    ((_, fit),) = _explanations(model, bearings, point, frozenset())
    return fit


def _flight_bearings(model: Model) -> FlightBearings | None:
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
    degrees = np.arange(360.0) * (360.0 / len(posterior))
    off = difference_deg(degrees, float(degrees[int(np.argmax(posterior))]))
    inside = np.abs(off) <= PATTERN.lobe_deg
    weight = posterior[inside] / posterior[inside].sum()
    mean = float(weight @ off[inside])
    variance = float(weight @ (off[inside] - mean) ** 2)
    return float(degrees[int(np.argmax(posterior))] + mean), max(variance - 1 / 12, 0.01) ** 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Mixture:
    """Likelihood of a position as a mixture of a resting tag and other explanations."""

    resting: LogLikelihood
    log_evidence: float
    others: tuple[tuple[float, Fit], ...]

    def log_likelihood(self, east_m: _Floats, north_m: _Floats, cell_m: _Floats) -> _Floats:
        resting = self.resting(east_m, north_m, cell_m)
        return self.added_to(resting, east_m, north_m, cell_m)

    def added_to(
        self, resting: _Floats, east_m: _Floats, north_m: _Floats, cell_m: _Floats
    ) -> _Floats:
        """Log-likelihood of the mixture, given that of the resting tag, shape (places,)."""
        rest = 1.0 - sum(probability for probability, _ in self.others)
        parts = [np.log(max(rest, 1e-12)) + resting - self.log_evidence]
        for probability, fit in self.others:
            wide = cell_m**2 / 12.0
            (a, b), (_, d) = fit.covariance_m2
            a, d = a + wide, d + wide
            determinant = a * d - b * b
            x, y = east_m - fit.place[0], north_m - fit.place[1]
            squares = (d * x * x - 2.0 * b * x * y + a * y * y) / determinant
            parts.append(
                np.log(probability / (2.0 * np.pi)) - 0.5 * (squares + np.log(determinant))
            )
        return np.asarray(np.logaddexp.reduce(parts))


def _heading_error(
    model: Model, doubts: Doubts | None, agreement: _Agreement
) -> tuple[float | None, float | None]:
    if model.known.heading_sigma_deg <= 0.0 or doubts is None:
        return None, None
    best = agreement.best
    if best is not None and best.explanation != "rest":
        return best.heading_error_deg, best.heading_error_sigma_deg
    if len(model.bearings) != 1:
        return None, None
    return doubts.heading_error_deg, doubts.heading_error_sigma_deg


def _doubts(model: Model, cells: Cells) -> Doubts | None:
    """Return heading error and outlier probabilities by the most likely model; None without
    bearings.
    """
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
