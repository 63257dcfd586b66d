"""A command's numbers travel as its row lists them, in every protocol version."""

import struct
from dataclasses import replace
from typing import Any

import pytest
from some import typed

from uavrt.core.commands import COMMAND_OF_NUMBER, COMMANDS, CommandField, CommandId, Generation
from uavrt.core.errors import FormatError
from uavrt.core.messages import Command
from uavrt.ground.link.button_states import COMMAND_OF_ACTION, Situation, action_states
from uavrt.ground.link.command_sender import Commands
from uavrt.ground.link.requests.command_payloads import CommandEncoder
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.generations import codec
from uavrt.link.tunnel.generations.g1 import AckG1, FieldsG1
from uavrt.link.tunnel.generations.g2 import FieldsG2

ROW = replace(
    COMMANDS["save_logs"],
    lengths={"G1": (16,), "G2": (24,)},
    fields=(
        CommandField(name="count", low=1, high=9),
        CommandField(name="limit_mb", kind="f64", unit="MB", low=0.5, high=100.0),
    ),
)
VALUES = {"count": 3.0, "limit_mb": 12.25}


@pytest.fixture(autouse=True)
def saved_with_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let "save logs" carry two numbers, a u32 and an f64."""
    monkeypatch.setitem(COMMANDS, "save_logs", ROW)
    monkeypatch.setitem(COMMAND_OF_ACTION, "save_logs", ROW)
    monkeypatch.setitem(COMMAND_OF_NUMBER, CommandId.SAVE_LOGS, ROW)
    for kind, decoder in (FieldsG1.decoders() | FieldsG2.decoders()).items():
        monkeypatch.setitem(codec.DECODERS, kind, decoder)


@pytest.mark.parametrize("generation", ["G1", "G2v1", "G2"])
def test_the_numbers_of_a_row_reach_the_drone(generation: Generation) -> None:
    exchange = Exchange(generation, experimental=True)
    payload = CommandEncoder(generation).command("save_logs", VALUES)
    command = typed(Command, exchange.receive(payload, (254, 190)))
    assert (command.name, command.values) == ("save_logs", VALUES)
    numbers = payload[8:] if generation == "G2" else payload[4:]
    assert numbers == struct.pack("<I4xd" if generation == "G2" else "<Id", 3, 12.25)


def test_a_number_outside_its_range_is_refused_with_the_range() -> None:
    payload = CommandEncoder("G1").command("save_logs", VALUES | {"limit_mb": 200.0})
    answer = typed(Answer, Exchange().receive(payload, (254, 190)))
    ack = typed(AckG1, codec.decode(answer.payload))
    assert ack.message == "limit_mb 200 is not supported: choose 0.5 to 100 MB"


def test_the_page_asks_for_the_numbers_of_a_command_that_has_some() -> None:
    states = action_states(
        Situation(
            link_open=True,
            drone_present=True,
            state=None,
            tags=0,
            tags_sent=False,
            busy=None,
            flight_open=False,
        )
    )
    assert states["save_logs"]["fields"] == [
        {"name": "count", "unit": ""},
        {"name": "limit_mb", "unit": "MB"},
    ]
    assert [action for action, state in states.items() if "fields" in state] == ["save_logs"]


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ({"count": 3}, "limit_mb must be a number"),
        ({"count": 3, "limit_mb": "12"}, "limit_mb must be a number"),
        ({"count": 30, "limit_mb": 12.0}, "count 30 is not supported: choose 1 to 9"),
    ],
)
async def test_a_request_with_a_wrong_number_is_refused_before_it_is_sent(
    body: dict[str, object], fault: str
) -> None:
    vehicle: Any = None
    with pytest.raises(FormatError, match=fault):
        await Commands(vehicle).by_name(body)["save_logs"]()
