"""Check whether bearings agree and, if they do not, find an explanation for all of them.

A wrong compass or a walking animal turns all bearings of a flight together, so that none of
them alone is conspicuous. With four stations around the tag, three explanations can be
compared: a resting tag, a walking tag, and a common heading error. Each is fitted to the
bearings (with outliers). They are compared by their evidence (Laplace's approximation; MacKay
2003, ch. 27).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.angles import difference_deg, widest_gap_deg
from uavrt.localization.position.tuning import COMMON
from uavrt.localization.position.walks import speed_and_direction
from uavrt.localization.results import Caution

_Floats = NDArray[np.float64]


Explanation = Literal["rest", "compass", "walk"]
UNUSUAL: frozenset[Explanation] = frozenset({"compass", "walk"})
"""Explanations of bearings other than a resting tag with usual heading errors."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightBearings:
    """Bearings of one tag in the local plane."""

    east_m: _Floats
    """East coordinates of the positions where the bearings were taken [m], shape (n,)."""
    north_m: _Floats
    bearing_deg: _Floats
    sigma_deg: _Floats
    """Standard deviation of each bearing without errors common to all [deg], shape (n,)."""
    time_s: _Floats | None = None
    """Times of the bearings [s], shape (n,); None for a tag that rests."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Fit of one explanation (rest, walk or compass) to the bearings."""

    explanation: Explanation
    place: _Floats
    """East and north of the tag [m], shape (2,); for a walking tag, at the last bearing."""
    covariance_m2: _Floats
    heading_error_deg: float
    heading_error_sigma_deg: float
    velocity_m_s: _Floats
    """Velocity of the tag to the east and north [m/s], shape (2,)."""
    inlier: _Floats
    """Probability that each bearing belongs to the tag, shape (n,)."""
    misfit: float
    """Probability that bearings would scatter at least this much if this explanation were
    true."""
    log_evidence: float

    def middle_of(self, bearings: FlightBearings) -> tuple[float, float]:
        """East and north of the tag in the middle of the flight [m]."""
        ago_s = 0.0 if bearings.time_s is None else 0.5 * float(np.ptp(bearings.time_s))
        east, north = self.place - ago_s * self.velocity_m_s
        return float(east), float(north)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Model:
    explanation: Explanation
    share: float
    heading_sigma_deg: float
    speed_m_s: float


def stations_around(east_m: _Floats, north_m: _Floats, place: tuple[float, float]) -> bool:
    """True if enough stations surround a position for errors common to all bearings to be
    detected.
    """
    if len(east_m) < COMMON.least_stations:
        return False
    seen = np.degrees(np.arctan2(east_m - place[0], north_m - place[1]))
    return widest_gap_deg(seen) <= COMMON.widest_gap_deg


def explanations(
    bearings: FlightBearings,
    place: tuple[float, float],
    *,
    heading_sigma_deg: float,
    outlier_share: float,
    unusual: frozenset[Explanation] = UNUSUAL,
) -> list[tuple[float, Fit]]:
    """Fit all explanations; return each with its probability, the resting tag first."""
    models = []
    if "compass" in unusual:
        models.append(
            _Model(
                explanation="compass",
                share=COMMON.wrong_compass_share,
                heading_sigma_deg=COMMON.wrong_compass_deg,
                speed_m_s=0.0,
            )
        )
    timed = bearings.time_s is not None and np.ptp(bearings.time_s) >= COMMON.least_span_s
    if timed and "walk" in unusual:
        models.append(
            _Model(
                explanation="walk",
                share=COMMON.walking_share,
                heading_sigma_deg=heading_sigma_deg,
                speed_m_s=COMMON.walking_m_s,
            )
        )
    resting = _Model(
        explanation="rest",
        share=1.0 - sum(one.share for one in models),
        heading_sigma_deg=heading_sigma_deg,
        speed_m_s=0.0,
    )
    fits = [_best(bearings, place, one, outlier_share) for one in (resting, *models)]
    score = np.array([one.log_evidence for one in fits])
    weight = np.exp(score - score.max())
    return list(zip((float(w) for w in weight / weight.sum()), fits, strict=True))


