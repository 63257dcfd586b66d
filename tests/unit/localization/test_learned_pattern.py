"""An antenna changed by its airframe is learnt from turns past a tag."""

import numpy as np
import pytest

from uavrt.core.errors import UsageError
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS, AntennaPattern
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.learned_pattern import TurnPulses, learn_pattern
from uavrt_experiments.localization.bearing_bars import disturbed
from uavrt_experiments.localization.rotations import matched_power


def test_five_turns_bring_a_pattern_nearer_to_the_true_one() -> None:
    rng = np.random.default_rng(51)
    angles = np.arange(0.0, 181.0, 5.0)
    table = PATTERNS["RA-23K"]
    before: list[float] = []
    after: list[float] = []
    for _ in range(2):
        true = disturbed(rng, table, 2.0)
        turns = []
        for bearing in rng.uniform(0, 360, 5):
            yaw = rng.uniform(0, 360) + np.arange(0.0, 360.0, 6.0)
            level = 26.0 + true.gain_db(bearing - yaw) + rng.normal(0, 1.5, len(yaw))
            turns.append(TurnPulses(yaw_deg=yaw, matched_power=matched_power(rng, level)))
        learnt = learn_pattern(turns, table)
        for pattern, errors in ((table, before), (learnt, after)):
            # Where the antenna hears: gains but not levels, which no turn knows.
            error = (pattern.gain_db(angles) - true.gain_db(angles))[true.gain_db(angles) > -20]
            errors.append(float(np.std(error)))
    assert np.mean(after) < 0.6 * np.mean(before)


def test_turns_with_the_table_as_it_is_leave_it_as_it_is() -> None:
    rng = np.random.default_rng(52)
    table = PATTERNS["RA-2A"]
    yaw = np.arange(0.0, 360.0, 6.0)
    turns = [
        TurnPulses(
            yaw_deg=yaw,
            matched_power=matched_power(
                rng, 30.0 + table.gain_db(bearing - yaw) + rng.normal(0, 1.0, 60)
            ),
        )
        for bearing in (10.0, 130.0, 250.0)
    ]
    learnt = learn_pattern(turns, table)
    angles = np.arange(0.0, 80.0, 5.0)
    assert np.max(np.abs(learnt.gain_db(angles) - table.gain_db(angles))) < 1.0
    assert learnt.gain_db(0.0) == pytest.approx(0.0)
    with pytest.raises(UsageError, match="turns"):
        learn_pattern([], table)


def test_an_antenna_with_a_weaker_back_than_its_table_is_no_reflection() -> None:
    """A back 7 dB below the table: every turn was flagged, with arcs of half a circle."""
    rng = np.random.default_rng(53)
    table = PATTERNS["RA-23K"]
    angle = np.linspace(0.0, 180.0, len(table.e_plane_db))
    lower = np.array(table.e_plane_db) - 7.0 / (1.0 + np.exp(-(angle - 100.0) / 12.0))
    real = AntennaPattern(name="real", e_plane_db=tuple(float(x) for x in lower))
    truths, turns = rng.uniform(0.0, 360.0, 6), []
    for truth in truths:
        yaw = rng.uniform(0.0, 360.0) + np.arange(0.0, 360.0, 8.0)
        level = 25.0 + real.gain_db(truth - yaw) + rng.normal(0, 1.2, len(yaw))
        turns.append(TurnPulses(yaw_deg=yaw, matched_power=matched_power(rng, level)))
    learnt = learn_pattern(turns, table)
    for truth, turn in zip(truths, turns, strict=True):
        found = estimate_bearing(
            turn.yaw_deg, None, matched_power=turn.matched_power, antenna=learnt
        )
        assert found.interval90_deg is not None
        low, high = found.interval90_deg
        assert not found.ambiguous
        assert (high - low) % 360.0 <= 6.0
        assert abs(difference_deg(found.bearing_deg, float(truth))) <= 5.0


def test_turns_of_noise_alone_teach_nothing() -> None:
    rng = np.random.default_rng(54)
    yaw = np.arange(0.0, 360.0, 6.0)
    turns = [TurnPulses(yaw_deg=yaw, matched_power=rng.exponential(size=60)) for _ in range(4)]
    learnt = learn_pattern(turns, PATTERNS["RA-23K"])
    assert learnt.e_plane_db[0] == 0.0
    assert np.allclose(learnt.gain_db(yaw), PATTERNS["RA-23K"].gain_db(yaw), atol=0.3)
