"""Convert units: uavrt uses hertz, seconds, metres, degrees and nanoseconds UTC.

Other units occur only in files, in protocols and on the screen; they are converted here.
"""

import math
import re
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

SIGMF_FULL_SCALE = "uavrt:full_scale"
"""Key in SigMF metadata for the physical value of a full-scale sample."""
NANOSECONDS_PER_SECOND = 1_000_000_000
SPEED_OF_LIGHT_M_S = 299_792_458.0


def db_from_power(ratio: float) -> float:
    """Convert a power ratio to decibels; a ratio of zero gives minus infinity."""
    return 10.0 * math.log10(ratio) if ratio > 0.0 else -math.inf


def power_from_db(level_db: float) -> float:
    """Convert decibels to a power ratio."""
    return float(10.0 ** (level_db / 10.0))


def ns_from_s(seconds: float) -> int:
    """Convert seconds to whole nanoseconds, rounded."""
    return round(seconds * NANOSECONDS_PER_SECOND)


def s_from_ns(nanoseconds: int) -> float:
    """Convert nanoseconds to seconds; for differences, since absolute times lose precision."""
    return nanoseconds / NANOSECONDS_PER_SECOND


def number_in(text: str) -> float:
    """Read a plain decimal number as a person types it; NaN for any other text.

    >>> number_in(" -148.705 "), number_in("1_5"), number_in("inf")
    (-148.705, nan, nan)
    """
    plain = re.fullmatch(r"[+-]?[0-9]{0,20}[.]?[0-9]{0,20}([eE][+-]?[0-9]{1,2})?", text.strip())
    try:
        return float(text) if plain is not None else math.nan
    except ValueError:
        return math.nan


def rough_duration(seconds: float) -> str:
    """Format the absolute value of a duration [s] for people: "40 s", "12 min", "3 days"."""
    length_s = abs(seconds)
    for unit, unit_s, most in (("s", 1.0, 120.0), ("min", 60.0, 120.0), ("h", 3600.0, 48.0)):
        if length_s < most * unit_s:
            return f"{length_s / unit_s:.0f} {unit}"
    return f"{length_s / 86400.0:.0f} days"


def s_from_ms(milliseconds: float) -> float:
    """Convert milliseconds to seconds."""
    return milliseconds / 1000.0


def hz_from_mhz(megahertz: float) -> float:
    """Convert megahertz to hertz, exact to 1 mHz (148.71 gives 148710000.0)."""
    return round(megahertz * 1e9) / 1e3


def mhz_from_hz(hertz: float) -> float:
    """Convert hertz to megahertz."""
    return hertz / 1e6


@overload
def wrap_degrees_360(angle_deg: float) -> float: ...
@overload
def wrap_degrees_360(angle_deg: "NDArray[np.float64]") -> "NDArray[np.float64]": ...
def wrap_degrees_360(angle_deg: Any) -> Any:
    """Wrap an angle [°], or each of an array, to [0, 360)."""
    wrapped = angle_deg % 360.0
    return wrapped * (wrapped < 360.0)  # a hair below 0 is rounded to 360


@overload
def wrap_degrees_180(angle_deg: float) -> float: ...
@overload
def wrap_degrees_180(angle_deg: "NDArray[np.float64]") -> "NDArray[np.float64]": ...
def wrap_degrees_180(angle_deg: Any) -> Any:
    """Wrap an angle [°], or each of an array, to [-180, 180)."""
    return wrap_degrees_360(angle_deg + 180.0) - 180.0


def counted(number: int, one: str, several: str | None = None) -> str:
    """Format a number with its noun: ``1 flight``, ``3 flights``, ``2 batteries``."""
    return f"{number} {one if number == 1 else several or one + 's'}"
