"""Read numbers and positions from the fields of a page's request."""

import sys
from math import nan
from typing import Any

from uavrt.core.errors import FormatError, UsageError

Places = tuple[tuple[float, float], ...]


def number_in(body: dict[str, Any], name: str, default: float = nan) -> float:
    """Read a finite number from the field `name`; raises `FormatError` for any other value."""
    value = body.get(name, default)
    number = value if isinstance(value, int | float) else nan
    if isinstance(value, bool) or not abs(number) <= sys.float_info.max:
        raise FormatError(f"{name} must be a number")
    return float(number)


def number_between(
    body: dict[str, Any], name: str, least: float, most: float, default: float = nan
) -> float:
    """Read a number; raises `FormatError` if it is none, `UsageError` if outside the limits."""
    number = number_in(body, name, default)
    if not least <= number <= most:
        raise UsageError(f"{name} must be {least:g} to {most:g}")
    return number


def power_in(body: dict[str, Any]) -> float:
    """Read a tag's power [dBm]; raises `FormatError`, or `UsageError` outside -100 to 40."""
    power_dbm = number_in(body, "tag_power_dbm")
    if not -100.0 <= power_dbm <= 40.0:
        raise UsageError("a tag's power must be -100 to 40 dBm")
    return power_dbm


def whole_in(body: dict[str, Any], name: str) -> int:
    """Read a whole number; raises `FormatError` for any other value."""
    if type(value := body.get(name)) is not int:
        raise FormatError(f"{name} must be a whole number")
    return value


def places_in(given: Any) -> Places:
    """Read a list of [latitude, longitude] in degrees; raises `FormatError` if invalid."""
    places = []
    for one in given if isinstance(given, list) else [None]:
        match one:
            case [int() | float() as north, int() | float() as east]:
                on_earth = abs(north) <= 90.0 and abs(east) <= 180.0
                if on_earth and not isinstance(north, bool) and not isinstance(east, bool):
                    places.append((float(north), float(east)))
                    continue
        raise FormatError("each place must be a latitude and a longitude on earth")
    return tuple(places)


def listed(places: Places) -> list[list[float]]:
    """Return places as the lists that `places_in` reads."""
    return [list(place) for place in places]
