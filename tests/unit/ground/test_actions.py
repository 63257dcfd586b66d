"""Which button may be pressed when."""

from itertools import product

from uavrt.core.commands import Refused, SystemState, outcome
from uavrt.ground.link.button_states import (
    ACTIONS,
    COMMAND_OF_ACTION,
    Busy,
    Situation,
    action_states,
)

ALWAYS = ("radio_status", "parameters")
UPKEEP = {"save_logs", "clean_logs", *ALWAYS}
BUSY = Busy(action="start", text="starting")


def situation(**changes: object) -> Situation:
    usual: dict[str, object] = {
        "link_open": True,
        "drone_present": True,
        "state": SystemState.HAS_TAGS,
        "tags": 2,
        "tags_sent": True,
        "busy": None,
        "flight_open": False,
    }
    return Situation(**{**usual, **changes})  # type: ignore[arg-type]


def enabled(**changes: object) -> set[str]:
    states = action_states(situation(**changes))
    return {name for name, state in states.items() if state["enabled"]}


def test_a_button_is_off_exactly_when_it_says_why() -> None:
    values: dict[str, tuple[object, ...]] = {
        "link_open": (True, False),
        "drone_present": (True, False),
        "state": (None, *SystemState),
        "tags": (0, 2),
        "tags_sent": (True, False),
        "busy": (None, BUSY),
        "flight_open": (True, False),
    }
    for case in product(*values.values()):
        states = action_states(situation(**dict(zip(values, case, strict=True))))
        assert set(states) == set(ACTIONS)
        for one in states.values():
            assert one["enabled"] is (one["reason"] is None)


def test_what_is_offered_is_never_refused_by_the_drones_table() -> None:
    offered = [
        (state, action)
        for state, tags, sent in product(SystemState, (0, 2), (True, False))
        for action in enabled(state=state, tags=tags, tags_sent=sent)
    ]
    assert len(offered) > 20
    for state, action in offered:
        assert not isinstance(outcome(state, COMMAND_OF_ACTION[action].name), Refused)


def test_the_buttons_of_a_flight_follow_its_state() -> None:
    assert enabled(state=SystemState.IDLE, tags_sent=False) == {
        *("send_tags", "capture"),
        *UPKEEP,
    }
    assert enabled() == {"send_tags", "start", "capture", *UPKEEP}
    assert enabled(state=SystemState.DETECTING, flight_open=True) == {"stop", "mark", *ALWAYS}
    assert enabled(drone_present=False) == set()
    assert enabled(busy=BUSY) == set()


def test_changed_tags_must_be_sent_before_a_start() -> None:
    assert "start" not in enabled(tags_sent=False)
