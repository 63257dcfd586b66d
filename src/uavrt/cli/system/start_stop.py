"""Start and stop detection without a ground station, as in tests on a bench or cart."""

import os
from collections.abc import Sequence

from uavrt.config.parameters import check_start
from uavrt.core.clock import monotonic_s
from uavrt.core.commands import CommandName
from uavrt.core.errors import CommandRefused, UavrtError
from uavrt.core.messages import Command, CommandReply, Tag
from uavrt.drone.status_reader import StatusReader

REPLY_S = 15.0
"""Longest wait for the drone's reply [s]; choosing a radio frequency takes some seconds."""


def start_detection(
    reader: StatusReader,
    tags: Sequence[Tag],
    *,
    center_frequency_hz: float | None = None,
    gain: int | None = None,
) -> str:
    """Upload tags and start detection; return the flight's directory."""
    check_start(None, center_frequency_hz, gain)
    _ask(reader, "start_tags", 1)
    for number, tag in enumerate(tags):
        _ask(reader, "add_tag", 2 + number, tag=tag)
    _ask(reader, "end_tags", 2 + len(tags))
    return _ask(
        reader,
        "start_detection",
        3 + len(tags),
        center_frequency_hz=center_frequency_hz,
        gain=gain,
    )


def stop_detection(reader: StatusReader) -> str:
    """Stop detection; return the flight's directory. Raises `UavrtError` if refused."""
    return _ask(reader, "stop_detection", 1)


def _ask(
    reader: StatusReader,
    name: CommandName,
    number: int,
    *,
    tag: Tag | None = None,
    center_frequency_hz: float | None = None,
    gain: int | None = None,
) -> str:
    # Another call of the command line must not be taken for a retry of this one.
    source = f"command line {os.getpid()} {id(reader)} {monotonic_s():.6f}"
    command = Command(
        name=name,
        request_id=number,
        tag=tag,
        center_frequency_hz=center_frequency_hz,
        gain=gain,
        source=source,
    )
    reader.send("command", command)
    deadline_s = monotonic_s() + REPLY_S
    while monotonic_s() < deadline_s:
        for _, record in reader.read(0.1):
            if (
                isinstance(record, CommandReply)
                and record.name == name
                and record.request_id == number
            ):
                if not record.accepted:
                    raise CommandRefused(record.message)
                return record.message
    raise UavrtError(f"the supervisor did not answer the command {name}", remedy="Try again")
