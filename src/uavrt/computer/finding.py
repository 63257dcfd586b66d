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
