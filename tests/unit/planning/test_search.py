"""Searches from the first pulse to the way home, with every planner."""

from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from uavrt.core.errors import PlanError, UsageError
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import TagPrior
from uavrt.planning.area import Circle, Polygon, SearchArea
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.drone_model.drone_motion import (
    FixedWing,
    Multirotor,
    Vehicle,
    VehicleState,
    Wind,
    flown,
)
from uavrt.planning.drone_model.energy import Battery, EnergyModel
from uavrt.planning.drone_model.planner_actions import FlyTo, Hold, Return, Rotate
from uavrt.planning.information import Listener, information_nats, minus_quarter_squares
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.planners.registry import PLANNERS, planner_named
from uavrt.planning.planners.ways import headings, sampled
from uavrt.planning.search import Search
from uavrt.planning.situation import Decision, SearchSettings
from uavrt.planning.stopping import AccuracyStop
from uavrt_experiments.search.baselines.names import BASELINES, any_planner

SIDE_M = 400.0
PRIOR = TagPrior(
    area=Area(west_m=0.0, east_m=SIDE_M, south_m=0.0, north_m=SIDE_M),
    level_db=30.0,
    level_sigma_db=5.0,
    fading_db=3.0,
    pattern=PATTERNS["RA-23K"],
)
TAGS = {1: (300.0, 120.0), 2: (120.0, 310.0)}
AREA = SearchArea(search=Polygon.rectangle(0.0, SIDE_M, 0.0, SIDE_M))
START = VehicleState(time_s=0.0, east_m=20.0, north_m=20.0, height_m=40.0)


def search_with(
    planner: str,
    *,
    vehicle: Vehicle | None = None,
    area: SearchArea = AREA,
    keep_away: KeepAway | None = None,
    energy: EnergyModel | None = None,
    prior: TagPrior = PRIOR,
    particles: int = 1500,
) -> Search:
    beliefs = Beliefs(
        *(TagBelief(n, prior, np.random.default_rng((7, n)), particles=particles) for n in TAGS)
    )
    settings = SearchSettings(
        vehicle=vehicle or Multirotor(speed_m_s=10.0),
        area=area,
        stop=AccuracyStop(radius95_m=35.0),
        keep_away=keep_away,
        energy=energy,
    )
    return Search(settings, beliefs, any_planner(planner), np.random.default_rng(5))


def fly(search: Search, seconds: int) -> list[VehicleState]:
    """Fly until all is found; every second's place."""
    rng = np.random.default_rng(11)
    states = [START]
    while not search.finished and states[-1].time_s < seconds:
        decision = search.decide(states[-1])
        path = flown(search.settings.vehicle, states[-1], decision.action)
        steps = 5 if isinstance(decision.action, FlyTo) else len(path.time_s)
        for number in range(min(steps, len(path.time_s))):
            state = path.state(number)
            states.append(state)
            for tag_id, (east, north) in TAGS.items():
                dx, dy = east - state.east_m, north - state.north_m
                slant = np.hypot(np.hypot(dx, dy), state.height_m)
                off = np.degrees(np.arctan2(dx, dy)) - state.yaw_deg
                level = 33.0 - 25.0 * np.log10(slant / 100.0) + rng.normal(0.0, 3.0)
                level += float(PATTERNS["RA-23K"].gain_db(off))
                heard = Listening(
                    east_m=state.east_m,
                    north_m=state.north_m,
                    height_m=state.height_m,
                    snr_db=float(level) if level >= 10.0 else None,
                    yaw_deg=state.yaw_deg,
                )
                search.listen(tag_id, state.time_s, heard)
            search.judge(state.time_s)
    return states


def test_our_planner_finds_two_animals_and_says_why_it_went_where() -> None:
    search = search_with("mi_rate")
    search.check(START)
    fly(search, 400)
    assert search.finished
    for tag_id, found in search.found.items():
        east, north = TAGS[tag_id]
        off = np.hypot(found.estimate.east_m - east, found.estimate.north_m - north)
        assert off < 45.0
        assert "95 % within" in found.reason
    for _, decision in search.decisions:
        assert "to learn more about tag" in decision.reason
    ended = search.decide(START)
    assert ended.action == Return()
    assert ended.reason == "every tag is found"


@pytest.mark.parametrize("planner", ["mi_rate", *BASELINES])
@pytest.mark.parametrize("vehicle", [Multirotor(), FixedWing()])
def test_every_planner_flies_every_drone_within_the_fence(
    planner: str, vehicle: Vehicle
) -> None:
    fence = Polygon.rectangle(-150.0, 550.0, -150.0, 550.0, name="fence")
    area = SearchArea(search=AREA.search, fence=fence)
    search = search_with(planner, vehicle=vehicle, area=area, particles=400)
    states = fly(search, 60)
    places = np.array([(one.east_m, one.north_m) for one in states])
    assert search.finished or len(places) >= 60
    assert fence.contains(*places.T).all()
    assert np.hypot(*np.ptp(places, axis=0)) > 30.0


