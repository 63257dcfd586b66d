"""Read the settings and the antenna with which a flight was flown."""

from dataclasses import replace

import msgspec

from uavrt.config.settings import AntennaSettings, Settings
from uavrt.core.earth.on_earth import is_attitude
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Pose
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.antenna import MONOPOLE, PATTERNS
from uavrt.localization.pose.mounting import Mounting

USUAL_ANTENNA = "RA-23K"
"""Antenna assumed for flights that record none; the system's first drone carried it."""


def flight_settings(flight: Flight) -> Settings | None:
    """Settings recorded in a flight; None if absent. Raises `FormatError` if damaged."""
    if flight.settings_json is None:
        return None
    try:
        return _settings_in(flight.settings_json)
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise FormatError(
            f"the settings of {flight.info.directory} cannot be read: {error}",
            remedy="Give the flight's pulse_pose_log.txt instead, which has the pulses",
        ) from error


def _settings_in(text: str) -> Settings:
    try:
        return msgspec.json.decode(text, type=Settings)
    except msgspec.ValidationError:
        # Written by another version: the antenna is what matters here.
        tables = msgspec.json.decode(text)
        known = AntennaSettings.__dataclass_fields__
        mounted = {k: v for k, v in tables.get("antenna", {}).items() if k in known}
        settings = replace(Settings(), antenna=msgspec.convert(mounted, AntennaSettings))
        named = tables.get("bearings", {}).get("antenna")
        if isinstance(named, str):
            settings = replace(settings, bearings=replace(settings.bearings, antenna=named))
    return settings


def antenna_poses(flight: Flight) -> list[Pose]:
    """Convert the vehicle's poses to the antenna's, by its mounting in the settings."""
    mounting = Mounting.from_settings((flight_settings(flight) or Settings()).antenna)
    posed = [one for one in flight.poses if is_attitude(one.quaternion_wxyz)]
    if flight.poses and not posed:
        raise FormatError(
            f"{flight.info.directory} has no pose with an attitude, so the antenna's "
            "direction is unknown",
            remedy="Attach poses from an autopilot's log with uavrt attach",
        )
    return [mounting.antenna_pose(one) for one in posed]


def antenna_is_recorded(flight: Flight) -> bool:
    """True if the antenna is recorded in the flight, False if one must be assumed."""
    return flight.settings_json is not None


def flight_antenna(flight: Flight) -> str:
    """Name of the antenna pattern in a flight's settings, RA-23K without settings. Raises
    `UsageError` if unknown.
    """
    settings = flight_settings(flight)
    named = USUAL_ANTENNA if settings is None else settings.bearings.antenna
    if named != MONOPOLE and named not in PATTERNS:
        raise UsageError(
            f"the drone was set up with the antenna {named!r}, which uavrt does not know",
            remedy="Choose the antenna with --antenna: a CSV file of angles and gains, "
            f"{MONOPOLE}, or one of {', '.join(PATTERNS)}",
        )
    return named
