"""The command line run in this process or by itself, and other programs."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from uavrt.cli.app import run


def uavrt(*arguments: str) -> int:
    """Run `uavrt` with arguments; its exit status."""
    before = sys.argv
    sys.argv = ["uavrt", *arguments]
    try:
        run()
    except SystemExit as end:
        return int(end.code or 0)
    finally:
        sys.argv = before
    return 0


class Printed(NamedTuple):
    """What a command printed."""

    out: str
    err: str

    @property
    def json(self) -> Any:
        """Its output, read as JSON."""
        return json.loads(self.out)

    @property
    def words(self) -> str:
        """Both streams without line breaks, which depend on the width of the terminal."""
        return " ".join((self.out + self.err).split())


Ran = Callable[..., Printed]
"""The fixture `ran`: runs `uavrt`, checks the status that it `ends` with; what it printed."""


def program(*words: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; what it printed, as text."""
    usual: dict[str, Any] = {"capture_output": True, "text": True, "check": False}
    return subprocess.run([str(word) for word in words], **(usual | options))


def python(*words: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run this Python to its end; what it printed, as text."""
    return program(sys.executable, *words, **options)


def launched(*words: str | Path, **options: Any) -> subprocess.Popen[str]:
    """Start this Python beside the test; what it prints can be read, as text."""
    usual: dict[str, Any] = {"stdout": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, *map(str, words)], **(usual | options))


def started(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `uavrt` as its own program to its end; what it printed, as text."""
    return python("-m", "uavrt.cli", *arguments, **options)
