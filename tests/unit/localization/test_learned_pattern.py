"""An antenna changed by its airframe is learnt from turns past a tag."""

import numpy as np
import pytest

from uavrt.errors import UsageError
from uavrt.experiments.localization.bearing_bars import disturbed
from uavrt.experiments.localization.rotations import matched_power
from uavrt.localization import PATTERNS, TurnPulses, learn_pattern


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
