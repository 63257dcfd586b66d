"""Compare a resting tag with a tag of constant velocity, in a survey by signal power.

A coarse grid of positions and velocities is examined with some of the pulses. If it favours a
walk, `walks` compares both on finer grids with all pulses.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.censored_power import lasting_correlation
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerEvidence, PowerTrack
from uavrt.localization.position.tuning import WALK
from uavrt.localization.position.walks import Peak, Velocity, Walk, best_of, walk_of

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyWalk(Walk):
    """Walking tag, as estimated from the powers of a survey."""

    fading_db: float
    """Standard deviation of the pulses' fading [dB], increased if neighbouring pulses are
    correlated."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Moved:
    """Received pulses of a survey in coordinates that move with a walking tag."""

    east_m: _Floats
    north_m: _Floats
    since_s: _Floats
    """Times of the pulses relative to `place_s` [s], shape (n,)."""
    place_s: float
    """Time at which positions of resting and walking tags are compared [s]."""
    track: PowerTrack
    propagation: Propagation

    def every(self, step: int) -> "_Moved":
        return self.of(np.arange(len(self.since_s)) % step == 0)

    def of(self, kept: NDArray[np.bool_]) -> "_Moved":
        return replace(chosen_rows(self, kept), track=self.track.chosen(kept))

    def likelihood(self, velocity: Velocity, east_m: _Floats, north_m: _Floats) -> _Floats:
        return self.evidence(velocity).fit(east_m, north_m).log_likelihood

    def evidence(self, velocity: Velocity) -> PowerEvidence:
        return PowerEvidence(
            self.east_m - velocity[0] * self.since_s,
            self.north_m - velocity[1] * self.since_s,
            self.track,
            self.propagation,
        )


def survey_walk(
    east_m: _Floats,
    north_m: _Floats,
    powers: PowerTrack,
    around: Area,
    propagation: Propagation,
) -> SurveyWalk | None:
    """Compare a walking tag with a resting tag by the powers of a survey; None if nothing
    indicates a walk.
    """
    if powers.time_s is None:
        return None
    heard = ~np.isnan(powers.snr_db)
    if heard.sum() < WALK.least_pulses or np.ptp(powers.time_s[heard]) < WALK.least_span_s:
        return None
    # When its pulses are strongest, a walker is close to the lines, wherever it is later.
    strength = np.where(heard, 10.0 ** (np.nan_to_num(powers.snr_db, nan=-99.0) / 10.0), 0.0)
    place_s = float(powers.time_s @ strength / strength.sum())
    moved = _Moved(
        east_m=east_m,
        north_m=north_m,
        since_s=powers.time_s - place_s,
        place_s=place_s,
        track=powers,
        propagation=propagation,
    ).of(heard)
    rough = moved.every(max(1, int(heard.sum()) // WALK.rough_pulses))
    rest = best_of(rough.likelihood, [(0.0, 0.0)], around, WALK.rough_cells)
    angles = np.arange(WALK.directions) * 2.0 * np.pi / WALK.directions
    rim = [
        (v * float(np.cos(a)), v * float(np.sin(a))) for v in WALK.speeds_m_s for a in angles
    ]
    walk = best_of(rough.likelihood, rim, around, WALK.rough_cells)
    if walk.score < rest.score + WALK.gate_nats:
        return None
    extent_m = max(around.east_m - around.west_m, around.north_m - around.south_m)
    steps = extent_m / WALK.rough_cells, WALK.rough_step_m_s
    found, best = walk_of(moved.likelihood, rest, walk, place_s, steps, WALK.fine)
    own = {name: getattr(found, name) for name in Walk.__dataclass_fields__}
    return SurveyWalk(**own, fading_db=_fading_db(moved, best))


def _fading_db(moved: _Moved, peak: Peak) -> float:
    """Standard deviation of fading [dB], from the scatter about the fit and its correlation."""
    evidence = moved.evidence(peak.velocity)
    east, north = np.array([peak.place[0]]), np.array([peak.place[1]])
    fit = evidence.fit(east, north)
    loss, gain = evidence.propagation(east, north, np.arange(len(moved.since_s)))
    off = moved.track.snr_db - gain[0] - fit.level_db[0] - fit.exponent[0] * loss[0]
    rho = lasting_correlation(off)
    return float(np.sqrt(np.mean(off**2) * (1.0 + rho) / (1.0 - rho)))
