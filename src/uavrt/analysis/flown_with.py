"""What a drone was set up with in a flight: its settings, and the antenna in them."""

from dataclasses import replace

import msgspec

from uavrt.config.settings import AntennaSettings, Settings
from uavrt.errors import UsageError
from uavrt.localization.antenna import MONOPOLE, PATTERNS
from uavrt.recording.flight_reader import Flight

USUAL_ANTENNA = "RA-23K"
"""Of what does not tell its antenna; the system's first drone had it."""


def flight_settings(flight: Flight) -> Settings | None:
    """The flight's settings, for the antenna's place; None when it did not record them."""
    if flight.settings_json is None:
        return None
    try:
        settings = msgspec.json.decode(flight.settings_json, type=Settings)
    except msgspec.ValidationError:
        # Written by another version: the antenna is what matters here.
        tables = msgspec.json.decode(flight.settings_json)
        known = AntennaSettings.__dataclass_fields__
        mounted = {k: v for k, v in tables.get("antenna", {}).items() if k in known}
        settings = replace(Settings(), antenna=msgspec.convert(mounted, AntennaSettings))
        named = tables.get("bearings", {}).get("antenna")
        if isinstance(named, str):
            settings = replace(settings, bearings=replace(settings.bearings, antenna=named))
    return settings


def antenna_is_told(flight: Flight) -> bool:
    """Whether a flight recorded which antenna the drone was set up with."""
    return flight.settings_json is not None


def flight_antenna(flight: Flight) -> str:
    """Name of the pattern that the drone was set up with; RA-23K where it recorded none.

    Raises `UsageError`: this computer does not know that pattern.
    """
    settings = flight_settings(flight)
    named = USUAL_ANTENNA if settings is None else settings.bearings.antenna
    if named != MONOPOLE and named not in PATTERNS:
        raise UsageError(
            f"the drone was set up with the antenna {named!r}, which is not known here",
            remedy=f"Name one with --antenna: a CSV file of angles and gains, {MONOPOLE}, or "
            f"one of {', '.join(PATTERNS)}",
        )
    return named
