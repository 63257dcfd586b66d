"""Lines to a terminal that may stand still, and to a reader that may go."""

import contextlib
import os
import time
from typing import TextIO

from uavrt.cli.shown.terminal_lines import TerminalLines


def pipe() -> tuple[TextIO, TextIO]:
    read, write = os.pipe()
    return os.fdopen(read), os.fdopen(write, "w")


def test_lines_come_out_in_their_order() -> None:
    reader, writer = pipe()
    lines = TerminalLines(writer)
    for number in range(500):
        lines(f"line {number}")
    assert lines.close()
    writer.close()
    assert reader.read().split("\n")[:-1] == [f"line {number}" for number in range(500)]
    reader.close()
    assert (lines.left_out, lines.gone) == (0, False)


def test_a_reader_that_stands_still_keeps_nobody_waiting() -> None:
    reader, writer = pipe()
    lines = TerminalLines(writer, most=3000)
    begun_s = time.monotonic()
    for number in range(5000):
        lines("x" * 100 + str(number))
    assert time.monotonic() - begun_s < 5.0
    assert lines.left_out >= 5000 - 3000 - 2 * 1000
    assert not lines.close(0.05)
    os.set_blocking(reader.fileno(), False)
    read = 0
    while not lines.close(0.01):  # it goes on
        with contextlib.suppress(BlockingIOError):
            read += os.read(reader.fileno(), 1 << 20).count(b"\n")
    with contextlib.suppress(BlockingIOError):
        read += os.read(reader.fileno(), 1 << 20).count(b"\n")
    writer.close()
    reader.close()
    assert read == 5000 - lines.left_out


def test_a_reader_that_has_gone_is_no_fault() -> None:
    reader, writer = pipe()
    lines = TerminalLines(writer)
    reader.close()
    for number in range(100):
        lines(f"line {number}")
    assert lines.close()
    assert lines.gone
    assert lines.left_out == 100
    writer.close()
