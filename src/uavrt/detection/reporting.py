"""How often a detector says how far it has searched, where it has found nothing."""

CODES_PER_REPORT_S = 20
"""Reports in a second: those of many codes come more seldom, all of a channel together."""


def report_every_s(codes: int) -> float:
    """Time between two reports of a coded tag.

    Parameters
    ----------
    codes : int
        Coded tags on the channel.
    """
    return max(1.0, codes / CODES_PER_REPORT_S)