def _best(
    bearings: FlightBearings, place: tuple[float, float], model: _Model, outlier_share: float
) -> Fit:
    middle = (float(np.mean(bearings.east_m)), float(np.mean(bearings.north_m)))
    fits = []
    for east, north in (place, middle):
        off = difference_deg(bearings.bearing_deg, _azimuth(bearings, np.array([east, north])))
        turns = (0.0, float(np.median(off))) if model.explanation == "compass" else (0.0,)
        for turn in turns:
            start = np.array([east, north, turn, 0.0, 0.0])
            fits.append(_fitted(bearings, start, model, outlier_share))
    return max(fits, key=lambda one: one.log_evidence)


def _azimuth(bearings: FlightBearings, place: _Floats) -> _Floats:
    east, north = place[0] - bearings.east_m, place[1] - bearings.north_m
    return np.asarray(np.degrees(np.arctan2(east, north)))


def _fitted(
    bearings: FlightBearings, start: _Floats, model: _Model, outlier_share: float
) -> Fit:
    """Fit one explanation of the bearings by Gauss–Newton iterations, weighted by outlier
    probabilities.
    """
    ago = np.zeros(len(bearings.east_m))
    if bearings.time_s is not None and model.speed_m_s > 0.0:
        ago = bearings.time_s - bearings.time_s.max()
    sigmas = np.array([max(model.heading_sigma_deg, 1e-3)] + 2 * [max(model.speed_m_s, 1e-6)])
    prior = np.concatenate([[1e-12, 1e-12], sigmas**-2.0])
    theta = start.copy()
    for number in range(COMMON.rounds):
        loose = max(1.0, 6.0 * (1.0 - number / COMMON.loose_rounds))
        residual, slopes = _linearised(bearings, theta, ago)
        weight = _inlier(residual, loose * bearings.sigma_deg, outlier_share)
        weight = weight / (loose * bearings.sigma_deg) ** 2
        curvature = (slopes.T * weight) @ slopes + np.diag(prior)
        step = np.linalg.solve(curvature, (slopes.T * weight) @ residual - prior * theta)
        length = float(np.hypot(step[0], step[1]))
        theta = theta + step * min(1.0, 300.0 / max(length, 1e-9))
        if number >= COMMON.loose_rounds and length < 0.05:
            break
    residual, slopes = _linearised(bearings, theta, ago)
    inlier = _inlier(residual, bearings.sigma_deg, outlier_share)
    curvature = (slopes.T * (inlier / bearings.sigma_deg**2)) @ slopes + np.diag(prior)
    covariance = np.linalg.inv(curvature)
    density = (1.0 - outlier_share) * _normal(residual, bearings.sigma_deg)
    log_likelihood = float(np.log(density + outlier_share / 360.0).sum())
    log_prior = float(np.sum(-0.5 * (theta[2:] / sigmas) ** 2 - np.log(sigmas)))
    _, log_det = np.linalg.slogdet(curvature)
    # Residuals in units of what they scatter by, the fitted common error's own prior included.
    squares = float(np.sum((residual / bearings.sigma_deg) ** 2))
    squares += float(np.sum((theta[2:] / sigmas) ** 2))
    return Fit(
        explanation=model.explanation,
        place=theta[:2],
        covariance_m2=np.asarray(covariance[:2, :2], np.float64),
        heading_error_deg=float(theta[2]),
        heading_error_sigma_deg=float(covariance[2, 2]) ** 0.5,
        velocity_m_s=theta[3:],
        inlier=inlier,
        misfit=float(special.chdtrc(max(1, len(residual) - 2), squares)),
        log_evidence=np.log(model.share) + log_likelihood + log_prior - 0.5 * float(log_det),
    )


