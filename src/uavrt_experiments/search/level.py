"""Convert signal strengths given by others to ours."""

from math import log10

from uavrt.localization.position.level_belief import REFERENCE_M


def at_100_m(level_1m_db: float, exponent: float) -> float:
    """Level at 100 m of a tag whose level at 1 m is known.

    Parameters
    ----------
    level_1m_db : float
        In any unit of level.
    exponent : float
        Of the path loss.
    """
    return level_1m_db - 10.0 * exponent * log10(REFERENCE_M)
