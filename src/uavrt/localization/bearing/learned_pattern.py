"""Learn the pattern of an antenna on its airframe from the turns of a flight.

The pattern tables are read from a maker's plot, and metal near the antenna changes the pattern.
Each turn near a tag samples the pattern at an unknown bearing and level. Several turns together
show how the pattern deviates from the table, as a smooth correction of six harmonics.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import UsageError
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.tuning import LEARNED_PATTERN
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TurnPulses:
    """Headings and powers of the pulses of one tag during one turn."""

    yaw_deg: _Floats
    """Direction of the boresight at each pulse, clockwise from true north [deg], shape (n,)."""
    matched_power: _Floats
    """Power of each pulse over the noise power, noise included, shape (n,); NaN for missed
    pulses."""


def learn_pattern(
    turns: Sequence[TurnPulses],
    antenna: AntennaPattern,
    *,
    threshold_db: float = LEVELS.threshold_db,
) -> AntennaPattern:
    """Correct an antenna's pattern by turns, whose bearings are estimated again in each
    iteration.

    A rotation of the whole pattern cannot be learnt, because it cannot be distinguished from
    the antenna's mounting. The correction is mirrored like the table. `turns`: at least three
    are needed for a useful result; they may be of different tags. `antenna`: the pattern to be
    corrected; its pattern across the elements is not changed. `threshold_db`: SNR above which a
    missed pulse would have been detected. Raises `UsageError` if there is no turn.
    """
    if not turns:
        raise UsageError("there are no turns to learn from", remedy="Turn in place near a tag")
    angles = np.linspace(0.0, 180.0, LEARNED_PATTERN.angles)
    table = antenna.gain_db(angles)
    correction: _Floats = np.zeros(LEARNED_PATTERN.harmonics)
    learnt = antenna
    for _ in range(LEARNED_PATTERN.rounds):
        normal = np.eye(LEARNED_PATTERN.harmonics) * (
            LEARNED_PATTERN.harmonics / (2.0 * LEARNED_PATTERN.prior_db**2)
        )
        right = np.zeros(LEARNED_PATTERN.harmonics)
        for turn in turns:
            rows, values = _equations(turn, learnt, correction, threshold_db)
            normal += rows.T @ rows
            right += rows.T @ values
        correction = np.asarray(np.linalg.solve(normal, right), np.float64)
        # A constant would be the level and no correction: the boresight stays at 0 dB.
        shape = _basis(angles) @ correction
        learnt = AntennaPattern(
            name=f"{antenna.name}, learnt",
            e_plane_db=tuple(float(x) for x in table + shape - shape[0]),
            h_plane_db=antenna.h_plane_db,
        )
    return learnt


def _basis(angle_deg: _Floats) -> _Floats:
    """Cosines of multiples of angles off boresight, shape (n, harmonics); they are symmetric
    about 0° and 180°.
    """
    order = np.arange(1, LEARNED_PATTERN.harmonics + 1)
    return np.asarray(np.cos(np.radians(angle_deg)[:, None] * order))


def _equations(
    turn: TurnPulses, pattern: AntennaPattern, correction: _Floats, threshold_db: float
) -> tuple[_Floats, _Floats]:
    """Return matrix and right side of the equations, weighted by their errors, that one turn
    gives for the pattern correction.
    """
    found = estimate_bearing(
        turn.yaw_deg,
        None,
        matched_power=turn.matched_power,
        antenna=pattern,
        threshold_db=threshold_db,
    )
    if not found.accepted:
        # Pulses in the noise contain no information about the pattern.
        return np.zeros((0, LEARNED_PATTERN.harmonics)), np.zeros(0)
    heard = ~np.isnan(turn.matched_power)
    off = found.bearing_deg - turn.yaw_deg[heard]
    fading = found.fading_db if found.fading_db is not None else LEARNED_PATTERN.prior_db
    s = 10.0 ** (((found.level_db or 0.0) + pattern.gain_db(off)) / 10.0)
    follow = s / (1.0 + s)
    measured = 10.0 * np.log10(np.maximum(turn.matched_power[heard], 0.1))
    residual = measured - 10.0 * np.log10(1.0 + s)
    sigma = np.sqrt(18.86 * (1.0 + 2.0 * s) / (1.0 + s) ** 2 + (fading * follow) ** 2)
    rows = _basis(off) * (follow / sigma)[:, None]
    # The residual is after the present correction; the equations are for the total one.
    values = np.clip(residual / sigma, -3.0, 3.0) + rows @ correction
    level = follow / sigma
    level = level / np.linalg.norm(level)
    return rows - np.outer(level, level @ rows), values - level * float(level @ values)
