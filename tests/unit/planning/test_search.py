"""Searches from the first pulse to the way home, with every planner."""

from dataclasses import replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from uavrt.errors import PlanError, UsageError
from uavrt.localization import PATTERNS, Listening, TagPrior
from uavrt.localization.bayes_fix import Area
from uavrt.planning import (
    PLANNERS,
    Battery,
    Beliefs,
    Circle,
    Decision,
    EnergyModel,
    FixedWing,
    FlyTo,
    Hold,
    HonestStop,
    KeepAway,
    Multirotor,
    Polygon,
    Return,
    Search,
    SearchArea,
    SearchSettings,
    TagBelief,
    Vehicle,
    VehicleState,
    Wind,
    flown,
    planner_named,
)
from uavrt.planning.information import Listener, information_nats
from uavrt.planning.planners.ways import headings, sampled

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
        stop=HonestStop(radius95_m=35.0),
        keep_away=keep_away,
        energy=energy,
    )
    return Search(settings, beliefs, planner_named(planner), np.random.default_rng(5))


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
        assert "tag" in decision.reason
        assert "candidates" in decision.reason
    ended = search.decide(START)
    assert ended.action == Return()
    assert ended.reason == "every tag is found"


@pytest.mark.parametrize("planner", list(PLANNERS))
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
    area = SearchArea(search=AREA.search, voids=(building,))
    search = search_with("mi_rate", area=area)
    states = fly(search, 300)
    places = np.array([(one.east_m, one.north_m) for one in states])
    assert not building.contains(*places.T).any()
    refused = [c.refused for _, d in search.decisions for c in d.candidates]
    assert "enters a place to keep away from" in refused


def test_animals_are_kept_away_from_and_found_ones_too() -> None:
    states = fly(search_with("mi_rate", keep_away=KeepAway(radius_m=50.0)), 400)
    places = np.array([(one.east_m, one.north_m) for one in states])
    for east, north in TAGS.values():
        assert np.hypot(places[:, 0] - east, places[:, 1] - north).min() > 50.0


def test_it_returns_when_the_energy_for_the_way_home_and_the_reserve_is_reached() -> None:
    search = search_with("mi_rate", energy=EnergyModel())
    far = replace(START, east_m=380.0, north_m=380.0)
    plenty = search.decide(far, battery=Battery(remaining_wh=80.0, reserve_wh=15.0))
    assert isinstance(plenty.action, FlyTo | Hold) or plenty.action != Return()
    little = search.decide(far, battery=Battery(remaining_wh=27.0, reserve_wh=15.0))
    assert little.action == Return()
    assert "the reserve is 15.0 Wh" in little.reason or "way home" in little.reason


def test_a_tag_without_any_strength_and_a_start_underground_are_refused() -> None:
    unknown = replace(PRIOR, level_sigma_db=float("nan"))
    with pytest.raises(PlanError, match="tag 1 has no strength"):
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
        "uavrt.plugins.entry_points",
        lambda group: [
            EntryPoint(name="stay", value=f"{__name__}:Stay", group=group),
        ],
    )
    monkeypatch.setattr(PLANNERS, "_added", None)
    monkeypatch.setattr(EntryPoint, "load", lambda self: Stay)
    assert isinstance(planner_named("stay"), Stay)
    with pytest.raises(UsageError, match="no planner 'nobody'"):
        planner_named("nobody")
    monkeypatch.setattr(PLANNERS, "_added", None)


class Stay:
    def decide(self, situation: object) -> Decision:
        return Decision(action=Hold(), reason="someone else's")