def test_the_same_seed_gives_the_same_flight() -> None:
    paths = [fly(search_with("mi_rate", particles=500), 40) for _ in range(2)]
    assert paths[0] == paths[1]


def test_the_drone_goes_round_a_building() -> None:
    building = Circle(east_m=150.0, north_m=150.0, radius_m=60.0)
    area = SearchArea(search=AREA.search, excluded=(building,))
    search = search_with("mi_rate", area=area)
    states = fly(search, 300)
    places = np.array([(one.east_m, one.north_m) for one in states])
    assert not building.contains(*places.T).any()
    refused = [c.refused for _, d in search.decisions for c in d.candidates]
    assert "the path enters a keep-out area" in refused


def test_animals_are_kept_away_from_and_found_ones_too() -> None:
    states = fly(search_with("mi_rate", keep_away=KeepAway(radius_m=50.0)), 400)
    places = np.array([(one.east_m, one.north_m) for one in states])
    for east, north in TAGS.values():
        assert np.hypot(places[:, 0] - east, places[:, 1] - north).min() > 50.0


def test_an_excluded_area_named_after_animals_is_not_entered_as_the_safest_path() -> None:
    named = Circle(east_m=20.0, north_m=20.0, radius_m=400.0, name="animal shelter")
    search = search_with("mi_rate", area=SearchArea(search=AREA.search, excluded=(named,)))
    decision = search.decide(START)
    assert isinstance(decision.action, Hold)
    assert decision.reason == "no path is allowed"


def _in_a_small_area(prior: TagPrior = PRIOR) -> Search:
    """So small that wherever the drone begins, an animal may be near, and on every way."""
    side = 250.0
    small = Area(west_m=0.0, east_m=side, south_m=0.0, north_m=side)
    return search_with(
        "mi_rate",
        area=SearchArea(search=Polygon.rectangle(0.0, side, 0.0, side)),
        keep_away=KeepAway(radius_m=30.0, probability=0.99),
        prior=replace(prior, area=small),
    )


MIDDLE = VehicleState(time_s=0.0, east_m=125.0, north_m=125.0, height_m=40.0)


def test_a_drone_listens_around_before_it_flies_where_animals_may_be() -> None:
    search = _in_a_small_area()
    decision = search.decide(MIDDLE)
    assert decision.action == Rotate(duration_s=12.0)
    assert decision.reason.startswith("to locate tag")


def test_it_turns_to_listen_once_and_not_where_a_turn_tells_nothing() -> None:
    upright = replace(PRIOR, pattern=None)
    assert isinstance(_in_a_small_area(upright).decide(MIDDLE).action, FlyTo)
    search = _in_a_small_area()
    for second in range(1, 11):
        for tag_id in TAGS:
            level = float(PATTERNS["RA-23K"].gain_db(30.0 * second - 100.0 * tag_id))
            heard = Listening(
                east_m=125.0,
                north_m=125.0,
                height_m=40.0,
                snr_db=35.0 + level,
                yaw_deg=30.0 * second % 360.0,
            )
            search.listen(tag_id, float(second), heard)
    decision = search.decide(replace(MIDDLE, time_s=60.0))
    assert isinstance(decision.action, FlyTo)
    assert "this is the safest" in decision.reason


def test_it_leaves_where_an_animal_probably_is_near() -> None:
    search = _in_a_small_area()
    for second in range(1, 61):
        for tag_id in TAGS:
            heard = Listening(
                east_m=125.0, north_m=125.0, height_m=40.0, snr_db=45.0, yaw_deg=6.0 * second
            )
            search.listen(tag_id, float(second), heard)
    decision = search.decide(replace(MIDDLE, time_s=60.0))
    assert isinstance(decision.action, FlyTo)
    assert "this is the safest" in decision.reason


def _walking(east_m: float, north_m: float, east_m_s: float, north_m_s: float) -> TagBelief:
    """A tag of which all is known."""
    prior = replace(PRIOR, motion=(0.0, 0.0, 1.0))
    belief = TagBelief(1, prior, np.random.default_rng(3), particles=400)
    state = belief.tracker._state
    state.east_m[:], state.north_m[:] = east_m, north_m
    state.east_m_s[:], state.north_m_s[:] = east_m_s, north_m_s
    return belief


@pytest.mark.parametrize(
    ("walks", "kept"),
    [((0.0, 0.0), 1.0), ((0.0, -1.5), 0.0), ((0.0, 1.5), 1.0), ((12.0, -1.0), 1.0)],
)
def test_a_way_is_kept_from_where_a_walking_animal_will_be(
    walks: tuple[float, float], kept: float
) -> None:
    """100 m east in 20 s, an animal 35 m beside its middle; at 12 m/s it is gone by then."""
    rule = KeepAway(radius_m=20.0, margin=1.25)
    beliefs = Beliefs(_walking(50.0, 35.0, *walks))
    got = rule.kept(beliefs, (0.0, 0.0), np.array([100.0]), np.array([0.0]), speed_m_s=5.0)
    assert got[0, 0] == kept


