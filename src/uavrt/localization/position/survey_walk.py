"""Compare a resting tag with a tag of constant velocity, in a survey by signal power.

A tag that moves past a drone is equivalent to a drone that moves past a tag. So the same
likelihood applies after each position of the drone has been shifted back by the tag's movement.
The evidence of both explanations is summed over a coarse grid of positions and velocities, with
some of the pulses. If it favours walking, a finer grid follows.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.columns import chosen_rows
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.censored_power import lasting_correlation
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerEvidence, PowerTrack
from uavrt.localization.position.tuning import COMMON, WALK
from uavrt.localization.results import Caution

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyWalk:
    """Velocity and position of a walking tag, as estimated from the powers of a survey."""

    probability: float
    velocity_m_s: tuple[float, float]
    """Velocity of the tag towards east and north [m/s]."""
    place: tuple[float, float]
    """East and north of the tag at `place_s` [m]."""
    place_s: float
    """Time at which the tag's pulses were strongest [s]."""
    fading_db: float
    """Standard deviation of the pulses' fading [dB], increased if neighbouring pulses are
    correlated."""

    def at(self, time_s: float) -> tuple[float, float]:
        """East and north of the tag at a time [m]."""
        since_s = time_s - self.place_s
        return (
            self.place[0] + self.velocity_m_s[0] * since_s,
            self.place[1] + self.velocity_m_s[1] * since_s,
        )

    @property
    def caution(self) -> Caution:
        """Caution for the operator that the tag walked."""
        speed = float(np.hypot(*self.velocity_m_s))
        towards = float(wrap_degrees_360(np.degrees(np.arctan2(*self.velocity_m_s))))
        return Caution(
            name="walk",
            text=f"the tag seems to have walked at {speed:.1f} m/s towards {towards:.0f}°; "
            "the position is that at the last pulse",
        )


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

    def evidence(self, velocity: tuple[float, float]) -> PowerEvidence:
        return PowerEvidence(
            self.east_m - velocity[0] * self.since_s,
            self.north_m - velocity[1] * self.since_s,
            self.track,
            self.propagation,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Peak:
    score: float
    velocity: tuple[float, float]
    place: tuple[float, float]
    log_evidence: float


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
    rest = _best(rough, [(0.0, 0.0)], around, WALK.rough_cells)
    angles = np.arange(WALK.directions) * 2.0 * np.pi / WALK.directions
    rim = [
        (v * float(np.cos(a)), v * float(np.sin(a))) for v in WALK.speeds_m_s for a in angles
    ]
    walk = _best(rough, rim, around, WALK.rough_cells)
    if walk.score < rest.score + WALK.gate_nats:
        return None
    return _weighed(moved, around, rest, walk)


def _weighed(moved: _Moved, around: Area, rest: _Peak, walk: _Peak) -> SurveyWalk:
    """Compute the probability that the tag walked, by integrals around both likelihood peaks on
    finer grids.
    """
    step = (
        max(around.east_m - around.west_m, around.north_m - around.south_m) / WALK.rough_cells
    )
    rest = _integrated_peak(moved, rest, step, 0.0)
    walk = _integrated_peak(moved, walk, step, 0.3)
    odds = np.log(COMMON.walking_share / (1.0 - COMMON.walking_share))
    odds += walk.log_evidence - rest.log_evidence
    best = walk if odds > 0.0 else rest
    return SurveyWalk(
        probability=float(1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))),
        velocity_m_s=walk.velocity,
        place=walk.place,
        place_s=moved.place_s,
        fading_db=_fading_db(moved, best),
    )


def _integrated_peak(moved: _Moved, peak: _Peak, step_m: float, step_m_s: float) -> _Peak:
    """Return the evidence around a peak of the likelihood, integrated on grids that narrow to
    the peak's width.
    """
    for _ in range(WALK.rounds):
        half = (0.5 * WALK.fine_cells - 0.5) * step_m / 2.0
        around = Area(
            west_m=peak.place[0] - half,
            east_m=peak.place[0] + half,
            south_m=peak.place[1] - half,
            north_m=peak.place[1] + half,
        )
        steps = np.arange(WALK.fine_velocities) - WALK.fine_velocities // 2
        off = steps * (step_m_s / 2.0) if step_m_s else np.zeros(1)
        velocities = [
            (float(peak.velocity[0] + x), float(peak.velocity[1] + y)) for x in off for y in off
        ]
        peak = _best(moved, velocities, around, WALK.fine_cells, step_m_s / 2.0)
        step_m, step_m_s = step_m / 2.0, step_m_s / 2.0
    return peak


def _best(
    moved: _Moved,
    velocities: list[tuple[float, float]],
    around: Area,
    cells: int,
    step_m_s: float = 0.0,
) -> _Peak:
    east = np.linspace(around.west_m, around.east_m, cells)
    north = np.linspace(around.south_m, around.north_m, cells)
    y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
    cell_m2 = float((east[1] - east[0]) * (north[1] - north[0]))
    found = np.stack([moved.evidence(one).fit(x, y).log_likelihood for one in velocities])
    squares = np.sum(np.array(velocities) ** 2, axis=1)
    walks = bool(np.any(squares > 0.0))
    if walks:
        found = found - (0.5 * squares / COMMON.walking_m_s**2)[:, None]
    row, column = np.unravel_index(int(np.argmax(found)), found.shape)
    whole = float(np.logaddexp.reduce(found.ravel())) + np.log(cell_m2)
    if walks and step_m_s:
        whole += np.log(step_m_s**2 / (2.0 * np.pi * COMMON.walking_m_s**2))
    return _Peak(
        score=float(found[row, column]),
        velocity=velocities[int(row)],
        place=(float(x[column]), float(y[column])),
        log_evidence=whole,
    )


def _fading_db(moved: _Moved, peak: _Peak) -> float:
    """Standard deviation of fading [dB], computed from the scatter about the fit and its
    correlation.
    """
    evidence = moved.evidence(peak.velocity)
    east, north = np.array([peak.place[0]]), np.array([peak.place[1]])
    fit = evidence.fit(east, north)
    loss, gain = evidence.propagation(east, north, np.arange(len(moved.since_s)))
    off = moved.track.snr_db - gain[0] - fit.level_db[0] - fit.exponent[0] * loss[0]
    rho = lasting_correlation(off)
    return float(np.sqrt(np.mean(off**2) * (1.0 + rho) / (1.0 - rho)))
