"""Nothing is flown over people and buildings, whatever the order, by either autopilot."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flown import HOME, Flown
from searched import Animal, Searched
from some import some

from uavrt.core.errors import PlanError
from uavrt.core.messages import KeepOut
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.plans import Go
from uavrt.guidance.safety import SAFETY
from uavrt.planning.drone_model.drone_motion import VehicleState
from uavrt.planning.drone_model.planner_actions import FlyTo
from uavrt.planning.situation import Decision, Situation
from uavrt.simulation.vehicle.airframe import Flavour

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])


def place(north_m: float, east_m: float) -> tuple[float, float]:
    return HOME.to_geodetic(north_m, east_m)


BARN = KeepOut(
    places=tuple(place(*one) for one in ((80, -20), (80, 20), (110, 20), (110, -20))),
    name="barn",
)
PERSON = KeepOut(places=(place(0, 100),), radius_m=25.0)
LIMITS = Limits(battery_wh=120.0, keep_out=(BARN, PERSON))
FIELD = ((60, 60), (60, 150), (150, 150), (150, 60))


def corners(*local: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple(place(*one) for one in local)


@BOTH
@pytest.mark.parametrize(
    ("action", "values", "reason"),
    [
        ("goto", {"places": corners((95, 0))}, "enters the keep-out 'barn'"),
        ("goto", {"places": corners((95, -24))}, "enters the keep-out 'barn'"),
        ("goto", {"places": corners((200, 0))}, "enters the keep-out 'barn'"),
        ("goto", {"places": corners((0, 90))}, "enters a keep-out area"),
        ("survey", {"places": corners((50, -60), (50, 60), (140, 60), (140, -60))}, "'barn'"),
        (
            "survey",
            {"places": corners((60, -90), (60, 90), (140, 90)), "pattern": "around"},
            "barn",
        ),
    ],
)
def test_a_way_over_people_or_buildings_is_refused_before_anything_moves(
    flavour: Flavour, action: str, values: dict[str, Any], reason: str
) -> None:
    flown = Flown(flavour, limits=LIMITS)
    with pytest.raises(PlanError, match=reason) as refused:
        flown.order(action, height_m=40.0, **values)
    assert refused.value.remedy
    assert flown.authority.standing is ControlStage.OUT
    assert not flown.commands


def test_a_way_to_where_only_the_way_home_leads_over_them_is_refused() -> None:
    flown = Flown("px4", limits=LIMITS)
    flown.vehicle.body.north_m, flown.vehicle.body.east_m = 200.0, 150.0
    flown.run(0.2)
    with pytest.raises(PlanError, match="leads home over the keep-out 'barn'"):
        flown.order("goto", places=corners((200, 0)), height_m=40.0)
    flown.order("goto", places=corners((200, 80)), height_m=40.0)


@pytest.mark.parametrize("action", ["hold", "rotate", "return"])
@pytest.mark.parametrize(("north_m", "reason"), [(95.0, "enters"), (160.0, "leads home over")])
def test_no_order_begins_over_or_behind_a_building(
    action: str, north_m: float, reason: str
) -> None:
    flown = Flown("px4", limits=LIMITS)
    flown.vehicle.body.north_m = north_m
    flown.run(0.2)
    with pytest.raises(
        PlanError, match=f"no path is possible from the drone's position: the path {reason}"
    ):
        flown.order(action)


def test_what_comes_with_an_order_counts_beside_the_settings() -> None:
    flown = Flown("px4", limits=LIMITS)
    goal = corners((60, -60))
    with pytest.raises(PlanError, match="enters a keep-out area"):
        flown.order(
            "goto",
            places=goal,
            height_m=40.0,
            keep_out=(KeepOut(places=corners((30, -30)), radius_m=10.0),),
        )
    flown.order("goto", places=goal, height_m=40.0)


@pytest.mark.parametrize(
    ("local", "radius_m", "reason"),
    [
        (((0, 0),), 10.0, "home lies in or at the edge of"),
        (((4, 0), (50, 0), (50, 50)), None, "home lies in or at the edge of"),
        (((50, 0), (90, 40), (90, 0), (50, 40)), None, "crosses itself"),
        (((50, 0), (50.1, 0), (50, 0.1)), None, "too small: 0 m²"),
    ],
)
def test_places_to_keep_out_of_that_cannot_be_are_refused(
    local: tuple[tuple[float, float], ...], radius_m: float | None, reason: str
) -> None:
    wrong = KeepOut(places=corners(*local), radius_m=radius_m)
    flown = Flown("px4", limits=replace(LIMITS, keep_out=(wrong,)))
    with pytest.raises(PlanError, match=reason):
        flown.order("hold")


@BOTH
def test_a_search_keeps_out_with_its_way_home(flavour: Flavour) -> None:
    barn = KeepOut(places=corners((60, 20), (60, 60), (100, 60), (100, 20)), name="barn")
    person = KeepOut(places=corners((-80, 40)), radius_m=25.0)
    limits = Limits(battery_wh=160.0, speed_m_s=8.0, keep_out=(barn, person), keep_away_m=0.0)
    animals = [Animal(190.0, 70.0), Animal(-170.0, 60.0)]
    search = Searched(flavour, animals, limits=limits, duration_s=90.0)
    vehicle = search.flown.vehicle
    area = search.seeker_of(search.order()).area
    search.begin()
    way = []
    for _ in range(2400):
        search.step()
        way.append(vehicle.body.place_m)
        if search.out:
            break
    assert search.flown.authority.reason == "returning: the autopilot flies home"
    for _ in range(1200):
        search.flown.step()
        way.append(vehicle.body.place_m)
    assert not vehicle.armed
    north, east = np.array(way).T
    assert (
        min(float(void.off_m(east, north).min()) for void in area.excluded)
        > 0.3 * SAFETY.margin_m
    )
    assert any("keep-out 'barn'" in note.reason for note in search.notes)


def test_a_search_that_would_begin_over_a_building_is_refused() -> None:
    limits = Limits(battery_wh=160.0, keep_out=(BARN,))
    search = Searched("px4", [Animal(150.0, -60.0)], limits=limits)
    search.flown.vehicle.body.north_m = 95.0
    search.flown.run(0.2)
    with pytest.raises(
        PlanError, match="no path is possible from the drone's position: the path enters"
    ):
        search.begin()


class _Now:
    """A planner with one decision at a time."""

    def __init__(self, east_m: float, north_m: float) -> None:
        self.decision = Decision(action=FlyTo(east_m=east_m, north_m=north_m), reason="as told")
        self.states: list[VehicleState] = []

    def decide(self, situation: Situation) -> Decision:
        self.states.append(situation.state)
        return self.decision


@BOTH
def test_the_next_way_is_judged_from_where_the_drone_comes_to_a_stand(flavour: Flavour) -> None:
    """Not from where it is at speed: from there it may lead past what it then crosses."""
    tent = KeepOut(places=(place(22, 24),), radius_m=2.0, name="tent")
    limits = Limits(battery_wh=160.0, speed_m_s=8.0, keep_out=(tent,), keep_away_m=0.0)
    search = Searched(flavour, [Animal(150.0, -60.0)], limits=limits)
    search.begin()
    planner = _Now(60.0, 0.0)
    search.search_run._search._planner = planner
    vehicle = search.flown.vehicle
    search.run(60.0, until=lambda: vehicle.body.east_m > 20.0)
    assert math.hypot(*vehicle.body.velocity_m_s) > 7.0
    was_m = vehicle.body.east_m
    planner.decision = Decision(action=FlyTo(east_m=0.0, north_m=55.0), reason="as told")
    now = search.flown.now()
    choice = search.search_run.decide(search.time_ns, some(now), idle=False)
    stand, entered = planner.states[-1], search.search_run.area.entered_area
    assert stand.east_m > was_m + 5.0
    assert entered(np.array([was_m, 0.0]), np.array([0.0, 55.0])) is None
    assert "enters the keep-out 'tent'" in choice.status_text
    assert all(isinstance(step, Go) and step.stay_s > 0.0 for step in some(choice.steps))
