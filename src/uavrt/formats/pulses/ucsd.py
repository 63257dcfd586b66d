"""Read CSV files of UCSD's Radio Telemetry Tracker, with one ping or one estimate per row.

Timestamps are seconds since 1970, or ISO 8601. The amplitude is in decibels over an unknown
reference; only differences of amplitude have a meaning, and they equal differences of SNR. A
target is identified by its frequency, and targets are numbered 1, 2 … in order of frequency.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass

from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.earth.geodesy import geodetic_of_epsg
from uavrt.core.messages import Pose, PulsePose
from uavrt.formats.pulses.pulse_log import PulseLog, ungrouped_pulse
from uavrt.formats.text import any_time_ns, finite, number_or_nan, parsed_rows, whole

PING_COLUMNS = (
    *("run", "timestamp", "frequency", "amplitude", "easting", "northing", "altitude"),
    *("heading", "epsg code"),
)
ESTIMATE_COLUMNS = ("run", "timestamp", "frequency", "easting", "northing", "epsg code")
SAME_TARGET_HZ = 500.0
"""Maximum difference between frequencies of one target [Hz]; crystals drift by less."""
_REMEDY = "A ping CSV has the columns Run, Timestamp, Frequency, Amplitude, Easting, …"


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetEstimate:
    """Position of a target as estimated by UCSD's tracker."""

    frequency_hz: float
    time_ns: int
    latitude_deg: float
    longitude_deg: float


def read_ucsd_pings(path: str | os.PathLike[str]) -> PulseLog:
    """Read a ping CSV; raises `FormatError` with the number of a bad row."""
    pings = parsed_rows(path, PING_COLUMNS, _ping, _REMEDY)
    tags = tag_numbers([frequency for frequency, _, _, _ in pings])
    found = tuple(
        PulsePose(pulse=ungrouped_pulse(tag_id, frequency, time_ns, time_ns, level), pose=pose)
        for tag_id, (frequency, time_ns, level, pose) in zip(tags, pings, strict=True)
    )
    warning = (
        "Amplitudes are levels over an unknown reference, not SNR; only their differences mean "
        "something. Tags are numbered by frequency."
    )
    return PulseLog(kind="ucsd", pulse_poses=found, warnings=(warning,) if found else ())


def read_ucsd_estimates(path: str | os.PathLike[str]) -> tuple[TargetEstimate, ...]:
    """Read an estimate CSV; raises `FormatError` with the number of a bad row."""
    return tuple(parsed_rows(path, ESTIMATE_COLUMNS, _estimate, _REMEDY))


def tag_numbers(frequencies_hz: Sequence[float], same_hz: float = SAME_TARGET_HZ) -> list[int]:
    """Number tags from 1 by frequency; a step of more than `same_hz` begins another tag."""
    numbers = [0] * len(frequencies_hz)
    number, last = 0, -math.inf
    for index in sorted(range(len(numbers)), key=lambda i: frequencies_hz[i]):
        if frequencies_hz[index] - last > same_hz:
            number += 1
        numbers[index], last = number, frequencies_hz[index]
    return numbers


def _ping(cells: Sequence[str]) -> tuple[float, int, float, Pose]:
    time_ns = any_time_ns(cells[1])
    lat, lon = geodetic_of_epsg(whole(cells[8]), finite(cells[4]), finite(cells[5]))
    pose = Pose(
        time_ns=time_ns,
        latitude_deg=lat,
        longitude_deg=lon,
        altitude_amsl_m=number_or_nan(cells[6]),
        altitude_relative_m=math.nan,
        # A whip needs no heading.
        quaternion_wxyz=from_euler_deg(_zero_if_empty(cells[7]), 0.0, 0.0),
    )
    return finite(cells[2]), time_ns, number_or_nan(cells[3]), pose


def _zero_if_empty(cell: str) -> float:
    value = number_or_nan(cell)
    return 0.0 if math.isnan(value) else value


def _estimate(cells: Sequence[str]) -> TargetEstimate:
    lat, lon = geodetic_of_epsg(whole(cells[5]), finite(cells[3]), finite(cells[4]))
    return TargetEstimate(
        frequency_hz=finite(cells[2]),
        time_ns=any_time_ns(cells[1]),
        latitude_deg=lat,
        longitude_deg=lon,
    )
