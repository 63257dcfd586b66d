"""Number and noun in sentences."""


def counted(number: int, one: str, several: str | None = None) -> str:
    """Format a number with its noun: ``1 flight``, ``3 flights``, ``2 batteries``."""
    return f"{number} {one if number == 1 else several or one + 's'}"
