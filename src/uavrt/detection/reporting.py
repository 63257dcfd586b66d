"""Interval of a detector's reports about what it has searched without success."""

CODES_PER_REPORT_S = 20
"""Reports per second for all codes of a channel together [1/s]."""


def report_every_s(codes: int) -> float:
    """Time between two reports of a coded tag.

    Parameters
    ----------
    codes : int
        Coded tags on the channel.
    """
    return max(1.0, codes / CODES_PER_REPORT_S)
