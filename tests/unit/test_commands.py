from itertools import product
from typing import get_args

from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.commands import COMMANDS, Accepted, CommandName, Refused, SystemState, outcome
from uavrt.link.tunnel.generations import g0, g1, g2

NAMES: tuple[CommandName, ...] = get_args(CommandName)


def test_every_command_is_a_row_with_an_answer_in_every_state() -> None:
    assert tuple(COMMANDS) == NAMES
    for row in COMMANDS.values():
        assert set(row.states) == set(SystemState)


def test_the_tunnel_reads_each_command_in_the_lengths_its_row_tells() -> None:
    told = {
        (generation, row.number, length)
        for row in COMMANDS.values()
        for generation, lengths in row.lengths.items()
        for length in lengths
    }
    numbers = {row.number for row in COMMANDS.values()}
    read = {
        (generation, number, length)
        for generation, decoders in (
            ("G0", g0.DECODERS),
            ("G1", g1.DECODERS),
            ("G2", g2.DECODERS),
        )
        for number, length in decoders
        if number in numbers
    }
    assert told == read


def test_no_two_commands_share_a_number_or_a_button() -> None:
    numbers = [row.number for row in COMMANDS.values() if row.number is not None]
    actions = [row.button.action for row in COMMANDS.values() if row.button is not None]
    assert len(set(numbers)) == len(numbers)
    assert len(set(actions)) == len(actions)


def test_a_refusal_says_what_to_do() -> None:
    results = [outcome(state, command) for state, command in product(SystemState, NAMES)]
    reasons = [result.reason for result in results if isinstance(result, Refused)]
    assert reasons
    assert [reason for reason in reasons if ":" not in reason] == []


@given(st.lists(st.sampled_from(NAMES)))
def test_no_sequence_of_commands_locks_the_system_up(commands: list[CommandName]) -> None:
    state = SystemState.IDLE
    for command in [*commands, "stop_detection", "start_tags", "add_tag", "end_tags"]:
        result = outcome(state, command)
        if isinstance(result, Accepted):
            state = result.state
    assert state is SystemState.HAS_TAGS
    assert outcome(state, "start_detection") == Accepted(SystemState.DETECTING)


def test_a_repeated_command_is_never_refused() -> None:
    again = [
        outcome(first.state, command)
        for state, command in product(SystemState, NAMES)
        if isinstance(first := outcome(state, command), Accepted)
    ]
    assert again
    assert [result for result in again if isinstance(result, Refused)] == []
