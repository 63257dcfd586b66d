"""Simulated flights with turns in place, or along lines with a whip, as records and on disk."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import made
import numpy as np

from uavrt.config.settings import Settings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, PulsePose, Tag
from uavrt.localization.antenna import MONOPOLE, PATTERNS

PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
START_NS = 1_700_000_000_123_456_789
POSE_S = 0.25


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
    way = _lines(rng) if whip else _turns(rng, turns or int(rng.integers(2, 5)))
    listed = tuple(
        made.tag(2 + number, 148.6e6 + 25e3 * number, float(rng.uniform(0.9, 1.6)))
        for number in range(tags)
    )
    places = tuple((float(e), float(n)) for e, n in rng.uniform(-250.0, 250.0, (tags, 2)))
    times = np.arange(0.0, way[-1, 0], POSE_S) + rng.uniform(0.0, 0.01)
    poses = [_pose(way, time) for time in times]
    lost = rng.uniform(0.0, way[-1, 0]) if seed % 4 == 3 else math.inf
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


def _at(way: np.ndarray, time_s: float) -> tuple[float, float, float]:
    east, north, yaw = (float(np.interp(time_s, way[:, 0], way[:, n])) for n in (1, 2, 3))
    return east, north, yaw


def _pose(way: np.ndarray, time_s: float) -> Pose:
    east, north, yaw = _at(way, time_s)
    latitude, longitude = PLANE.to_geodetic(east, north)
    return made.pose(START_NS + round(time_s * 1e9), latitude, longitude, yaw_deg=yaw)


def _pulses(
    rng: np.random.Generator,
    way: np.ndarray,
    tag: Tag,
    place: tuple[float, float],
    antenna: str,
) -> list[PulsePose]:
    found = []
    for time in np.arange(rng.uniform(0.2, 1.2), way[-1, 0], tag.pulse_intervals_s[0]):
        time_s = float(time)
        east, north, yaw = _at(way, time_s)
        ground = math.hypot(place[0] - east, place[1] - north)
        towards = math.degrees(math.atan2(place[0] - east, place[1] - north))
        slant = math.hypot(ground, 40.0)
        snr_db = 34.0 - 25.0 * math.log10(slant / 100.0) + float(rng.normal(0.0, 1.5))
        if antenna == MONOPOLE:
            snr_db += 20.0 * math.log10(max(ground / slant, 0.05))
        else:
            snr_db += float(PATTERNS[antenna].gain_db([towards - yaw])[0])
        if snr_db < 10.0 or rng.uniform() < 0.03:
            continue
        pose = _pose(way, time_s + 0.01)
        pulse = made.pulse(
            START_NS + round(time_s * 1e9),
            tag_id=tag.tag_id,
            frequency_hz=tag.frequency_hz + 10.0,
            snr_db=snr_db,
            noise_psd=float(1e-10 * 10.0 ** rng.normal(0.0, 0.03)),
        )
        found.append(PulsePose(pulse=pulse, pose=pose))
    return found
