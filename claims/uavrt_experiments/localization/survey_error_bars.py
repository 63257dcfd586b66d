"""Experiment L7: surveys by strength with drawn or extreme common errors."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.results import Position
from uavrt.localization.tuning import LEVELS
from uavrt_experiments.figures import measured, share
from uavrt_experiments.localization.circle_bars import height_error_m
from uavrt_experiments.localization.position_bars import survey
from uavrt_experiments.result import Row

_PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_SIDE_M, _SPACING_M = 300.0, 50.0
_FADING_DB = 4.0
_ANY_DB = 60.0
_LASTING = (0.0, 0.3, 0.5, 0.7, 0.85, 0.93)
"""Correlations of the fading of neighbouring pulses, equally likely as in the estimator's
prior."""
_LEAST_EXPONENT, _MOST_EXPONENT = 1.6, 4.5
_HELD = 0.88
_WARNED = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A survey whose given height is 40 m."""

    name: str
    height_m: float | None = None
    """True height [m]; None draws it from the prior."""
    drawn: bool = False
    """True: exponent, correlated fading and foreign pulses are drawn from the priors."""


CASES = (
    Case(name="survey, assumed 40 m, true 20 m", height_m=20.0),
    Case(name="survey, assumed 40 m, true 60 m", height_m=60.0),
    Case(name="survey, assumed 40 m, true 80 m", height_m=80.0),
    Case(name="survey, all drawn", drawn=True),
)


def flown(rng: Generator, case: Case) -> tuple[Position, bool]:
    """Position from a survey, and true if its 95 % circle contains the tag."""
    tag = (float(rng.uniform(0.0, _SIDE_M)), float(rng.uniform(0.0, _SIDE_M)))
    height_m = 40.0 + height_error_m(rng) if case.height_m is None else case.height_m
    usual = Propagation()
    exponent = usual.exponent
    if case.drawn:
        drawn = rng.normal(usual.exponent, usual.exponent_sigma)
        exponent = float(np.clip(drawn, _LEAST_EXPONENT, _MOST_EXPONENT))
    correlation = float(rng.choice(_LASTING)) if case.drawn else 0.0
    track = survey(
        rng,
        _SIDE_M,
        _SPACING_M,
        _FADING_DB,
        correlation,
        tag,
        height_m=height_m,
        exponent=exponent,
    )
    if case.drawn:
        foreign = rng.random(len(track.snr_db)) < LEVELS.outlier_share
        middle_db = float(np.median(track.snr_db))
        anything = middle_db + rng.uniform(-0.5, 0.5, len(foreign)) * _ANY_DB
        track = replace(track, snr_db=np.where(foreign, anything, track.snr_db))
    found = estimate_position(None, track)
    assert found.radius95_m is not None
    east, north = _PLANE.to_local(found.latitude_deg, found.longitude_deg)
    miss_m = float(np.hypot(east - tag[0], north - tag[1]))
    return found, miss_m <= found.radius95_m


def survey_errors(runs: int, seed: int) -> list[Row]:
    """L7: the 95 % circle contains the tag, or a caution names the reason why it may not."""
    results = []
    for case in CASES:
        rng = np.random.default_rng(seed)
        surveys = [flown(rng, case) for _ in range(runs)]
        held = [float(one) for _, one in surveys]
        least, most = (0.93, 0.97) if case.drawn else (None, None)
        results.append(
            measured("L7", case.name, "95 % circle holds", held, share, least=least, most=most)
        )
        missed = [position for position, one in surveys if not one]
        warned = [float(bool(one.cautions)) for one in missed] or [1.0]
        asked = not case.drawn and np.mean(held) < _HELD
        results.append(
            measured(
                "L7",
                case.name,
                "warned, of those missed",
                warned,
                share,
                least=_WARNED if asked else None,
            )
        )
    return results
