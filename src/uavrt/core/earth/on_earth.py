"""Check latitudes and longitudes read from logs; errors name a likely cause."""

import math

from uavrt.core.earth.attitude import Quaternion, normalised

_SCALED = 1e5
"""Absolute value above which a latitude or longitude is probably in 10⁻⁷ degrees."""


class OffEarthError(ValueError):
    """A value that is not a latitude or longitude; `remedy` gives a likely cause."""

    def __init__(self, message: str, *, remedy: str) -> None:
        super().__init__(message)
        self.remedy = remedy


def latitude_on_earth(value_deg: float) -> float:
    """Check a latitude [°]; raises `OffEarthError` beyond ±90° or if not finite."""
    if not abs(value_deg) <= 90.0:
        raise OffEarthError(f"{value_deg:.12g} is not a latitude", remedy=_remedy(value_deg))
    return value_deg


def longitude_on_earth(value_deg: float) -> float:
    """Wrap a longitude to ±180°; raises `OffEarthError` beyond ±360° or if not finite."""
    if not abs(value_deg) <= 360.0:
        raise OffEarthError(f"{value_deg:.12g} is not a longitude", remedy=_remedy(value_deg))
    return value_deg if -180.0 <= value_deg < 180.0 else math.remainder(value_deg, 360.0)


def place_on_earth(latitude_deg: float, longitude_deg: float) -> tuple[float, float] | None:
    """Check latitude and longitude [°]; None if unknown; raises `OffEarthError` if invalid."""
    if not (math.isfinite(latitude_deg) and math.isfinite(longitude_deg)):
        return None
    return latitude_on_earth(latitude_deg), longitude_on_earth(longitude_deg)


def is_attitude(quaternion_wxyz: Quaternion) -> bool:
    """True if a quaternion is an attitude: finite and not zero."""
    try:
        normalised(quaternion_wxyz)
    except ValueError:
        return False
    return True


def _remedy(value_deg: float) -> str:
    if abs(value_deg) >= _SCALED:
        return "Degrees belong there, not degrees times ten million (1e7)"
    return "Check whether latitude and longitude are swapped"
