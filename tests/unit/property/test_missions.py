"""Whatever the area, the wind and the battery: within the fence, and home with the reserve.

Random searches in virtual time. ``UAVRT_MISSIONS=500`` flies as many as the promise names.
"""

import os

import pytest
from missions import FENCE_M, HIGHEST_M, KEEP_M, LOWEST_M, RESERVE_PERCENT, Mission, flown

MISSIONS = int(os.environ.get("UAVRT_MISSIONS", "5"))
HEIGHT_ERROR_M = 1.0
"""Gusts."""


@pytest.fixture(scope="module")
def missions() -> list[Mission]:
    flights = [flown(seed) for seed in range(MISSIONS)]
    assert flights
    return flights


@pytest.mark.timeout(7200)
def test_no_search_leaves_the_fence_or_the_heights(missions: list[Mission]) -> None:
    assert max(one.farthest_m for one in missions) <= FENCE_M
    assert min(one.lowest_m for one in missions) >= LOWEST_M - HEIGHT_ERROR_M
    assert max(one.highest_m for one in missions) <= HIGHEST_M + HEIGHT_ERROR_M


@pytest.mark.timeout(7200)
def test_every_search_ends_at_home_with_the_reserve(missions: list[Mission]) -> None:
    for one in missions:
        assert one.why == "returning: the autopilot flies home", one
        assert one.home_percent is not None, one
        assert one.home_percent >= RESERVE_PERCENT, one


@pytest.mark.timeout(7200)
def test_animals_are_kept_away_from(missions: list[Mission]) -> None:
    """Those that are known of: one that nobody has heard yet may walk beneath the drone."""
    near = [one for one in missions if one.nearest_m < KEEP_M]
    assert len(near) <= max(1, 0.01 * len(missions)), near


@pytest.mark.timeout(7200)
def test_people_and_buildings_are_not_flown_over(missions: list[Mission]) -> None:
    """Neither in the search nor on the way home."""
    over = [one for one in missions if one.void_m <= 0.0]
    assert len(over) <= 0.01 * len(missions), over
    assert sum(one.void_m < float("inf") for one in missions) > 0.5 * len(missions)


@pytest.mark.timeout(7200)
def test_most_animals_are_found(missions: list[Mission]) -> None:
    found, sought = sum(one.found for one in missions), sum(one.sought for one in missions)
    assert found >= 0.8 * sought
