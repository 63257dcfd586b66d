"""The rotation test with each possible cause switched on and off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavrt.core.messages import Pulse, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.simulation.scene.propagation import Wall
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import World
from uavrt_experiments.rotation.cart import (
    BEARING_DEG,
    Cart,
    building,
    heard,
    original_samples,
    with_poses,
)
from uavrt_experiments.rotation.original_pose import original_poses
from uavrt_experiments.rotation.reading import Reading, read_turn, wrapped

THESIS_SHIFT_DEG = 50.0
SHIFT_TOLERANCE_DEG = 15.0
ONE_WALL = building(bearing_deg=70.0, distance_m=25.0, reflection=-0.8)
AWAY_DEG = 100.0
"""Heading away from the tag at the original program's start that gives a shift of 50° [deg]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One combination of possible causes and its result."""

    name: str
    wall: bool
    original: bool
    first_off_deg: float | None
    """Heading away from the tag at the original program's start [deg]; None with our poses."""
    reading: Reading

    @property
    def shift_deg(self) -> float:
        """Angle of the strongest pulses from the tag's bearing [deg]."""
        return self.reading.shift_deg(BEARING_DEG)

    @property
    def like_figure_16(self) -> bool:
        """True if the yaw rises, falls and returns: a full turn logged within a half circle."""
        return self.reading.covered_deg < 200.0

    @property
    def like_figure_17(self) -> bool:
        """True if the pattern is shifted by about 50°."""
        return abs(abs(self.shift_deg) - THESIS_SHIFT_DEG) <= SHIFT_TOLERANCE_DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class WallSurvey:
    """Effect of reflections alone, as shares of random walls."""

    walls: int
    shifted: float
    """Share of walls that shift the strongest pulses by 35° to 65°, with true poses."""
    shifted_and_folded: float
    """Share of walls that also keep the yaw within a half circle."""
    shifted_original: float
    """Share of walls with such a shift, with the original's poses and its start
    facing the tag."""
    flagged: float
    """Share of shifts above 15° with true poses that our bearing marks as ambiguous, or gets
    right within 15°."""
    median_deg: float
    """Median size of the shift with true poses [deg]."""


def cases(sample_rate_hz: float, seed: int = 1) -> list[Case]:
    """Run the turn from samples, with and without the wall, and evaluate it with each kind of
    pose.
    """
    found = []
    for wall in (False, True):
        scenario = Cart(walls=(ONE_WALL,) if wall else (), seed=seed).scenario
        pulses = heard(scenario, sample_rate_hz)
        where = "wall" if wall else "open field"
        ours = with_poses(scenario, pulses)
        found.append(_case(f"{where}, interpolated poses", wall, None, ours))
        for away in (0.0, AWAY_DEG):
            samples = original_samples(scenario, BEARING_DEG + away)
            start = "at the tag" if away == 0.0 else f"{away:.0f}° off"
            name = f"{where}, original's poses, started {start}"
            found.append(_case(name, wall, away, original_poses(pulses, samples)))
    return found


def start_sweep(steps: Sequence[float], seed: int = 1) -> list[tuple[float, float]]:
    """Shift with the original's poses, over the heading away from the tag at the program's
    start.

    Pulses have their true times and levels, without a detector.
    """
    scenario = Cart(seed=seed).scenario
    pulses = true_pulses(scenario, np.random.default_rng(seed))
    found = []
    for away in steps:
        samples = original_samples(scenario, BEARING_DEG + away)
        reading = read_turn(original_poses(pulses, samples))
        found.append((away, reading.shift_deg(BEARING_DEG)))
    return found


