"""What is believed of a tag: whether it is there, and whether its pulses are as they should."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.core.errors import ConfigError
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.level_belief import LEVEL_AT_100_M, Listening
from uavrt.localization.position.trackers import TagPrior
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.detectability.ground_propagation import GroundReflection
from uavrt.planning.stopping import AccuracyStop
from uavrt.simulation.scene.propagation import Propagation, ground_reflection

AREA = Area(west_m=0.0, east_m=500.0, south_m=0.0, north_m=500.0)
PRIOR = TagPrior(area=AREA, level_db=30.0, level_sigma_db=6.0, pattern=PATTERNS["RA-23K"])


def flown_past(
    belief: TagBelief, *, there: bool, level_db: float = 32.0, bias_db: float = 0.0, seed: int
) -> None:
    """A zigzag over the area with a pulse each second; the tag is at (300, 250)."""
    rng = np.random.default_rng(seed)
    for second in range(160):
        east, north = 40.0 + 2.6 * second, 250.0 + 200.0 * np.sin(second / 18.0)
        yaw = 90.0 + 60.0 * np.cos(second / 18.0)
        dx, dy = 300.0 - east, 250.0 - north
        slant = np.hypot(np.hypot(dx, dy), 40.0)
        off = np.degrees(np.arctan2(dx, dy)) - yaw
        level = level_db - 25.0 * np.log10(slant / 100.0)
        level += float(PATTERNS["RA-23K"].gain_db(off)) + rng.normal(0.0, 3.0)
        level += bias_db if second > 120 else 0.0
        heard = float(level) if there and level >= 10.0 else None
        listened(belief, second, (float(east), float(north)), heard, float(yaw))


def listened(
    belief: TagBelief,
    second: float,
    drone: tuple[float, float],
    level_db: float | None,
    yaw_deg: float = 0.0,
) -> None:
    belief.advance_to(float(second))
    east_m, north_m = drone
    belief.listen(
        Listening(
            east_m=east_m, north_m=north_m, height_m=40.0, snr_db=level_db, yaw_deg=yaw_deg
        )
    )


def test_a_tag_that_is_heard_exists_and_a_silent_one_hardly() -> None:
    chances = []
    for there in (True, False):
        belief = TagBelief(1, PRIOR, np.random.default_rng(1), particles=3000, existence=0.5)
        flown_past(belief, there=there, seed=2)
        chances.append(belief.existence_probability)
    assert chances[0] > 0.999
    assert chances[1] < 0.2


def test_false_pulses_that_barely_pass_the_threshold_make_no_tag() -> None:
    """Silence told that there is one (+ 10 nats), and so did each pulse at the threshold."""
    prior = replace(PRIOR, chance_share=0.02, motion=(0.0, 1.0, 0.0), walking_m_per_root_s=2.0)
    belief = TagBelief(1, prior, np.random.default_rng(1), particles=1000, existence=0.5)
    for second in range(500):
        place = 250.0 + 200.0 * np.sin(second / 40.0), 250.0 + 200.0 * np.cos(second / 23.0)
        heard = 10.0 if second % 150 == 100 else None
        listened(belief, second, place, heard, float(3 * second % 360))
    assert belief.existence_probability < 0.3


def test_the_stop_rule_wants_the_circle_and_the_existence_and_the_model() -> None:
    belief = TagBelief(1, PRIOR, np.random.default_rng(3), particles=4000)
    stop = AccuracyStop(radius95_m=40.0)
    assert not stop.verdict(belief).found
    flown_past(belief, there=True, seed=4)
    found = stop.verdict(belief)
    assert found.found, found.reason
    place = belief.estimate()
    assert np.hypot(place.east_m - 300.0, place.north_m - 250.0) < 40.0
    assert not AccuracyStop(radius95_m=40.0, bayes_factor=float("inf")).verdict(belief).found


def test_pulses_that_do_not_fit_the_place_fail_the_check() -> None:
    belief = TagBelief(1, PRIOR, np.random.default_rng(5), particles=4000)
    flown_past(belief, there=True, bias_db=20.0, seed=6)
    check = belief.model_check()
    assert not check.passed, str(check)


def test_a_sum_of_two_rays_is_as_the_simulated_world_has_it() -> None:
    """One table for ten thousand places, and the simulator's own Fresnel coefficient."""
    gain = GroundReflection(tag_height_m=1.0)
    for flat, height in ((30.0, 29.0), (200.0, 29.0), (900.0, 59.0)):
        straight = np.hypot(flat, height)
        mirrored = np.hypot(flat, height + 2.0)
        ray = ground_reflection(
            Propagation(), float(np.arctan2(height + 2.0, flat)), 150e6, horizontal=True
        )
        phase = 2.0 * np.pi * 150e6 / 299_792_458.0 * (mirrored - straight)
        expected = 20.0 * np.log10(abs(1.0 + ray * np.exp(-1j * phase)))
        got = gain(np.array([flat * 0.6]), np.array([flat * 0.8]), height)
        assert float(got[0]) == pytest.approx(float(expected), abs=0.15)


def test_tags_without_a_number_of_their_own_are_refused() -> None:
    one = TagBelief(1, PRIOR, np.random.default_rng(1), particles=100)
    with pytest.raises(ConfigError, match="tags"):
        Beliefs()
    with pytest.raises(ConfigError, match="tags"):
        Beliefs(one, one)
    with pytest.raises(ConfigError, match="probability"):
        TagBelief(1, PRIOR, np.random.default_rng(1), particles=100, existence=1.0)


def test_hearing_the_strongest_pulses_alone_is_no_fault_of_the_model() -> None:
    known = TagPrior(
        area=Area(west_m=0.0, east_m=20.0, south_m=990.0, north_m=1010.0),
        level_db=33.0,
        level_sigma_db=0.0,
        exponent=2.5,
        exponent_sigma=0.0,
        fading_db=4.0,
        motion=(1.0, 0.0, 0.0),
    )
    belief = TagBelief(1, known, np.random.default_rng(1), particles=300)
    levels = 33.0 - 25.0 + np.random.default_rng(2).normal(0.0, 4.0, 120)
    for second, level in enumerate(levels):
        listened(belief, second, (10.0, 0.0), float(level) if level >= 10.0 else None)
    check = belief.model_check()
    assert check.pulses > 10.0
    assert check.passed, str(check)


def test_a_strength_that_wanders_is_never_known_better_than_it_wanders() -> None:
    area = Area(west_m=90.0, east_m=110.0, south_m=0.0, north_m=10.0)
    sigmas = []
    for drift in (0.0, 0.5):
        prior = TagPrior(
            area=area,
            level_db=30.0,
            level_sigma_db=6.0,
            level_drift_db_per_root_s=drift,
            shadowing_db=0.0,
            reflects=False,
            motion=(1.0, 0.0, 0.0),
        )
        belief = TagBelief(1, prior, np.random.default_rng(5), particles=200)
        for second in range(200):
            listened(belief, second, (0.0, 0.0), 31.0)
        sigmas.append(
            float(np.sqrt(belief.hypotheses(50).level.variance(LEVEL_AT_100_M).mean()))
        )
    assert sigmas[0] < 0.4
    assert 0.8 < sigmas[1] < 3.0


def test_a_tag_that_is_never_missed_has_no_rival() -> None:
    """Of another nothing is heard but when the tag is missed: a search ended in a division."""
    prior = replace(PRIOR, missed_share=0.0)
    belief = TagBelief(1, prior, np.random.default_rng(1), particles=1000, existence=0.5)
    flown_past(belief, there=True, seed=2)
    assert belief.existence_probability > 0.999
