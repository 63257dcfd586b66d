"""Tags of one area tell each other how levels fall with distance there."""

from dataclasses import replace

import numpy as np
import pytest

from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import TagPrior
from uavrt.planning.beliefs import TagBelief
from uavrt.planning.common_fall import ExponentSharing

AREA = Area(west_m=0.0, east_m=600.0, south_m=0.0, north_m=600.0)
PRIOR = TagPrior(
    area=AREA,
    level_db=30.0,
    level_sigma_db=6.0,
    exponent=3.0,
    exponent_sigma=0.6,
    motion=(1.0, 0.0, 0.0),
)


def belief_of(tag_id: int, *, exponent_sigma: float = 0.6) -> TagBelief:
    prior = replace(PRIOR, exponent_sigma=exponent_sigma)
    return TagBelief(tag_id, prior, np.random.default_rng(tag_id), particles=4000)


def fly_round(belief: TagBelief, *, seconds: int = 200, seed: int = 5) -> None:
    """Rings of 30 to 260 m about a tag at (300, 300) whose levels fall with 2.2."""
    rng = np.random.default_rng(seed)
    for second in range(seconds):
        angle, ring = second / 9.0, 30.0 + 230.0 * second / seconds
        east, north = 300.0 + ring * np.sin(angle), 300.0 + ring * np.cos(angle)
        slant = np.hypot(ring, 40.0)
        level = 33.0 - 22.0 * np.log10(slant / 100.0) + 20.0 * np.log10(ring / slant)
        belief.advance_to(float(second))
        belief.listen(
            Listening(
                east_m=float(east),
                north_m=float(north),
                height_m=40.0,
                snr_db=float(level + rng.normal(0.0, 3.0)),
                threshold_db=-100.0,
            )
        )


def test_a_tag_flown_round_tells_another_the_exponent_of_the_area() -> None:
    known, unknown = belief_of(1), belief_of(2)
    fly_round(known)
    mean, variance = known.tracker.exponent()
    assert mean == pytest.approx(2.2, abs=0.25)
    before = unknown.tracker.exponent()
    ExponentSharing().share([known, unknown])
    after = unknown.tracker.exponent()
    assert abs(after[0] - mean) < 0.3 * abs(before[0] - mean)
    assert variance < after[1] < 0.25 * before[1]


def test_what_a_tag_was_told_is_never_told_back_to_it() -> None:
    known, unknown = belief_of(1), belief_of(2)
    fly_round(known)
    fall = ExponentSharing()
    fall.share([known, unknown])
    own, told = known.tracker.exponent(), unknown.tracker.exponent()
    for _ in range(50):
        fall.share([known, unknown])
    assert known.tracker.exponent() == own
    assert unknown.tracker.exponent() == told


def test_a_tag_of_which_nobody_knows_where_it_is_tells_nothing() -> None:
    one, other = belief_of(1), belief_of(2)
    fly_round(one, seconds=6)
    before = other.tracker.exponent()
    ExponentSharing().share([one, other])
    assert other.tracker.exponent() == before


def test_hypotheses_that_start_over_keep_what_others_told() -> None:
    known, unknown = belief_of(1), belief_of(2)
    fly_round(known)
    ExponentSharing().share([known, unknown])
    told = unknown.tracker.exponent()
    unknown.tracker.replace_at_random(1.0)
    again = unknown.tracker.exponent()
    assert again[0] == pytest.approx(told[0], abs=0.1)
    assert again[1] == pytest.approx(told[1], rel=0.4)


def test_an_exponent_that_is_given_learns_from_nobody() -> None:
    known, given = belief_of(1), belief_of(2, exponent_sigma=0.0)
    fly_round(known)
    ExponentSharing().share([known, given])
    mean, variance = given.tracker.exponent()
    assert mean == pytest.approx(3.0, abs=1e-5)
    assert variance < 1e-10
