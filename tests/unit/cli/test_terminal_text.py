"""No text of others commands the terminal."""

import io

from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.table import Table

from uavrt.cli.shown.terminal_text import TerminalText, harmless

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
