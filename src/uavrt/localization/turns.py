"""Where in a flight the drone turned in place: the rotations that bearings come from.

Nobody marks them: they are found in the poses, whichever way round, with pauses, at 8 or 16
stops or without any.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.localization.angles import widest_gap_deg
from uavrt.localization.tangent_plane import plane_around

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_SPEED_WINDOW_S = 3.0
_REVERSAL_DEG = 25.0
"""Yaw that has gone back by less is hovering or overshoot, not the other way round."""
_STILL_DEG = 4.0
"""A stop keeps within this of its heading …"""
_STOP_S = 2.0
"""… and lasts that long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A turn in place."""

    start_time_ns: int
    end_time_ns: int
    turned_deg: float
    """Whole turn, positive is clockwise."""
    stops: int
    """Headings that were held; 0 is a continuous turn."""
    widest_gap_deg: float
    """Widest arc of headings that was skipped."""
    latitude_deg: float
    """Middle of the places during the turn."""
    longitude_deg: float


def find_turns(
    time_ns: _Ints,
    yaw_deg: _Floats,
    latitude_deg: _Floats,
    longitude_deg: _Floats,
    *,
    least_turn_deg: float = 270.0,
    speed_m_s: float = 1.5,
    radius_m: float = 15.0,
    longest_pause_s: float = 180.0,
) -> list[Turn]:
    """Find the turns in place of a flight, in order.

    Parameters
    ----------
    time_ns : (n,) int64 array
        Times of the poses, rising.
    yaw_deg : (n,) float64 array
        Heading, any turn; several poses for each 180° of turn.
    latitude_deg, longitude_deg : (n,) float64 arrays
        Places of the poses.
    least_turn_deg : float
        Smaller turns are none. 270° is what the original asks for; 8 stops turn by 315°.
    speed_m_s : float
        Faster is flying; slower is hovering in wind.
    radius_m : float
        A place is left when the drone is farther from its middle.
    longest_pause_s : float
        A longer stop ends a turn.

    Raises
    ------
    UsageError
        Arrays differ in length, or times do not rise.
    """
    if len({len(time_ns), len(yaw_deg), len(latitude_deg), len(longitude_deg)}) != 1:
        raise UsageError("times, headings and places differ in number")
    if len(time_ns) < 4:
        return []
    if np.any(np.diff(time_ns) <= 0):
        raise UsageError("the poses' times do not rise", remedy="Sort the poses by time")
    seconds = (time_ns - time_ns[0]) / 1e9
    plane = plane_around(latitude_deg, longitude_deg)
    east, north = plane.to_local(latitude_deg, longitude_deg)
    hovering = _speed(seconds, east, north) < speed_m_s
    turns = []
    for first, last in _runs(hovering):
        yaw = np.unwrap(yaw_deg[first:last], period=360.0)
        for start, stop in _legs(yaw):
            leg = slice(first + start, first + stop + 1)
            within = yaw[start : stop + 1]
            for part in _without_long_pauses(seconds[leg], within, longest_pause_s):
                span = slice(leg.start + part[0], leg.start + part[1] + 1)
                turned = yaw[span.start - first : span.stop - first]
                drift = np.hypot(
                    east[span] - np.median(east[span]), north[span] - np.median(north[span])
                )
                if abs(turned[-1] - turned[0]) >= least_turn_deg and drift.max() <= radius_m:
                    place = plane.to_geodetic(np.median(east[span]), np.median(north[span]))
                    turns.append(_described(time_ns[span], seconds[span], turned, place))
    return turns


def _described(
    time_ns: _Ints, seconds: _Floats, yaw: _Floats, place: tuple[_Floats, _Floats]
) -> Turn:
    return Turn(
        start_time_ns=int(time_ns[0]),
        end_time_ns=int(time_ns[-1]),
        turned_deg=float(yaw[-1] - yaw[0]),
        stops=len(_stops(seconds, yaw)),
        widest_gap_deg=widest_gap_deg(yaw),
        latitude_deg=float(place[0]),
        longitude_deg=float(place[1]),
    )


def _speed(seconds: _Floats, east: _Floats, north: _Floats) -> _Floats:
    """Speed over a window of 3 s, which averages GNSS noise out."""
    half = _SPEED_WINDOW_S / 2.0
    before = np.maximum(np.searchsorted(seconds, seconds - half, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(seconds, seconds + half), len(seconds) - 1)
    moved = np.hypot(east[after] - east[before], north[after] - north[before])
    return np.asarray(moved / np.maximum(seconds[after] - seconds[before], 1e-3))


def _runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First index and the one after the last of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _legs(yaw: _Floats) -> list[tuple[int, int]]:
    """First and last index of stretches in one direction; small reversals do not count."""
    legs, start, best = [], 0, 0
    way = 0.0
    for index in range(1, len(yaw)):
        if way == 0.0:
            if abs(yaw[index] - yaw[start]) > _REVERSAL_DEG:
                way = float(np.sign(yaw[index] - yaw[start]))
                best = index
        elif way * (yaw[index] - yaw[best]) > 0.0:
            best = index
        elif way * (yaw[best] - yaw[index]) > _REVERSAL_DEG:
            legs.append((start, best))
            start, best, way = best, index, -way
    if way != 0.0:
        # The last stop lasts as long as the heading is held.
        held = np.flatnonzero(np.abs(yaw[best:] - yaw[best]) > _STILL_DEG)
        legs.append((start, best + int(held[0]) - 1 if len(held) else len(yaw) - 1))
    return legs


def _stops(seconds: _Floats, yaw: _Floats) -> list[tuple[int, int]]:
    """First and last index of each heading that was held."""
    stops: list[tuple[int, int]] = []
    start = 0
    for index in range(1, len(yaw) + 1):
        if index < len(yaw) and abs(yaw[index] - yaw[start]) <= _STILL_DEG:
            continue
        if seconds[index - 1] - seconds[start] >= _STOP_S:
            held = float(np.median(yaw[start:index]))
            before = stops[-1] if stops else None
            # A stop that begins with the end of a turn is cut in two by its own drift.
            if before and abs(held - np.median(yaw[before[0] : before[1] + 1])) <= _STILL_DEG:
                stops[-1] = (before[0], index - 1)
            else:
                stops.append((start, index - 1))
        start = index
    return stops


def _without_long_pauses(
    seconds: _Floats, yaw: _Floats, longest_pause_s: float
) -> list[tuple[int, int]]:
    """Cut a leg at long pauses; hovering before and after the turn is no part of it.

    The first and the last stop are kept as long as the longest one between them, so that a turn
    of eight stops has eight; of a turn without stops only the moving part is left.
    """
    stops = _stops(seconds, yaw)
    pauses = [(a, b) for a, b in stops if seconds[b] - seconds[a] > longest_pause_s]
    inner = [
        seconds[b] - seconds[a]
        for a, b in stops
        if a > 0 and b < len(yaw) - 1 and (a, b) not in pauses
    ]
    hold = max(inner, default=0.0)
    bounds = [0, *(index for pause in pauses for index in pause), len(yaw) - 1]
    parts = []
    for a, b in zip(bounds[::2], bounds[1::2], strict=True):
        first, last = a, b
        moving = np.flatnonzero(np.abs(yaw[a : b + 1] - yaw[a]) > _STILL_DEG)
        if not len(moving):
            continue
        leaving = seconds[a + int(moving[0])]
        first = int(np.searchsorted(seconds, max(seconds[a], leaving - hold - 0.5)))
        arrived = np.flatnonzero(np.abs(yaw[a : b + 1] - yaw[b]) > _STILL_DEG)
        arriving = seconds[a + int(arrived[-1])]
        last = (
            int(np.searchsorted(seconds, min(seconds[b], arriving + hold + 0.5), "right")) - 1
        )
        if last > first:
            parts.append((first, last))
    return parts
