"""Compute magnetic declination for NMEA's compass headings (HDG, HDM), by the World Magnetic
Model of the package pygeomag (2010 to 2029); PX4 and ArduPilot log true headings.
"""

from datetime import UTC, datetime
from functools import lru_cache

from uavrt.core.errors import FormatError, needs_extra

_DAY_NS = 86_400_000_000_000


def declination_deg(
    latitude_deg: float, longitude_deg: float, altitude_amsl_m: float, time_ns: int
) -> float:
    """Angle from true to magnetic north [deg], positive to the east, accurate to some 0.01°.

    Declination changes by 0.01° over a kilometre or a month. So positions are rounded to 0.01°,
    heights to a kilometre and times to a day.
    """
    return _declination_deg(
        round(latitude_deg, 2),
        round(longitude_deg, 2),
        round(altitude_amsl_m / 1000.0),
        time_ns // _DAY_NS,
    )


@lru_cache(maxsize=1000)
def _declination_deg(
    latitude_deg: float, longitude_deg: float, altitude_km: int, day: int
) -> float:
    with needs_extra("analysis", "a magnetic heading"):
        from pygeomag import GeoMag
    date = datetime.fromtimestamp(day * 86_400, tz=UTC)
    length_days = (date.replace(year=date.year + 1, month=1, day=1) - _new_year(date)).days
    year = date.year + (date - _new_year(date)).days / length_days
    try:
        model = GeoMag(base_year=date.replace(tzinfo=None))
        found = model.calculate(
            glat=latitude_deg, glon=longitude_deg, alt=altitude_km, time=year
        )
    except ValueError as error:
        raise FormatError(
            f"no magnetic model for {date:%Y-%m-%d}: {error}",
            remedy="Give a track with true headings (HDT), or with the variation in HDG",
        ) from error
    return float(found.d)


def _new_year(date: datetime) -> datetime:
    return date.replace(month=1, day=1)
