"""Texts that people typed, as XML can hold them."""


def printable(text: str | None) -> str:
    """Leave out control characters, for which XML 1.0 has no word."""
    return "".join(c for c in text or "" if c >= " " or c in "\t\n")
