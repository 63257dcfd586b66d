"""Log lines: JSON for the supervisor, whatever is logged, and never a reason to stop."""

import contextlib
import io
import json
import logging
import os
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.log import configure_logging, get_logger


@pytest.fixture(autouse=True)
def _restored() -> Iterator[None]:
    yield
    configure_logging("")


@given(
    event=st.text(),
    facts=st.dictionaries(
        st.text("abcdefgh_", min_size=1),
        st.none() | st.integers() | st.floats() | st.text() | st.binary(),
    ),
)
def test_every_event_is_one_line_of_json(event: str, facts: dict[str, object]) -> None:
    stream = io.StringIO()
    configure_logging("recorder", stream=stream)
    get_logger().log(logging.WARNING, event, **facts)
    text = stream.getvalue()
    assert text.count("\n") == 1
    line = json.loads(text)
    assert (line["event"], line["level"], line["process"]) == (event, "warning", "recorder")
    assert facts.keys() <= line.keys()


def test_events_below_the_level_are_left_out() -> None:
    stream = io.StringIO()
    configure_logging("x", level=logging.WARNING, stream=stream)
    get_logger().info("not this")
    get_logger().error("this")
    assert [json.loads(line)["event"] for line in stream.getvalue().splitlines()] == ["this"]


def test_an_exception_is_logged_with_its_traceback() -> None:
    stream = io.StringIO()
    configure_logging("x", stream=stream)
    try:
        raise KeyError("gone")
    except KeyError:
        get_logger().exception("failed", step=3)
    line = json.loads(stream.getvalue())
    assert line["step"] == 3
    assert "KeyError: 'gone'" in line["exception"]


def test_a_closed_stream_does_not_stop_the_process() -> None:
    stream = io.StringIO()
    configure_logging("x", stream=stream)
    get_logger().warning("this is written")
    assert "this is written" in stream.getvalue()
    stream.close()
    get_logger().warning("this has nowhere to go")


def test_a_terminal_that_was_stopped_keeps_nobody_waiting_and_is_told_what_it_missed() -> None:
    read, write = os.pipe()
    os.set_blocking(write, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(write, b"x" * 4096)
    os.set_blocking(write, True)
    with os.fdopen(read, "rb") as reader, os.fdopen(write, "w") as stream:
        configure_logging("supervisor", stream=stream)
        for number in range(3):
            get_logger().info("flight begins", number=number)
        reader.read1(1 << 20)
        get_logger().info("flight ends")
        stream.flush()
        lines = reader.read1(1 << 20).decode().strip().split("\n")
    told = [json.loads(line) for line in lines]
    assert [(one["event"], one.get("count")) for one in told] == [
        ("lines left out", 3),
        ("flight ends", None),
    ]
