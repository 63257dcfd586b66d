"""Compare a resting tag with one of constant velocity, by any likelihood of positions.

A tag moving past a drone is equivalent to the drone moving past a tag. The likelihood of a
resting tag therefore applies, with each position of the drone shifted back by the tag's
movement. The evidence of rest and walk is summed over grids of positions and velocities.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import wrap_degrees_360
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.tuning import COMMON, WALK, Narrowing
from uavrt.localization.results import Caution

_Floats = NDArray[np.float64]
Velocity = tuple[float, float]
"""Velocity of a tag towards east and north [m/s]."""
Likelihood = Callable[[Velocity, _Floats, _Floats], _Floats]
"""Log-likelihoods of positions east and north [m] at one time, given a tag's velocity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """Walking tag, as estimated from the pulses of a flight."""

    probability: float
    velocity_m_s: Velocity
    place: tuple[float, float]
    """East and north of the tag at `place_s` [m]."""
    place_s: float
    """Mean time of the tag's pulses, weighted by their strength [s]."""
    velocities: tuple[Velocity, ...]
    """Velocities, evenly spaced, among which the tag's true one probably is."""

    def at(self, time_s: float) -> tuple[float, float]:
        """East and north of the tag at a time [m]."""
        since_s = time_s - self.place_s
        return (
            self.place[0] + self.velocity_m_s[0] * since_s,
            self.place[1] + self.velocity_m_s[1] * since_s,
        )

    @property
    def walked(self) -> bool:
        """True if a walk is more probable than rest."""
        return self.probability > 0.5

    @property
    def caution(self) -> Caution:
        """Caution for the operator that the tag walked."""
        speed, towards = speed_and_direction(self.velocity_m_s)
        text = (
            f"the tag seems to have walked at {speed:.1f} m/s towards {towards:.0f}°; "
            "the position is that at the last pulse"
        )
        return Caution(name="walk", text=text)


def speed_and_direction(velocity_m_s: Velocity) -> tuple[float, float]:
    """Speed of a tag [m/s], and the direction in which it walked [deg]."""
    towards = float(wrap_degrees_360(np.degrees(np.arctan2(*velocity_m_s))))
    return float(np.hypot(*velocity_m_s)), towards


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Largest likelihood among positions and velocities of a tag, and their evidence."""

    score: float
    velocity: Velocity
    place: tuple[float, float]
    log_evidence: float


def walk_of(
    likelihood: Likelihood,
    rest: Peak,
    walk: Peak,
    place_s: float,
    steps: tuple[float, float],
    grids: Narrowing,
) -> tuple[Walk, Peak]:
    """Probability that a tag walked, by integrals around both peaks; and the better peak.

    `steps`: distance [m] and speed [m/s] between the points of the grids that gave the peaks.
    """
    rest, _ = _integrated(likelihood, rest, (steps[0], 0.0), grids)
    walk, velocities = _integrated(likelihood, walk, steps, grids)
    odds = np.log(COMMON.walking_share / (1.0 - COMMON.walking_share))
    odds += walk.log_evidence - rest.log_evidence
    found = Walk(
        probability=float(1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0)))),
        velocity_m_s=walk.velocity,
        place=walk.place,
        place_s=place_s,
        velocities=velocities,
    )
    return found, walk if odds > 0.0 else rest


def _integrated(
    likelihood: Likelihood, peak: Peak, steps: tuple[float, float], grids: Narrowing
) -> tuple[Peak, tuple[Velocity, ...]]:
    """Evidence integrated around a likelihood peak, on grids that narrow to its width.

    Returns also the velocities of the last grid that have a part in the evidence.
    """
    step_m, step_m_s = (0.5 * one for one in steps)
    for _ in range(grids.rounds):
        half = 0.5 * (grids.cells - 1) * step_m
        around = Area(
            west_m=peak.place[0] - half,
            east_m=peak.place[0] + half,
            south_m=peak.place[1] - half,
            north_m=peak.place[1] + half,
        )
        off = (np.arange(grids.velocities) - grids.velocities // 2) * step_m_s
        if not step_m_s:
            off = np.zeros(1)
        velocities = [
            (float(peak.velocity[0] + x), float(peak.velocity[1] + y)) for x in off for y in off
        ]
        grid = _Grid.of(likelihood, velocities, around, grids.cells)
        before, peak = peak, grid.peak(step_m_s)
        by_place = np.logaddexp.reduce(grid.log_likelihood, axis=0)
        by_velocity = np.logaddexp.reduce(grid.log_likelihood, axis=1)
        wide = _falls(by_place.reshape(grids.cells, -1), grids.resolved_nats)
        fast = _falls(by_velocity.reshape(len(off), -1), grids.resolved_nats)
        if not wide and not fast and peak.velocity == before.velocity:
            break
        step_m *= 0.5 if wide else 1.0
        step_m_s *= 0.5 if fast else 1.0
    kept = by_velocity >= by_velocity.max() + np.log(WALK.least_part)
    return peak, tuple(one for one, good in zip(velocities, kept, strict=True) if good)


def _falls(logs: _Floats, nats: float) -> bool:
    """True if the peak of a square grid is inside, and its neighbours are lower by `nats`."""
    row, column = np.unravel_index(int(np.argmax(logs)), logs.shape)
    inside = logs[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2]
    if nats <= 0.0:
        return True
    if inside.shape != (3, 3):
        return False
    falls = inside[1, 1] - inside[[0, 2, 1, 1], [1, 1, 0, 2]]
    return bool(falls.mean() > nats)


def best_of(
    likelihood: Likelihood, velocities: list[Velocity], around: Area, cells: int
) -> Peak:
    """Largest likelihood on a grid of positions, at some velocities, and the evidence."""
    return _Grid.of(likelihood, velocities, around, cells).peak()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Grid:
    """Likelihood of positions and velocities, times the prior of the velocities."""

    velocities: list[Velocity]
    east_m: _Floats
    north_m: _Floats
    cell_m2: float
    log_likelihood: _Floats
    """(velocities, positions) log-likelihood and prior of a tag."""

    @classmethod
    def of(
        cls, likelihood: Likelihood, velocities: list[Velocity], around: Area, cells: int
    ) -> "_Grid":
        east = np.linspace(around.west_m, around.east_m, cells)
        north = np.linspace(around.south_m, around.north_m, cells)
        y, x = (one.ravel() for one in np.meshgrid(north, east, indexing="ij"))
        found = np.stack([likelihood(one, x, y) for one in velocities])
        squares = np.sum(np.array(velocities) ** 2, axis=1)
        if np.any(squares > 0.0):
            found = found - (0.5 * squares / COMMON.walking_m_s**2)[:, None]
        return cls(
            velocities=velocities,
            east_m=x,
            north_m=y,
            cell_m2=float((east[1] - east[0]) * (north[1] - north[0])),
            log_likelihood=found,
        )

    def peak(self, step_m_s: float = 0.0) -> Peak:
        """Largest value and sum; `step_m_s`: between velocities, 0 for a tag at rest."""
        found = self.log_likelihood
        row, column = np.unravel_index(int(np.argmax(found)), found.shape)
        whole = float(np.logaddexp.reduce(found.ravel())) + np.log(self.cell_m2)
        if step_m_s:
            whole += np.log(step_m_s**2 / (2.0 * np.pi * COMMON.walking_m_s**2))
        return Peak(
            score=float(found[row, column]),
            velocity=self.velocities[int(row)],
            place=(float(self.east_m[column]), float(self.north_m[column])),
            log_evidence=whole,
        )
