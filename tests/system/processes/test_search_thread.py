"""A search thinks beside the guide's own work."""

import threading
from dataclasses import replace
from typing import Any

from searched import Animal, Searched
from until import until

from uavrt.core.messages import SearchNote
from uavrt.drone.processes.search_thread import SearchFailed, SearchThread
from uavrt.guidance.operator_orders import VehicleNow
from uavrt.guidance.search.search_run import Choice
from uavrt.guidance.search_rules import SEARCH_RULES


class Slow:
    """A search whose decision takes until it is let go."""

    def __init__(self) -> None:
        self.go, self.asked = threading.Event(), 0
        self.pulses = 0

    def pulse(self, _: Any) -> None:
        self.pulses += 1

    def decide(self, _time_ns: int, _now: VehicleNow, *, idle: bool, others: Any) -> Choice:
        assert others == ()
        self.asked += 1
        self.go.wait(60.0)
        return Choice(steps=None, status_text=f"idle {idle}", notes=())


def now_at(time_s: float) -> VehicleNow:
    now = Searched("px4", []).flown.now()
    assert now is not None
    return replace(now, time_s=time_s)


def test_nothing_waits_for_a_slow_decision() -> None:
    slow: Any = Slow()
    planner = SearchThread(slow)
    for time_s in (100.0, 101.0, 120.0):
        planner.request_decision(0, now_at(time_s), idle=True)
        planner.pulse(None)  # type: ignore[arg-type]
        assert planner.results() == []
    slow.go.set()
    (choice,) = until(planner.results)
    assert isinstance(choice, Choice)
    assert choice.status_text == "idle True"
    assert slow.asked == 1


def test_decisions_under_way_are_a_cycle_apart() -> None:
    slow: Any = Slow()
    slow.go.set()
    planner = SearchThread(slow)
    early_s, late_s = (100.0 + share * SEARCH_RULES.cycle_s for share in (0.9, 1.1))
    for time_s in (100.0, early_s, late_s):
        planner.request_decision(0, now_at(time_s), idle=False)
        if time_s != early_s:
            until(planner.results)
    assert slow.asked == 2


def test_a_fault_of_ours_ends_the_search() -> None:
    broken: Any = object()
    planner = SearchThread(broken)
    planner.request_decision(0, now_at(100.0), idle=True)
    (failed,) = until(planner.results)
    assert isinstance(failed, SearchFailed)
    assert "has failed" in failed.reason


def test_the_last_thought_sums_up() -> None:
    search = Searched("px4", [Animal(50.0, 0.0)])
    search.begin()
    search.run(3.0)
    planner = SearchThread(search.search_run)
    planner.end(search.time_ns, now_at(search.flown.time_s), "a pilot took over")
    (note,) = until(planner.results)
    assert isinstance(note, SearchNote)
    assert (note.event, note.reason) == ("ended", "a pilot took over")
    until(lambda: planner.over)
