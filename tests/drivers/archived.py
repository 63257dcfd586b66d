"""Recordings and flights of an archive, small enough for tests."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import made
import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.archive.steps.flight_work import FlightTask, PlacingSettings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, Tag
from uavrt.localization.antenna import PATTERNS

RATE_HZ, CENTER_HZ = 24_000.0, 148.7e6
START_NS = 1_777_615_200_000_000_000
START = "2026-05-01T06:00:00Z"
COLUMNS = "path,format,sample_rate_hz,center_frequency_hz,start_time"
TAG_LINE = "2, 148706000, 1210, 20, 20, 10, 3, 0.02\n"
"""The first of `TAGS` in a text file."""
TAGS = tuple(
    made.tag(2 * number, CENTER_HZ + offset_hz, interval_s, interval_uncertainty_s=0.02)
    for number, (offset_hz, interval_s) in enumerate(((6e3, 1.21), (-5e3, 1.34)), 1)
)
_PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
_LEG_S, _APART_M, _TAG_M = 45.0, 250.0, (180.0, 420.0)
_GAIN_DB = PATTERNS["RA-23K"].e_plane_db
_Floats = NDArray[np.float64]


def flight_task(place: Path, *steps: str, tags: tuple[Tag, ...] = ()) -> FlightTask:
    """Make a batch's work on a flight, without recordings that were searched."""
    return FlightTask(
        path=str(place),
        flight=place.name,
        key="",
        is_flight=True,
        searched=(),
        tags=tags,
        track=None,
        clock_offset_s=None,
        vehicle=None,
        steps=steps,
        settings=PlacingSettings(),
    )


def record(
    path: Path,
    length_s: float,
    seed: int,
    *,
    tags: Sequence[Tag] = TAGS,
    amplitude: Callable[[_Floats], _Floats] = lambda times_s: np.full(len(times_s), 6e-4),
) -> None:
    """Tags of 17 dB in noise, unless told otherwise."""
    times_s = np.arange(round(length_s * RATE_HZ)) / RATE_HZ
    noise = np.random.default_rng(seed).standard_normal(2 * len(times_s), np.float32)
    samples = (np.float32(1e-3) * noise).view(np.complex64)
    for tag in tags:
        beeps = np.flatnonzero(times_s % tag.pulse_intervals_s[0] < tag.pulse_width_s)
        turns = (tag.frequency_hz - CENTER_HZ) * times_s[beeps]
        tone = amplitude(times_s[beeps]) * np.exp(2j * np.pi * turns)
        samples[beeps] += tone.astype(np.complex64)
    samples.tofile(path)


def vehicle_pose(at_s: float) -> Pose:
    """A turn on the spot at each of two places, 8° a second."""
    station = min(1, int(at_s // _LEG_S))
    latitude, longitude = _PLANE.to_geodetic(_APART_M * station, 0.0)
    return made.pose(
        START_NS + round(1e9 * at_s), latitude, longitude, yaw_deg=8.0 * at_s % 360.0
    )


def heard_amplitude(times_s: _Floats) -> _Floats:
    """What the antenna hears of a tag while the vehicle turns."""
    found = []
    for at_s in times_s:
        east_m = _APART_M * min(1, int(at_s // _LEG_S))
        bearing_deg = math.degrees(math.atan2(_TAG_M[0] - east_m, _TAG_M[1]))
        off_deg = abs((8.0 * at_s - bearing_deg + 180.0) % 360.0 - 180.0)
        gain_db = np.interp(off_deg, np.linspace(0.0, 180.0, len(_GAIN_DB)), _GAIN_DB)
        found.append(1.5e-3 * 10.0 ** (gain_db / 20.0))
    return np.array(found)


def poses(length_s: float = 2 * _LEG_S) -> tuple[Pose, ...]:
    """The vehicle's, ten a second."""
    return tuple(vehicle_pose(0.1 * number) for number in range(round(10 * length_s)))


def write_flight(directory: Path, *, length_s: float = 2 * _LEG_S) -> Path:
    """Write a flight that turned at two places, without a pulse."""
    made.flight(
        made.flight_info(
            directory,
            TAGS[:1],
            start_time_ns=START_NS,
            center_frequency_hz=CENTER_HZ,
            sample_rate_hz=RATE_HZ,
        ),
        poses=poses(length_s),
    )
    return directory


def manifest(folder: Path, *names: str) -> Path:
    """Write of recordings what a batch must be given, all alike."""
    lines = [COLUMNS, *(f"{name},,{RATE_HZ},{CENTER_HZ},{START}" for name in names)]
    path = folder / "manifest.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def recorded_flight(folder: Path) -> Path:
    """Write a flight that turned at two places with a recording; both with a manifest."""
    flight = write_flight(folder / "flight_a")
    (flight / "iq").mkdir(exist_ok=True)
    record(flight / "iq" / "a.cf32", 90.0, 1, tags=TAGS[:1], amplitude=heard_amplitude)
    manifest(folder, "flight_a/iq/a.cf32")
    return flight
