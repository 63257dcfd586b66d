"""Simulated flights with turns in place, or along lines with a whip, as records and on disk."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import made
import numpy as np

from uavrt.config.settings import Settings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, PulsePose, Tag
from uavrt.localization.antenna import MONOPOLE, PATTERNS

PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
START_NS = 1_700_000_000_123_456_789
POSE_S = 0.25


@dataclass(frozen=True, slots=True)
class Way:
    """Where a drone is and where it looks, evenly from corner to corner."""

    corners: np.ndarray
    """(n, 4) time [s], east, north [m] and heading [°]."""
    plane: TangentPlane = field(default=PLANE, kw_only=True)
    start_ns: int = field(default=START_NS, kw_only=True)

    @property
    def end_s(self) -> float:
        """Time of the last corner [s]."""
        return float(self.corners[-1, 0])

    def at(self, time_s: float) -> tuple[float, float, float]:
        """East, north and heading at a time."""
        east, north, yaw = (
            float(np.interp(time_s, self.corners[:, 0], self.corners[:, n])) for n in (1, 2, 3)
        )
        return east, north, yaw

    def pose(self, time_s: float, *, offset_deg: float = 0.0, **fields: Any) -> Pose:
        """Make the pose at a time, with an antenna this far to the right."""
        east, north, yaw = self.at(time_s)
        latitude, longitude = self.plane.to_geodetic(east, north)
        time_ns = self.start_ns + round(time_s * 1e9)
        return made.pose(time_ns, latitude, longitude, yaw_deg=yaw + offset_deg, **fields)

    def poses(self, step_s: float = POSE_S, **fields: Any) -> list[Pose]:
        """Make the poses of the whole way."""
        return [self.pose(float(time), **fields) for time in np.arange(0.0, self.end_s, step_s)]

    def seen(self, time_s: float, place_m: tuple[float, float]) -> tuple[float, float]:
        """Angle from the heading to a place [°], and the distance to it [m]."""
        east, north, yaw = self.at(time_s)
        away = (place_m[0] - east, place_m[1] - north)
        return math.degrees(math.atan2(*away)) - yaw, math.hypot(*away)

    def pulse(self, time_s: float, snr_db: float, pose: Pose, **fields: Any) -> PulsePose:
        """Make a pulse that was received with a pose."""
        time_ns = self.start_ns + round(time_s * 1e9)
        return PulsePose(pulse=made.pulse(time_ns, snr_db=float(snr_db), **fields), pose=pose)


def turns(
    stations: Sequence[tuple[float, float]],
    *,
    wait_s: float = 0.0,
    turn_s: float = 60.0,
    way_s: float = 40.0,
    rest_s: float = 5.0,
    yaw_deg: float = 10.0,
    **where: Any,
) -> Way:
    """Make a way with a turn of 360° at each station; the drone waits at the first."""
    rows = [(0.0, *stations[0], yaw_deg)]
    for number, station in enumerate(stations):
        for took_s, turned in (
            (way_s if number else wait_s, 0.0),
            (turn_s, 360.0),
            (rest_s, 0.0),
        ):
            rows.append((rows[-1][0] + took_s, *station, rows[-1][3] + turned))
    return Way(np.array(rows), **where)


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnedFlight:
    """What a simulated drone recorded."""

    antenna: str
    tags: tuple[Tag, ...]
    places_m: tuple[tuple[float, float], ...]
    """Of the tags, east and north of `PLANE`."""
    poses: tuple[Pose, ...]
    pulse_poses: tuple[PulsePose, ...]

    def recorded(self, directory: Path) -> Path:
        """Record it as the drone does."""
        first_ns = min(pose.time_ns for pose in self.poses)
        info = made.flight_info(directory, self.tags, start_time_ns=first_ns)
        usual = Settings()
        settings = replace(usual, bearings=replace(usual.bearings, antenna=self.antenna))
        return made.flight(info, settings, poses=self.poses, pulse_poses=self.pulse_poses)


def turned_flight(seed: int, *, tags: int = 1, turns: int | None = None) -> TurnedFlight:
    """Simulate a flight; every sixth is a survey by strength with a whip.

    Antenna, places, speed of the turns, fading, misses and lost telemetry are drawn.
    """
    rng = np.random.default_rng([19, seed])
    whip = seed % 6 == 5
    antenna = MONOPOLE if whip else ("RA-23K", "RA-2A", "H3")[seed % 3]
    way = Way(_lines(rng) if whip else _turns(rng, turns or int(rng.integers(2, 5))))
    listed = tuple(
        made.tag(2 + number, 148.6e6 + 25e3 * number, float(rng.uniform(0.9, 1.6)))
        for number in range(tags)
    )
    places = tuple((float(e), float(n)) for e, n in rng.uniform(-250.0, 250.0, (tags, 2)))
    times = np.arange(0.0, way.end_s, POSE_S) + rng.uniform(0.0, 0.01)
    poses = [way.pose(time) for time in times]
    lost = rng.uniform(0.0, way.end_s) if seed % 4 == 3 else math.inf
    pulses = [
        one
        for tag, place in zip(listed, places, strict=True)
        for one in _pulses(rng, way, tag, place, antenna)
    ]
    return TurnedFlight(
        antenna=antenna,
        tags=listed,
        places_m=places,
        poses=tuple(
            pose
            for pose in poses
            if not lost <= (pose.time_ns - START_NS) * 1e-9 <= lost + 12.0
        ),
        pulse_poses=tuple(sorted(pulses, key=lambda one: one.pulse.start_time_ns)),
    )


def _turns(rng: np.random.Generator, count: int) -> np.ndarray:
    """(n, 4) time, east, north and heading at the corners of a way with turns in place."""
    rows = [(0.0, 0.0, 0.0, float(rng.uniform(0.0, 360.0)))]
    for _ in range(count):
        east, north = rng.uniform(-200.0, 200.0, 2)
        turn_s = rng.uniform(35.0, 60.0)
        turned = rng.choice([-1.0, 1.0]) * rng.uniform(340.0, 380.0)
        time_s, _, _, yaw = rows[-1]
        rows.append((time_s + 30.0, east, north, yaw))
        rows.append((time_s + 30.0 + turn_s, east, north, yaw + turned))
        rows.append((time_s + 34.0 + turn_s, east, north, yaw + turned))
    return np.array(rows)


def _lines(rng: np.random.Generator) -> np.ndarray:
    rows, time_s = [], 0.0
    for line in range(5):
        for north in (-200.0, 200.0)[:: 1 if line % 2 == 0 else -1]:
            rows.append(
                (time_s, -200.0 + 100.0 * line + float(rng.normal(0.0, 5.0)), north, 0.0)
            )
            time_s += 40.0 if len(rows) % 2 else 12.0
    return np.array(rows)


def _pulses(
    rng: np.random.Generator,
    way: Way,
    tag: Tag,
    place: tuple[float, float],
    antenna: str,
) -> list[PulsePose]:
    found = []
    for time in np.arange(rng.uniform(0.2, 1.2), way.end_s, tag.pulse_intervals_s[0]):
        time_s = float(time)
        off_deg, ground = way.seen(time_s, place)
        slant = math.hypot(ground, 40.0)
        snr_db = 34.0 - 25.0 * math.log10(slant / 100.0) + float(rng.normal(0.0, 1.5))
        if antenna == MONOPOLE:
            snr_db += 20.0 * math.log10(max(ground / slant, 0.05))
        else:
            snr_db += float(PATTERNS[antenna].gain_db(off_deg))
        if snr_db < 10.0 or rng.uniform() < 0.03:
            continue
        found.append(
            way.pulse(
                time_s,
                snr_db,
                way.pose(time_s + 0.01),
                tag_id=tag.tag_id,
                frequency_hz=tag.frequency_hz + 10.0,
                noise_psd=float(1e-10 * 10.0 ** rng.normal(0.0, 0.03)),
            )
        )
    return found
