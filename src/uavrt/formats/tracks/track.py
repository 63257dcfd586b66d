"""Track of a vehicle as another program logged it, with the times of that program's clock."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

from uavrt.core.earth.attitude import from_euler_deg, normalised, slerp
from uavrt.core.earth.geodesy import are_one_place
from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.core.units import NANOSECONDS_PER_SECOND

COURSE = (
    "This track has no attitude: the vehicle is taken as level, with the course over ground "
    "as heading, which stays unchanged below 0.5 m/s. Bearings need a real heading."
)
STANDING = (
    "This track neither moves nor has an attitude, so its poses have no heading: bearings are "
    "impossible, and positions follow from strength alone, as with a monopole."
)
_STEP_NS = NANOSECONDS_PER_SECOND
_LONGEST_GAP_S = 15.0
_LONGEST_STANDING_GAP_S = 86_400.0
_SLOWEST_M_S = 0.5

S = TypeVar("S", AttitudeSample, PositionSample)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleTrack:
    """Attitudes and positions of a vehicle in order of time [ns, UTC of the logger]."""

    kind: str
    attitudes: tuple[AttitudeSample, ...]
    positions: tuple[PositionSample, ...]
    warnings: tuple[str, ...] = ()
    on_ground_ns: tuple[tuple[int, int], ...] = ()
    """Start and end of the vehicle's times on the ground [ns]; empty if not logged."""

    def shifted(self, offset_ns: int) -> "VehicleTrack":
        """Copy of the track with an offset added to all times."""
        return replace(
            self,
            attitudes=tuple(replace(a, time_ns=a.time_ns + offset_ns) for a in self.attitudes),
            positions=tuple(replace(p, time_ns=p.time_ns + offset_ns) for p in self.positions),
            on_ground_ns=tuple((a + offset_ns, b + offset_ns) for a, b in self.on_ground_ns),
        )

    def on_ground(self, time_ns: int) -> bool:
        """True if the log shows that the vehicle was on the ground at a time."""
        return any(first <= time_ns <= last for first, last in self.on_ground_ns)


def attitude(
    time_ns: int, quaternion_wxyz: tuple[float, float, float, float]
) -> AttitudeSample | None:
    """Create an attitude sample; None if the rotation is invalid."""
    try:
        return AttitudeSample(time_ns=time_ns, quaternion_wxyz=normalised(quaternion_wxyz))
    except ValueError:
        return None


def position(
    time_ns: int, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float
) -> PositionSample | None:
    """Create a position sample without relative altitude; None for invalid coordinates."""
    if not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0):
        return None
    if latitude_deg == 0.0 and longitude_deg == 0.0:  # before the first fix
        return None
    altitude = altitude_amsl_m if math.isfinite(altitude_amsl_m) else 0.0
    return PositionSample(
        time_ns=time_ns,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_amsl_m=altitude,
        altitude_relative_m=math.nan,
    )


def over_the_first(positions: Iterable[PositionSample]) -> tuple[PositionSample, ...]:
    """Sort positions by time; unknown relative altitudes count from the first position."""
    ordered = in_order(positions)
    base_m = ordered[0].altitude_amsl_m if ordered else 0.0
    return tuple(
        one
        if math.isfinite(one.altitude_relative_m)
        else replace(one, altitude_relative_m=one.altitude_amsl_m - base_m)
        for one in ordered
    )


def in_order(samples: Iterable[S]) -> tuple[S, ...]:
    """Sort samples by time; of several samples with equal times, only the last one is used."""
    by_time = {one.time_ns: one for one in samples}
    return tuple(by_time[time] for time in sorted(by_time))


def headings_of_course(positions: Sequence[PositionSample]) -> list[AttitudeSample]:
    """Assumed attitudes for a track without attitudes: level, with the course as heading."""
    found: list[AttitudeSample] = []
    heading = None
    for before, after in pairwise(positions):
        seconds = (after.time_ns - before.time_ns) / NANOSECONDS_PER_SECOND
        north = math.radians(after.latitude_deg - before.latitude_deg) * 6.371e6
        turn = math.remainder(after.longitude_deg - before.longitude_deg, 360.0)
        east = math.radians(turn) * 6.371e6 * math.cos(math.radians(before.latitude_deg))
        if math.hypot(north, east) >= _SLOWEST_M_S * seconds:
            heading = math.degrees(math.atan2(east, north))
        if heading is not None:
            found.append(_level(before.time_ns, heading))
    if heading is not None and positions:
        found.append(_level(positions[-1].time_ns, heading))
    return found


def standing(positions: Sequence[PositionSample]) -> list[AttitudeSample]:
    """Level attitudes of a receiver at one place, without heading; empty if it moved."""
    places = [(one.latitude_deg, one.longitude_deg) for one in positions]
    return [_level(one.time_ns, 0.0) for one in positions] if are_one_place(places) else []


def filled(track: VehicleTrack) -> VehicleTrack:
    """Add samples in gaps of up to 15 s, or up to a day for a receiver that stands, because
    poses are interpolated over 2 s at most.
    """
    longest_s = _LONGEST_GAP_S if STANDING not in track.warnings else _LONGEST_STANDING_GAP_S
    return replace(
        track,
        attitudes=tuple(_filled(track.attitudes, _between_attitudes, longest_s)),
        positions=tuple(_filled(track.positions, _between_positions, longest_s)),
    )


def _level(time_ns: int, heading_deg: float) -> AttitudeSample:
    turned = from_euler_deg(heading_deg, 0.0, 0.0)
    return AttitudeSample(time_ns=time_ns, quaternion_wxyz=turned)


def _filled(
    samples: Sequence[S], between: Callable[[S, S, float], S], longest_s: float
) -> list[S]:
    found: list[S] = list(samples[:1])
    for before, after in pairwise(samples):
        gap_ns = after.time_ns - before.time_ns
        steps = gap_ns // _STEP_NS if gap_ns <= longest_s * NANOSECONDS_PER_SECOND else 0
        found += [between(before, after, step / steps) for step in range(1, steps)]
        found.append(after)
    return found


def _between_attitudes(a: AttitudeSample, b: AttitudeSample, share: float) -> AttitudeSample:
    return AttitudeSample(
        time_ns=a.time_ns + round(share * (b.time_ns - a.time_ns)),
        quaternion_wxyz=slerp(a.quaternion_wxyz, b.quaternion_wxyz, share),
    )


def _between_positions(a: PositionSample, b: PositionSample, share: float) -> PositionSample:
    def mixed(x: float, y: float) -> float:
        return x + share * (y - x)

    east = math.remainder(b.longitude_deg - a.longitude_deg, 360.0)
    return PositionSample(
        time_ns=a.time_ns + round(share * (b.time_ns - a.time_ns)),
        latitude_deg=mixed(a.latitude_deg, b.latitude_deg),
        longitude_deg=math.remainder(a.longitude_deg + share * east, 360.0),
        altitude_amsl_m=mixed(a.altitude_amsl_m, b.altitude_amsl_m),
        altitude_relative_m=mixed(a.altitude_relative_m, b.altitude_relative_m),
    )
