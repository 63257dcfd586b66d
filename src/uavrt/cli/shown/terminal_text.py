"""Make text from files safe to print, because it may contain control commands."""

import re
import sys
from typing import Any, TextIO

_CONTROL = re.compile(
    # Colours and the cursor of our own tables and progress bars; and any other character that
    # a terminal obeys.
    r"(\x1b\[(?:[\d;]*[ABCDGHJKm]|\?(?:25|1049)[hl]))|[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]"
)


def harmless(text: str) -> str:
    r"""Show control characters as ``\x1b``; colours, cursor moves and line ends are kept."""
    return _CONTROL.sub(lambda found: found[1] or f"\\x{ord(found[0]):02x}", text)


class TerminalText:
    """Wraps the terminal `stream` so that it prints only harmless text.

    All other methods are those of the stream.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text, with terminal commands made visible."""
        self._stream.write(harmless(text))
        return len(text)

    def writelines(self, lines: Any) -> None:
        """Write several texts, with terminal commands made visible."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def guard_terminals() -> None:
    """Make standard output and standard error write harmless text if they are terminals."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        guarded = stream is None or isinstance(stream, TerminalText)
        if not guarded and stream.isatty():
            setattr(sys, name, TerminalText(stream))
