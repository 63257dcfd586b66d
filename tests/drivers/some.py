"""What must be there: `some(x)` is x and not None, `typed(Kind, x)` is x and of that kind."""

from typing import TypeVar

Found = TypeVar("Found")


def some(found: Found | None) -> Found:
    """Return what was found."""
    assert found is not None, "nothing was found"
    return found


def typed(kind: type[Found], found: object) -> Found:
    """Return what was found; fail the test where it is of another kind."""
    assert isinstance(found, kind), found
    return found
