"""Progress bars on the error output, if it is a terminal."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Advance(Protocol):
    """Interface of a function that updates the progress of a task."""

    def __call__(self, done: float, total: float | None = None, /) -> None:
        """Set the completed amount of the task, and its total if it is known now."""


class AddBar(Protocol):
    """Interface of a function that adds a progress bar."""

    def __call__(self, what: str, total: float | None = None, /) -> Advance:
        """Add a progress bar named `what`; its total may be set later."""


@contextmanager
def progress_bars() -> Iterator[AddBar]:
    """Show bars that vanish at the end; no bars if the error output is not a terminal."""
    if not sys.stderr.isatty():
        yield lambda _what, _total=None: lambda _done, _total=None: None
        return
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn, TimeRemainingColumn

    columns = (*Progress.get_default_columns()[:3], TimeRemainingColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:

        def add(what: str, total: float | None = None, /) -> Advance:
            task = shown.add_task(what, total=total)

            def advance(done: float, total: float | None = None, /) -> None:
                shown.update(task, completed=done, total=total)

            return advance

        yield add


@contextmanager
def progress_bar(what: str, total: float | None = None) -> Iterator[Advance]:
    """Show one progress bar with a given name; see `progress_bars`."""
    with progress_bars() as add:
        yield add(what, total)
