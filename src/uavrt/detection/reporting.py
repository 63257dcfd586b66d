"""Interval between search reports, which record what was searched even without a detection."""

CODES_PER_REPORT_S = 20
"""Maximum number of search reports per second for all codes of a channel together [1/s]."""


def report_every_s(codes: int) -> float:
    """Time between two reports of a coded tag.

    Parameters
    ----------
    codes : int
        Coded tags on the channel.
    """
    return max(1.0, codes / CODES_PER_REPORT_S)