def test_a_stay_is_not_kept_where_an_animal_comes_to_the_drone() -> None:
    rule, place = KeepAway(radius_m=20.0, margin=1.25), np.zeros(1)
    beliefs = Beliefs(_walking(0.0, 40.0, 0.0, -1.0))
    for stays_s, kept in ((0.0, 1.0), (10.0, 1.0), (20.0, 0.0)):
        got = rule.kept(beliefs, (0.0, 0.0), place, place, speed_m_s=5.0, stays_s=stays_s)
        assert got[0, 0] == kept


def test_it_returns_when_the_energy_for_the_way_home_and_the_reserve_is_reached() -> None:
    search = search_with("mi_rate", energy=EnergyModel())
    far = replace(START, east_m=380.0, north_m=380.0)
    plenty = search.decide(far, battery=Battery(remaining_wh=80.0, reserve_wh=15.0))
    assert isinstance(plenty.action, FlyTo | Hold) or plenty.action != Return()
    little = search.decide(far, battery=Battery(remaining_wh=27.0, reserve_wh=15.0))
    assert little.action == Return()
    assert "the reserve is 15 Wh" in little.reason or "return" in little.reason


def test_a_tag_without_any_strength_and_a_start_underground_are_refused() -> None:
    unknown = replace(PRIOR, level_sigma_db=float("nan"))
    with pytest.raises(PlanError, match="signal strength expected of tag 1 is missing"):
        search_with("mi_rate", prior=unknown).check(START)
    with pytest.raises(PlanError, match="comes below 20 m"):
        search_with("mi_rate").check(replace(START, height_m=3.0))
    far = SearchArea(search=AREA.search, home_m=(-40_000.0, 0.0))
    with pytest.raises(PlanError, match="the battery allows"):
        search_with("mi_rate", area=far, energy=EnergyModel()).check(
            START, Battery(remaining_wh=90.0)
        )


def test_a_way_past_the_tag_tells_more_than_one_away_from_it() -> None:
    search = search_with("mi_rate")
    situation = search.situation(START, Wind())
    east, north = headings(situation, 4, 150.0, first_deg=45.0)
    legs = sampled(situation, east, north, np.full(4, 15.0), 6)
    listener = Listener(above_tags_m=40.0, pulse_s=1.0, threshold_db=10.0)
    nats = information_nats(list(search.beliefs.values()), legs, listener).sum(axis=0)
    assert int(np.argmax(nats)) == 0
    assert nats[0] > 1.5 * nats[2]
    deaf = Listener(above_tags_m=40.0, pulse_s=1.0, threshold_db=200.0)
    silent = information_nats(list(search.beliefs.values()), legs, deaf)
    assert silent == pytest.approx(0.0, abs=1e-6)


def test_others_add_planners_by_entry_point(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "uavrt.core.plugins.entry_points",
        lambda group: [EntryPoint(name="stay", value=f"{__name__}:Stay", group=group)],
    )
    monkeypatch.setattr(PLANNERS, "_added", None)
    monkeypatch.setattr(EntryPoint, "load", lambda self: Stay)
    monkeypatch.setattr(PLANNERS, "_loaded", {})
    assert isinstance(planner_named("stay"), Stay)
    with pytest.raises(UsageError, match="no planner 'nobody'"):
        planner_named("nobody")


class Stay:
    def decide(self, situation: object) -> Decision:
        return Decision(action=Hold(), reason="someone else's")


def test_squares_by_one_product_are_those_of_the_differences() -> None:
    rng = np.random.default_rng(5)
    scaled = rng.normal(0.0, 3.0, (4, 6, 9)).astype(np.float32)
    whole = rng.normal(0.0, 1.0, (4, 9)).astype(np.float32)
    squares = ((scaled[:, :, :, None] - scaled[:, :, None, :]) ** 2).sum(axis=1)
    common = (whole[:, :, None] - whole[:, None, :]) ** 2
    assert minus_quarter_squares(scaled, whole) == pytest.approx(
        -0.25 * (squares - common), abs=2e-4
    )


def test_a_way_that_is_refused_is_not_weighed() -> None:
    building = Circle(east_m=150.0, north_m=150.0, radius_m=60.0)
    area = SearchArea(search=AREA.search, excluded=(building,))
    search = search_with("mi_rate", area=area)
    decision = search.decide(replace(START, east_m=60.0, north_m=150.0))
    refused = [one for one in decision.candidates if one.refused is not None]
    assert refused
    assert all(one.nats_per_s is None for one in refused)
    assert all(one.nats_per_s is not None for one in decision.candidates if one not in refused)
