"""What must be there: `some(x)` is x, and fails the test where it is None."""

from typing import TypeVar

Found = TypeVar("Found")


def some(found: Found | None) -> Found:
    """Return what was found."""
    assert found is not None, "nothing was found"
    return found
