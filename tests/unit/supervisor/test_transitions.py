from itertools import product
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.messages import CommandName, SystemState
from uavrt.supervisor.transitions import TRANSITIONS, Accepted, Refused, Repeated, outcome

COMMANDS: tuple[CommandName, ...] = get_args(CommandName)


def test_every_command_has_an_answer_in_every_state() -> None:
    assert set(TRANSITIONS) == set(product(SystemState, COMMANDS))


@pytest.mark.parametrize(("state", "command"), list(product(SystemState, COMMANDS)))
def test_a_refusal_says_what_to_do(state: SystemState, command: CommandName) -> None:
    result = outcome(state, command)
    if isinstance(result, Refused):
        assert ":" in result.reason


@given(st.lists(st.sampled_from(COMMANDS)))
def test_no_sequence_of_commands_locks_the_system_up(commands: list[CommandName]) -> None:
    state = SystemState.IDLE
    for command in [*commands, "stop_detection", "start_tags", "add_tag", "end_tags"]:
        result = outcome(state, command)
        if isinstance(result, Accepted):
            state = result.state
    assert state is SystemState.HAS_TAGS
    assert outcome(state, "start_detection") == Accepted(SystemState.DETECTING)


@given(st.sampled_from(SystemState), st.sampled_from(COMMANDS))
def test_a_repeated_command_is_never_refused(state: SystemState, command: CommandName) -> None:
    first = outcome(state, command)
    if isinstance(first, Accepted):
        assert isinstance(outcome(first.state, command), Accepted | Repeated)
