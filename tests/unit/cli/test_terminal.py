"""Writing to a terminal: lines to one that may stand still, and no command of others."""

import contextlib
import io
import os
import time
from typing import TextIO

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.table import Table

from uavrt.cli.shown.terminal_lines import TerminalLines
from uavrt.cli.shown.terminal_text import TerminalText, harmless


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


TITLE, CLIPBOARD = "\x1b]0;owned\x07", "\x1b]52;c;ZWNobw==\x07"


def test_titles_clipboards_and_questions_are_shown_and_not_obeyed() -> None:
    text = f"area {TITLE}{CLIPBOARD}\x1b[6n\x9b5n\x1bc\x08\x7f"
    shown = harmless(text)
    assert "\x1b" not in shown
    assert shown.isprintable()
    assert r"\x1b]0;owned\x07" in shown


def test_lines_tabs_colours_and_progress_stay() -> None:
    text = "a\tb\r\n\x1b[1;31mred\x1b[0m\x1b[2K\x1b[1A\x1b[?25l\x1b[?1049h\x1b[H\x1b[2J"
    assert harmless(text) == text


def test_tables_of_ours_pass_a_guarded_terminal_unchanged() -> None:
    def drawn(stream: object) -> None:
        table = Table("tag", "level")
        table.add_row("[red]lynx[/red]", "20 dB")
        console = Console(file=stream, force_terminal=True, width=60)  # type: ignore[arg-type]
        with console.status("working"):
            console.print(table)

    raw, guarded = io.StringIO(), io.StringIO()
    drawn(raw)
    drawn(TerminalText(guarded))
    assert "\x1b[" in raw.getvalue()
    assert harmless(raw.getvalue()) == raw.getvalue()
    assert "lynx" in guarded.getvalue()


@given(st.text())
def test_whatever_is_written_a_terminal_gets_no_other_control_character(text: str) -> None:
    stream = io.StringIO()
    assert TerminalText(stream).write(text) == len(text)
    left = stream.getvalue()
    for ours in ("\n", "\r", "\t"):
        left = left.replace(ours, "")
    rest = harmless(left)
    assert rest == left, "it is stable"
    assert "\x9b" not in left
    assert "\x1b]" not in left
