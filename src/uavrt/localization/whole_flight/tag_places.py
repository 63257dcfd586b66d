"""Generate possible positions of a tag, with the strength of its pulses over a flight for
each.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane, plane_around
from uavrt.core.errors import UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_360
from uavrt.localization.antenna import MONOPOLE, AntennaPattern, monopole_gain_db
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.headings import Headings
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import LEVELS
from uavrt.localization.whole_flight.tuning import SEARCH

_Floats = NDArray[np.float64]
BEARING_STEP_DEG = 360.0 / SEARCH.bearings
RANGE_STEP = (SEARCH.farthest_m / SEARCH.nearest_m) ** (1.0 / (SEARCH.ranges - 1))
"""Ratio of the radii of neighbouring rings of candidate tag positions around the flight."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Candidate positions of a tag around a flight, and the relative energy of pulses from
    each.
    """

    plane: TangentPlane
    east_m: _Floats
    """Candidate tag positions east of the middle of the flight [m], shape (places,)."""
    north_m: _Floats
    area: _Floats
    """Relative area of ground that each candidate position represents, used as prior, shape
    (places,)."""
    time_s: _Floats
    """Times relative to the start of the first slot at which gains are computed [s], shape
    (times,)."""
    gain: _Floats
    """Energy of a pulse relative to the strongest one from the same position, shape (places,
    times)."""
    strongest_db: _Floats
    """Level of the strongest pulse [dB], relative to a reference common to all flights, shape
    (places,)."""
    track: "Track"

    @property
    def bearing_deg(self) -> _Floats:
        """Bearing from the middle of the flight, clockwise from true north [deg], shape
        (places,).
        """
        return wrap_degrees_360(np.degrees(np.arctan2(self.east_m, self.north_m)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """Positions and orientations of the antenna at the times of `Places`."""

    pattern: AntennaPattern
    east_m: _Floats
    """East coordinate of the antenna in the plane of `Places` [m], shape (times,)."""
    north_m: _Floats
    height_m: _Floats
    axes: _Floats
    """Forward, right and down axes of the antenna, shape (times, 3, 3)."""
    hills: HillLosses | None = None
    """Ground model in the track's plane, for losses behind hills; None for level ground."""

    def seen_from(self, velocity_m_s: tuple[float, float], since_s: _Floats) -> "Track":
        """Track relative to a walking tag; `since_s`: (times,) since it was at its position."""
        east, north = velocity_m_s
        return replace(
            self, east_m=self.east_m - east * since_s, north_m=self.north_m - north * since_s
        )

    def gain_db(self, east_m: _Floats, north_m: _Floats, turn_deg: float = 0.0) -> _Floats:
        """Level relative to that on boresight at 1 m [dB], shape (places, times); `turn_deg` is
        a heading error.
        """
        cosine, sine = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        gain_db = np.empty((len(east_m), len(self.east_m)))
        rise: NDArray[np.floating[Any]] = np.zeros(len(east_m))
        if self.hills is not None:
            seen = self.hills.seen_from(self.east_m, self.north_m, self.height_m)
            lost_db, rise = seen(east_m, north_m), self.hills.rise_m(east_m, north_m)
        # A contiguous row for each axis and component: these sums dominate the search's time.
        axes = np.ascontiguousarray(np.moveaxis(self.axes, 0, 2))
        block = max(1, SEARCH.gain_block // len(self.east_m))
        for low in range(0, len(east_m), block):
            some = slice(low, low + block)
            ahead = north_m[some, np.newaxis] - self.north_m
            aside = east_m[some, np.newaxis] - self.east_m
            under = self.height_m - rise[some, np.newaxis]
            distance = np.maximum(np.sqrt(ahead**2 + aside**2 + under**2), 1.0)
            if turn_deg:
                ahead, aside = cosine * ahead + sine * aside, cosine * aside - sine * ahead
            towards = ahead / distance, aside / distance, under / distance
            gain_db[some] = self._towards_db(axes, *towards)
            gain_db[some] -= 10.0 * LEVELS.exponent * np.log10(distance)
            if self.hills is not None:
                gain_db[some] -= lost_db[some]
        return gain_db

    def _towards_db(
        self, axes: _Floats, north: _Floats, east: _Floats, down: _Floats
    ) -> _Floats:
        """Antenna gain in given directions [dB], shape (places, times); `axes` has shape (3, 3,
        times).
        """
        if self.pattern.name == MONOPOLE:
            # A monopole stays upright however the drone tilts, and receives nothing from below.
            return monopole_gain_db(np.degrees(np.arcsin(np.clip(down, -1.0, 1.0))))
        return self.pattern.gain_towards_db(
            *(axis[0] * north + axis[1] * east + axis[2] * down for axis in axes)
        )

    def away_db(self, east_m: _Floats, north_m: _Floats, part: _Floats) -> _Floats:
        """10 log10 of the path length in metres at fractional time indices `part`, shape
        (places, parts).
        """
        times = np.arange(len(self.east_m))
        east, north, height = (
            np.interp(part, times, each) for each in (self.east_m, self.north_m, self.height_m)
        )
        square = (east_m[:, np.newaxis] - east) ** 2 + (north_m[:, np.newaxis] - north) ** 2
        return np.asarray(5.0 * np.log10(np.maximum(square + height**2, 1.0)))


def places_around(
    poses: PoseColumns,
    pattern: AntennaPattern,
    *,
    start_ns: int,
    end_ns: int,
    hills: HillLosses | None = None,
    plane: TangentPlane | None = None,
) -> Places:
    """Generate candidate positions around a drone's path, or around the origin of a given
    plane.
    """
    inside = (poses.time_ns >= start_ns) & (poses.time_ns <= end_ns)
    if np.count_nonzero(inside) < 2:
        raise UsageError(
            "the flight has no poses in the time of the samples",
            remedy="Check --start-time, or name the flight in which they were recorded",
        )
    if plane is None:
        plane = plane_around(poses.latitude_deg[inside], poses.longitude_deg[inside])
    count = max(2, round((end_ns - start_ns) / NANOSECONDS_PER_SECOND / SEARCH.step_s))
    time_ns = start_ns + np.linspace(0.0, float(end_ns - start_ns), count)
    pose_ns = poses.time_ns.astype(np.float64)
    nearest = _nearest(pose_ns, time_ns)
    drone_east, drone_north = plane.to_local(poses.latitude_deg, poses.longitude_deg)
    east = np.interp(time_ns, pose_ns, drone_east)
    north = np.interp(time_ns, pose_ns, drone_north)
    height = np.interp(time_ns, pose_ns, np.nan_to_num(poses.height_m, nan=0.0))
    axes = Headings.from_quaternions(poses.quaternion_wxyz[nearest]).axes
    assert axes is not None
    if hills is not None:
        hills = None if hills.level else hills.in_plane(plane)
    if hills is not None:
        hills.cover(
            [-SEARCH.farthest_m, SEARCH.farthest_m], [-SEARCH.farthest_m, SEARCH.farthest_m]
        )
    track = Track(
        hills=hills, pattern=pattern, east_m=east, north_m=north, height_m=height, axes=axes
    )
    bearing = np.arange(SEARCH.bearings) * 360.0 / SEARCH.bearings
    ranges = np.geomspace(SEARCH.nearest_m, SEARCH.farthest_m, SEARCH.ranges)
    place_east, place_north = east_north(
        np.tile(bearing, SEARCH.ranges), np.repeat(ranges, SEARCH.bearings)
    )
    gain = track.gain_db(place_east, place_north)
    strongest_db = gain.max(axis=1)
    # In place: the arrays of a long flight are large, and new pages cost more than the sums.
    gain -= strongest_db[:, np.newaxis]
    gain *= 0.1
    np.power(10.0, gain, out=gain)
    return Places(
        plane=plane,
        east_m=place_east,
        north_m=place_north,
        area=np.repeat(ranges**2, SEARCH.bearings),
        time_s=(time_ns - start_ns) / NANOSECONDS_PER_SECOND,
        gain=gain,
        strongest_db=strongest_db,
        track=track,
    )


def common_gains(each: Sequence[Places]) -> list[_Floats]:
    """Return the gains of several flights, relative to each position's strongest pulse in any
    of them.
    """
    strongest_db = np.stack([one.strongest_db for one in each])
    below_db = strongest_db - strongest_db.max(axis=0)
    return [
        one.gain * 10.0 ** (below[:, np.newaxis] / 10.0)
        for one, below in zip(each, below_db, strict=True)
    ]


def east_north(bearing_deg: _Floats, range_m: _Floats) -> tuple[_Floats, _Floats]:
    """Convert bearing and distance from the middle of the flight to east and north [m]."""
    turn = np.radians(bearing_deg)
    return np.asarray(range_m * np.sin(turn)), np.asarray(range_m * np.cos(turn))


def distinct(
    weights: _Floats, alike_from: float = SEARCH.same_place_correlation
) -> NDArray[np.intp]:
    """Choose positions such that the weights (places, times) of every other position resemble
    those of a chosen one.
    """
    unit = weights / np.maximum(np.linalg.norm(weights, axis=1, keepdims=True), 1e-12)
    alike = unit @ unit.T
    uncovered = np.ones(len(unit), bool)
    chosen = []
    while uncovered.any():
        covers = (alike >= alike_from)[:, uncovered].sum(axis=1)
        best = int(covers.argmax())
        chosen.append(best)
        uncovered &= alike[best] < alike_from
    return np.array(chosen, np.intp)


def _nearest(known: _Floats, wanted: _Floats) -> NDArray[np.intp]:
    after = np.clip(np.searchsorted(known, wanted), 1, len(known) - 1)
    earlier = wanted - known[after - 1] <= known[after] - wanted
    return np.asarray(after - earlier)
