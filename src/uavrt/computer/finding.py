"""Result of a check; without imports, so that a ground station on any computer has it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One line of a check."""

    what: str
    ok: bool
    text: str
    remedy: str = ""
    open: bool = False
    """Whether it cannot be judged yet; then it does not count as a fault."""


def passed(what: str, text: str) -> Finding:
    """Make the line of something that is as it should be."""
    return Finding(what=what, ok=True, text=text)


def failed(what: str, text: str, remedy: str) -> Finding:
    """Make the line of a fault."""
    return Finding(what=what, ok=False, text=text, remedy=remedy)


def judged(what: str, ok: bool, text: str, remedy: str) -> Finding:
    """Make the line of a value; the remedy is shown for a fault only."""
    return passed(what, text) if ok else failed(what, text, remedy)
