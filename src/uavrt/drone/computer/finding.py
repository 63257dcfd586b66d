"""Result of a check.

This module imports nothing from uavrt, so that any ground station can use it.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Result of one check: passed or failed, with a text and a remedy."""

    what: str
    ok: bool
    text: str
    remedy: str = ""
    open: bool = False
    """True if the item cannot be checked yet; the finding then does not count as a fault."""


def passed(what: str, text: str) -> Finding:
    """Return the result of a passed check."""
    return Finding(what=what, ok=True, text=text)


def failed(what: str, text: str, remedy: str) -> Finding:
    """Return the result of a failed check, with its remedy."""
    return Finding(what=what, ok=False, text=text, remedy=remedy)


def judged(what: str, ok: bool, text: str, remedy: str) -> Finding:
    """Return a check's result: passed if `ok`, else failed with the remedy."""
    return passed(what, text) if ok else failed(what, text, remedy)
