"""Print lines to a terminal or a pipe without blocking the program.

A stopped terminal (Ctrl-S), a waiting pager or an unread pipe blocks every write. A separate
thread therefore prints.
"""

import contextlib
import os
import queue
import sys
import threading
from typing import TextIO

MOST_WAITING = 100_000
"""Maximum number of printed lines queued: three hours of 10 pulses a second, some 20 MB."""
LAST_S = 1.0
"""Longest wait for queued lines to be printed when the program ends [s]."""


class TerminalLines:
    """Prints lines in order in a separate thread; lines beyond the limit are counted only.

    Printing ends when the reader has closed the pipe.
    """

    def __init__(self, stream: TextIO | None = None, *, most: int = MOST_WAITING) -> None:
        self._stream = sys.stdout if stream is None else stream
        self._lines: queue.Queue[str | None] = queue.Queue(most)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._print, daemon=True)
        self._thread.start()
        self.left_out = 0
        self.gone = False
        """True once the program that reads the printed lines has closed the pipe."""

    def __call__(self, line: str) -> None:
        """Queue a line to be printed."""
        try:
            self._lines.put_nowait(line)
        except queue.Full:
            self.left_out += 1

    def close(self, timeout_s: float = LAST_S) -> bool:
        """Print the queued lines and stop; return True if the thread has ended.

        Otherwise the thread is blocked in a write and holds the stream's lock. The program must
        then end by `os._exit`, since the interpreter's normal exit would wait for that lock.
        """
        self._ending.set()
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(None)  # wakes a thread that has nothing to print
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _print(self) -> None:
        while True:
            lines = [self._lines.get()]
            while not self._lines.empty() and len(lines) < 1000:
                lines.append(self._lines.get_nowait())
            self._write([line for line in lines if line is not None])
            if self._ending.is_set() and self._lines.empty():
                return

    def _write(self, lines: list[str]) -> None:
        if self.gone:
            self.left_out += len(lines)
            return
        try:
            self._stream.write("".join(f"{line}\n" for line in lines))
            self._stream.flush()
        except (OSError, ValueError):  # a broken pipe; a terminal that was closed
            self.gone = True
            self.left_out += len(lines)
            with contextlib.suppress(OSError, ValueError):  # what it still holds goes nowhere
                os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