def _linearised(
    bearings: FlightBearings, theta: _Floats, ago: _Floats
) -> tuple[_Floats, _Floats]:
    east = theta[0] + theta[3] * ago - bearings.east_m
    north = theta[1] + theta[4] * ago - bearings.north_m
    square = np.maximum(east**2 + north**2, 25.0)
    residual = difference_deg(
        bearings.bearing_deg, np.degrees(np.arctan2(east, north)) + theta[2]
    )
    to_east, to_north = np.degrees(north / square), np.degrees(-east / square)
    slopes = np.stack(
        [to_east, to_north, np.ones(len(east)), to_east * ago, to_north * ago], axis=1
    )
    return np.asarray(residual), slopes


def _normal(residual: _Floats, sigma: _Floats) -> _Floats:
    return np.asarray(np.exp(-0.5 * (residual / sigma) ** 2) / (sigma * np.sqrt(2.0 * np.pi)))


def _inlier(residual: _Floats, sigma: _Floats, outlier_share: float) -> _Floats:
    good = (1.0 - outlier_share) * _normal(residual, sigma)
    return np.asarray(good / (good + outlier_share / 360.0))


UNCHECKED = Caution(
    name="unchecked",
    text="an error shared by all bearings (of the compass, or by a moving tag) cannot be "
    f"checked: this needs {COMMON.least_stations} bearings from different sides of the tag",
)

UNKNOWN_SIGMAS = Caution(
    name="unchecked",
    text="an error shared by all bearings (of the compass, or by a moving tag) cannot be "
    "checked, because the bearings have no error estimates",
)


def cautions_of(
    fit: Fit, outlier_probabilities: tuple[float, ...] | None = None
) -> tuple[Caution, ...]:
    """Cautions for the operator on the most probable explanation and on outliers."""
    found = []
    if fit.explanation == "compass":
        text = (
            f"all bearings seem turned by {fit.heading_error_deg:+.0f}° "
            f"± {fit.heading_error_sigma_deg:.0f}°: check compass, mounting and declination"
        )
        found.append(Caution(name="compass", text=text))
    if fit.explanation == "walk":
        east, north = fit.velocity_m_s
        speed, towards = speed_and_direction((float(east), float(north)))
        text = (
            f"the tag seems to have walked at {speed:.1f} m/s towards {towards:.0f}°; "
            "the position is that at the last bearing"
        )
        found.append(Caution(name="walk", text=text))
    odd = _odd(fit, outlier_probabilities)
    scatter = bool(np.all(fit.inlier >= 0.5)) and fit.misfit < COMMON.contradiction
    return (*found, *_cautions_of_odd(odd, scatter=scatter))


def cautions_of_outliers(outlier_probabilities: tuple[float, ...]) -> tuple[Caution, ...]:
    """Cautions for the operator about outliers among bearings whose errors are unknown."""
    return _cautions_of_odd(np.array(outlier_probabilities) > 0.5, scatter=False)


def _cautions_of_odd(odd: NDArray[np.bool_], *, scatter: bool) -> tuple[Caution, ...]:
    """Cautions about outliers among the bearings, and about other bearings that scatter too
    much.
    """
    numbers = np.flatnonzero(odd) + 1
    few = len(odd) - len(numbers) < COMMON.least_agreeing
    if scatter or len(numbers) >= 2 or (len(numbers) == 1 and few):
        text = f"{_contradicting(numbers)}, so the position may be wrong"
        return (Caution(name="contradiction", text=text),)
    if len(numbers):
        text = f"bearing {numbers[0]} contradicts the other bearings and is left out"
        return (Caution(name="outlier", text=text),)
    return ()


def _contradicting(numbers: NDArray[np.int64]) -> str:
    if not len(numbers):
        return "the bearings contradict each other more than their errors allow"
    if len(numbers) == 1:
        return f"bearing {numbers[0]} contradicts the other bearings"
    first = ", ".join(str(one) for one in numbers[:-1])
    return f"bearings {first} and {numbers[-1]} contradict the other bearings"


def _odd(fit: Fit, outlier_probabilities: tuple[float, ...] | None) -> NDArray[np.bool_]:
    """True for outlying bearings, unless a second lobe of the bearing's posterior agrees, shape
    (n,).
    """
    if fit.explanation != "rest" or outlier_probabilities is None:
        return np.asarray(fit.inlier < 0.5)
    return np.array(outlier_probabilities) > 0.5
