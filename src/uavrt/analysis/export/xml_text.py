"""Make user-entered text safe for XML."""


def printable(text: str | None) -> str:
    """Remove control characters, which XML 1.0 does not allow."""
    return "".join(c for c in text or "" if c >= " " or c in "\t\n")