def wall_survey(walls: int, seed: int = 1) -> WallSurvey:
    """Put random walls around the cart, 8 to 60 m away, reflecting 30 to 90 % of the field."""
    rng = np.random.default_rng(seed)
    shifts: list[float] = []
    halved: list[float] = []
    folded: list[bool] = []
    honest: list[bool] = []
    while len(shifts) < walls:
        wall = building(
            bearing_deg=float(rng.uniform(0.0, 360.0)),
            distance_m=float(rng.uniform(8.0, 60.0)),
            reflection=float(-rng.uniform(0.3, 0.9)),
        )
        scenario = Cart(walls=(wall,)).scenario
        if not _reflects(scenario, wall):
            continue
        pulses = true_pulses(scenario, rng)
        ours = read_turn(_true_poses(scenario, pulses))
        shift = ours.shift_deg(BEARING_DEG)
        shifts.append(abs(shift))
        folded.append(ours.covered_deg < 200.0)
        samples = original_samples(scenario, BEARING_DEG)
        original = read_turn(original_poses(pulses, samples))
        halved.append(abs(original.shift_deg(BEARING_DEG)))
        off = abs(wrapped(ours.bearing.bearing_deg - BEARING_DEG))
        if abs(shift) > SHIFT_TOLERANCE_DEG:
            honest.append(off <= SHIFT_TOLERANCE_DEG or ours.bearing.ambiguous)
    like = [_like(one) for one in shifts]
    both = [a and b for a, b in zip(like, folded, strict=True)]
    return WallSurvey(
        walls=walls,
        shifted=float(np.mean(like)),
        shifted_and_folded=float(np.mean(both)),
        shifted_original=float(np.mean([_like(one) for one in halved])),
        flagged=float(np.mean(honest)) if honest else 1.0,
        median_deg=float(np.median(shifts)),
    )


def polarization_table(
    mismatches_deg: Sequence[float], sample_rate_hz: float, seed: int = 1
) -> list[tuple[float, int, float | None, int, float | None]]:
    """Bearing errors from samples under polarization mismatch, open field and wall.

    Returns: each (mismatch, pulses, error, pulses with wall, error with wall), in degrees; an
    error is None if fewer than three pulses were received.
    """
    rows = []
    for mismatch in mismatches_deg:
        row: list[tuple[int, float | None]] = []
        for walls in ((), (ONE_WALL,)):
            scenario = Cart(walls=walls, mismatch_deg=mismatch, seed=seed).scenario
            found = with_poses(scenario, heard(scenario, sample_rate_hz))
            error = None
            if len(found) >= 3:
                bearing = read_turn(found).bearing.bearing_deg
                error = wrapped(bearing - BEARING_DEG)
            row.append((len(found), error))
        rows.append((mismatch, *row[0], *row[1]))
    return rows


def true_pulses(scenario: Scenario, rng: np.random.Generator) -> list[Pulse]:
    """Ideal pulses with their power measured in noise: |√(E/N₀) + noise|² - 1."""
    end_ns = scenario.start_time_ns + ns_from_s(scenario.duration_s)
    found = []
    for truth in World(scenario).truth(scenario.start_time_ns, end_ns):
        noise = complex(*rng.normal(0.0, np.sqrt(0.5), 2))
        power = abs(10.0 ** (truth.enr_db / 20.0) + noise) ** 2 - 1.0
        if power < 10.0:
            continue
        snr_db = float(10.0 * np.log10(power))
        found.append(
            Pulse(
                tag_id=truth.tag_id,
                frequency_hz=truth.frequency_hz,
                start_time_ns=truth.start_time_ns,
                end_time_ns=truth.end_time_ns,
                snr_db=snr_db,
                group_snr_db=snr_db,
                score=1.0,
                group_index=1,
                group_sequence=truth.pulse_index,
                noise_psd=1.0,
                detection_status="detected",
                confirmed=True,
                rate=1,
                predicted_next_start_ns=None,
                predicted_next_end_ns=None,
            )
        )
    return found


def _true_poses(scenario: Scenario, pulses: Sequence[Pulse]) -> list[PulsePose]:
    return [
        PulsePose(
            pulse=one, pose=scenario.antenna_pose((one.start_time_ns + one.end_time_ns) // 2)
        )
        for one in pulses
    ]


def _case(
    name: str, wall: bool, first_off_deg: float | None, found: Sequence[PulsePose]
) -> Case:
    return Case(
        name=name,
        wall=wall,
        original=first_off_deg is not None,
        first_off_deg=first_off_deg,
        reading=read_turn(found),
    )


def _like(shift_deg: float) -> bool:
    return abs(shift_deg - THESIS_SHIFT_DEG) <= SHIFT_TOLERANCE_DEG


def _reflects(scenario: Scenario, wall: Wall) -> bool:
    """True if the tag is also in front of the wall."""
    tag = scenario.tag[0]
    facing = np.radians(wall.facing_deg)
    before = (tag.north_m - wall.north_m) * np.cos(facing)
    return bool(before + (tag.east_m - wall.east_m) * np.sin(facing) > 0.0)
