"""Convert published signal strengths to levels at 100 m."""

from math import log10

from uavrt.localization.position.tuning import POWER


def at_100_m(level_1m_db: float, exponent: float) -> float:
    """Level at 100 m of a tag whose level at 1 m is known.

    `level_1m_db`: level at 1 m, in any logarithmic unit.
    `exponent`: path loss exponent.
    """
    return level_1m_db - 10.0 * exponent * log10(POWER.reference_m)
