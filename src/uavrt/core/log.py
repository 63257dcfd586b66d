"""Write events with keys as log lines on stderr, one JSON object per line.

The supervisor collects the lines of all its processes. On a terminal, the lines are plain text.
Level info is for events that matter to an operator; warnings and errors are also sent to the
ground station as status texts.

No logging library is used: structlog took 9 MB and 0.09 s in each process, for what
`json.dumps` does in one line.
"""

import json
import logging
import select
import sys
import traceback
from dataclasses import dataclass, field
from typing import Any, TextIO

from uavrt.core.clock import iso_utc, wall_ns

_NAMES = {
    logging.DEBUG: "debug",
    logging.INFO: "info",
    logging.WARNING: "warning",
    logging.ERROR: "error",
    logging.CRITICAL: "critical",
}
WRITE_TIMEOUT_MS = 20.0
_COLOURS = {"debug": "2", "info": "32", "warning": "33", "error": "31", "critical": "1;31"}


@dataclass(slots=True)
class _Sink:
    """Destination of this process's log lines."""

    process: str = ""
    level: int = logging.INFO
    stream: TextIO | None = None
    """Stream to which log lines are written; None: stderr at the time of writing."""
    broken: int = field(default=0)
    """Number of log lines lost since the last written line, because stderr was closed or
    blocked."""


_sink = _Sink()


class Logger:
    """Writes log events: ``log.info("samples lost", count=3)``."""

    def debug(self, event: str, **facts: Any) -> None:
        """Log a detail for developers."""
        self.log(logging.DEBUG, event, **facts)

    def info(self, event: str, **facts: Any) -> None:
        """Log an event that matters to an operator."""
        self.log(logging.INFO, event, **facts)

    def warning(self, event: str, **facts: Any) -> None:
        """Log an event that the operator should react to."""
        self.log(logging.WARNING, event, **facts)

    def seldom(self, count: int, event: str, **facts: Any) -> None:
        """Log only the 1st, 2nd, 4th, 8th … of equal events; `count`: their number so far."""
        if count.bit_count() == 1:
            self.log(logging.WARNING, event, times=count, **facts)

    def error(self, event: str, **facts: Any) -> None:
        """Log a failure."""
        self.log(logging.ERROR, event, **facts)

    def exception(self, event: str, **facts: Any) -> None:
        """Log an error together with the exception that is being handled."""
        self.log(logging.ERROR, event, exception=traceback.format_exc(), **facts)

    def log(self, level: int, event: str, **facts: Any) -> None:
        """Log at a level of the standard library's `logging`."""
        if level < _sink.level:
            return
        stream = _sink.stream or sys.stderr
        name = _NAMES.get(level, str(level))
        if not _takes_more(stream):
            _sink.broken += 1
            return
        try:
            write = _text if stream.isatty() else _json
            if _sink.broken:
                stream.write(write("warning", "lines left out", {"count": _sink.broken}) + "\n")
                _sink.broken = 0
            stream.write(write(name, event, facts) + "\n")
            stream.flush()
        except (OSError, ValueError):
            _sink.broken += 1


def _takes_more(stream: TextIO) -> bool:
    """True if a line can be written to the stream without blocking.

    A stopped terminal (Ctrl-S) or a pipe that is not read would otherwise block the supervisor,
    and with it every process.
    """
    try:
        poll = select.poll()
        poll.register(stream.fileno(), select.POLLOUT)
        return bool(poll.poll(WRITE_TIMEOUT_MS))
    except (OSError, ValueError, AttributeError):  # no file; on Windows there is no poll
        return True


def _json(level: str, event: str, facts: dict[str, Any]) -> str:
    return json.dumps(
        {
            "process": _sink.process,
            **facts,
            "event": event,
            "level": level,
            "timestamp": iso_utc(wall_ns()),
        },
        default=repr,
        ensure_ascii=False,
    )


def in_words(event: str, facts: dict[str, Any]) -> str:
    """Format an event and its values as plain text: ``3 samples lost (in all 7)``."""
    others = dict(facts)
    count = others.pop("count", None)
    text = event if count is None else f"{count} {event}"
    details = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in others.items())
    return f"{text} ({details})" if details else text


def _text(level: str, event: str, facts: dict[str, Any]) -> str:
    return (
        f"\x1b[2m{iso_utc(wall_ns())}\x1b[0m \x1b[{_COLOURS.get(level, '0')}m{level:<8}\x1b[0m "
        f"{_sink.process}: {in_words(event, facts)}"
    )


_logger = Logger()


def configure_logging(
    process: str, *, level: int = logging.INFO, stream: TextIO | None = None
) -> None:
    """Write this process's log events to stderr, each with the name of the process."""
    _sink.process, _sink.level, _sink.stream, _sink.broken = process, level, stream, 0


def get_logger() -> Logger:
    """The logger of this process."""
    return _logger
