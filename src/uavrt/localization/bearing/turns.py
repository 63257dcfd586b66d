"""Find turns in place in a flight, from which bearings are estimated.

Turns may be clockwise or counter-clockwise, with pauses, and with 8 or 16 stops or none.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import UsageError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.angles import widest_gap_deg
from uavrt.localization.bearing.tuning import TURNS
from uavrt.localization.tuning import FLIGHT

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_PATH_M = 0.5 * TURNS.radius_m
"""Minimum distance between both ends of a movement for it to count as a flown path [m]."""
_DRIFT_M_PER_DEG = _PATH_M / 90.0
"""Maximum drift of a turn in place [m/°]; a full turn then remains within `TURNS.radius_m`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A turn in place: its times, angle, stops and position."""

    start_time_ns: int
    end_time_ns: int
    turned_deg: float
    """Total angle of the turn [deg], positive clockwise."""
    stops: int
    """Number of stops of the drone in the turn; 0 for a continuous turn."""
    widest_gap_deg: float
    """Widest arc of headings in the turn without a recorded pose [deg]."""
    latitude_deg: float
    """Median latitude of the drone during the turn [deg]."""
    longitude_deg: float


def find_turns(
    time_ns: _Ints,
    yaw_deg: _Floats,
    latitude_deg: _Floats,
    longitude_deg: _Floats,
    *,
    height_m: _Floats | None = None,
    on_ground: NDArray[np.bool_] | None = None,
    least_turn_deg: float = FLIGHT.whole_turn_deg,
) -> list[Turn]:
    """Find the turns in place of a flight, in order.

    Parameters
    ----------
    time_ns : (n,) int64 array
        Rising times of the poses [ns].
    yaw_deg : (n,) float64 array
        Headings, wrapped or not [deg]; several poses in each 180° of turn.
    latitude_deg, longitude_deg : (n,) float64 arrays
        Positions of the poses.
    height_m : (n,) float64 array, optional
        Height above the take-off, NaN where unknown. With it, rotations on the ground and in a
        climb do not count, unless nothing flew, as on a turntable.
    on_ground : (n,) bool array, optional
        True where the autopilot reports to be on the ground: no turn.
    least_turn_deg : float
        Least angle of a turn. UAV-RT's own software needs 270°; a turn of 8 stops has 315°.

    Raises
    ------
    UsageError
        Arrays differ in length, or times do not rise.
    """
    if len({len(time_ns), len(yaw_deg), len(latitude_deg), len(longitude_deg)}) != 1:
        raise UsageError(
            "times, headings and positions differ in number",
            remedy="Give one of each for every pose",
        )
    if len(time_ns) < 4:
        return []
    if np.any(np.diff(time_ns) <= 0):
        raise UsageError("the pose times are not increasing", remedy="Sort the poses by time")
    seconds = (time_ns - time_ns[0]) / NANOSECONDS_PER_SECOND
    plane = plane_around(latitude_deg, longitude_deg)
    east, north = plane.to_local(latitude_deg, longitude_deg)
    hovering = _speed(seconds, east, north) < TURNS.speed_m_s
    moves = _moves(seconds, east, north) & hovering
    hovering &= ~_walking(east, north, np.unwrap(yaw_deg, period=360.0), moves)
    if height_m is not None:
        hovering &= _in_flight(east, north, height_m) & ~_climbing(seconds, height_m)
    if on_ground is not None and not np.all(on_ground):
        hovering &= ~on_ground
    turns = []
    for first, last in _runs(hovering):
        yaw = np.unwrap(yaw_deg[first:last], period=360.0)
        for start, stop in _cut_at_paths(yaw, moves[first:last], _legs(yaw), least_turn_deg):
            leg = slice(first + start, first + stop + 1)
            within = yaw[start : stop + 1]
            for part in _without_long_pauses(seconds[leg], within):
                span = slice(leg.start + part[0], leg.start + part[1] + 1)
                turned = yaw[span.start - first : span.stop - first]
                east_m, north_m = east[span], north[span]
                drift = np.hypot(east_m - np.median(east_m), north_m - np.median(north_m)).max()
                if abs(turned[-1] - turned[0]) >= least_turn_deg and drift <= TURNS.radius_m:
                    place = _middle(latitude_deg[span], longitude_deg[span])
                    turns.append(_described(time_ns[span], seconds[span], turned, place))
    return turns


def _middle(latitude_deg: _Floats, longitude_deg: _Floats) -> tuple[float, float]:
    """Median latitude and longitude of positions [deg], computed in a local plane around
    them.
    """
    plane = plane_around(latitude_deg, longitude_deg)
    east, north = plane.to_local(latitude_deg, longitude_deg)
    latitude, longitude = plane.to_geodetic(np.median(east), np.median(north))
    return float(latitude), float(longitude)


def _described(
    time_ns: _Ints, seconds: _Floats, yaw: _Floats, place: tuple[float, float]
) -> Turn:
    return Turn(
        start_time_ns=int(time_ns[0]),
        end_time_ns=int(time_ns[-1]),
        turned_deg=float(yaw[-1] - yaw[0]),
        stops=len(_stops(seconds, yaw)),
        widest_gap_deg=widest_gap_deg(yaw),
        latitude_deg=place[0],
        longitude_deg=place[1],
    )


def _speed(seconds: _Floats, east: _Floats, north: _Floats) -> _Floats:
    half = TURNS.window_s / 2.0
    before = np.maximum(np.searchsorted(seconds, seconds - half, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(seconds, seconds + half), len(seconds) - 1)
    moved = np.hypot(east[after] - east[before], north[after] - north[before])
    return np.asarray(moved / np.maximum(seconds[after] - seconds[before], 1e-3))


def _moves(seconds: _Floats, east: _Floats, north: _Floats) -> NDArray[np.bool_]:
    """True for poses during a lasting displacement, however slow."""
    before = np.searchsorted(seconds, seconds - TURNS.path_window_s)
    after = np.searchsorted(seconds, seconds + TURNS.path_window_s, side="right") - 1

    def moved_m(other: _Ints) -> _Floats:
        return np.asarray(np.hypot(east - east[other], north - north[other]))

    return _that_lead_away(
        np.minimum(moved_m(before), moved_m(after)) >= TURNS.window_shift_m, east, north
    )


def _that_lead_away(
    moves: NDArray[np.bool_], east: _Floats, north: _Floats
) -> NDArray[np.bool_]:
    """True in stretches of `moves` whose two ends are at least half a turn's radius apart,
    shape (n,).
    """
    kept = np.zeros(len(moves), bool)
    for first, last in _runs(moves):
        way_m = np.hypot(east[last - 1] - east[first], north[last - 1] - north[first])
        kept[first:last] = way_m >= _PATH_M
    return kept


def _walking(
    east: _Floats, north: _Floats, yaw: _Floats, moves: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    walking = moves.copy()
    for first, last in _runs(moves):
        within = slice(first, last)
        walking[within] &= ~_on_the_spot(yaw[within], east[within], north[within])
    return _that_lead_away(walking, east, north)


def _on_the_spot(yaw: _Floats, east: _Floats, north: _Floats) -> NDArray[np.bool_]:
    """True for poses during a rotation with little displacement."""
    found = np.zeros(len(yaw), bool)
    for start, stop in _legs(yaw):
        way = np.sign(yaw[stop] - yaw[start])
        turned = np.maximum.accumulate(way * (yaw[start : stop + 1] - yaw[start]))
        for span_deg in (TURNS.drift_span_deg, 2.0 * TURNS.drift_span_deg):
            from_deg = np.arange(turned[-1] - span_deg, 0.0, -TURNS.drift_step_deg)
            begins = start + np.searchsorted(turned, from_deg, side="right") - 1
            ends = start + np.searchsorted(turned, from_deg + span_deg) + 1
            for first, last in zip(begins, ends, strict=True):
                there = slice(first, last)
                away_m = np.hypot(east[there] - east[first], north[there] - north[first])
                found[there] |= away_m.max() <= _DRIFT_M_PER_DEG * span_deg
    return found


def _runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _legs(yaw: _Floats) -> list[tuple[int, int]]:
    """Return the first and last pose index of each rotation in one direction; small reversals
    are ignored.
    """
    legs, start, best = [], 0, 0
    way = 0.0
    for index in range(1, len(yaw)):
        if way == 0.0:
            if abs(yaw[index] - yaw[start]) > TURNS.reversal_deg:
                way = float(np.sign(yaw[index] - yaw[start]))
                best = index
        elif way * (yaw[index] - yaw[best]) > 0.0:
            best = index
        elif way * (yaw[best] - yaw[index]) > TURNS.reversal_deg:
            legs.append((start, best))
            start, best, way = best, index, -way
    if way != 0.0:
        # The last stop lasts as long as the heading is held.
        held = np.flatnonzero(np.abs(yaw[best:] - yaw[best]) > TURNS.stop_deg)
        legs.append((start, best + int(held[0]) - 1 if len(held) else len(yaw) - 1))
    return legs


def _cut_at_paths(
    yaw: _Floats, moves: NDArray[np.bool_], legs: list[tuple[int, int]], least_turn_deg: float
) -> list[tuple[int, int]]:
    """Cut rotations where a flown path separates full turns; a single drifting turn is not
    cut.
    """
    parts = []
    for start, stop in legs:
        cuts = [start]
        for first, last in _runs(moves[start : stop + 1]):
            ends = start + first, start + last - 1
            turned = abs(yaw[ends[0]] - yaw[start]), abs(yaw[stop] - yaw[ends[1]])
            if (
                max(turned) >= least_turn_deg
                and abs(yaw[stop] - yaw[start]) > TURNS.one_turn_deg
            ):
                cuts += ends
        parts += list(pairwise([*cuts, stop]))
    return parts


def _stops(seconds: _Floats, yaw: _Floats) -> list[tuple[int, int]]:
    stops: list[tuple[int, int]] = []
    start = 0
    for index in range(1, len(yaw) + 1):
        if index < len(yaw) and abs(yaw[index] - yaw[start]) <= TURNS.stop_deg:
            continue
        if seconds[index - 1] - seconds[start] >= TURNS.window_s:
            held = float(np.median(yaw[start:index]))
            before = stops[-1] if stops else None
            # A stop that begins with the end of a turn is divided by its own drift.
            if (
                before
                and abs(held - np.median(yaw[before[0] : before[1] + 1])) <= TURNS.stop_deg
            ):
                stops[-1] = (before[0], index - 1)
            else:
                stops.append((start, index - 1))
        start = index
    return stops


def _without_long_pauses(seconds: _Floats, yaw: _Floats) -> list[tuple[int, int]]:
    """Cut a rotation at long pauses, and remove rest and drift before and after it.

    The first and the last stop are shortened to the longest stop between them, so that a turn
    of eight stops has eight. Of a turn without stops, only the moving part remains.
    """
    moving = _runs(_turning(seconds, yaw))
    parts: list[list[tuple[int, int]]] = []
    for run in moving:
        pause_s = seconds[run[0]] - seconds[parts[-1][-1][1] - 1] if parts else np.inf
        if pause_s > TURNS.longest_pause_s:
            parts.append([run])
        else:
            parts[-1].append(run)
    return [_with_its_stops(seconds, yaw, part) for part in parts]


def _with_its_stops(
    seconds: _Floats, yaw: _Floats, moving: list[tuple[int, int]]
) -> tuple[int, int]:
    stops = [seconds[b[0]] - seconds[a[1] - 1] for a, b in pairwise(moving)]
    hold_s = max((one for one in stops if one >= TURNS.window_s), default=0.0) + 0.5
    first, last = moving[0][0], moving[-1][1] - 1
    still = np.abs(yaw[: first + 1] - yaw[first]) <= TURNS.stop_deg
    still &= seconds[: first + 1] >= seconds[first] - hold_s
    first = int(np.flatnonzero(~still)[-1]) + 1 if not still.all() else 0
    still = np.abs(yaw[last:] - yaw[last]) <= TURNS.stop_deg
    still &= seconds[last:] <= seconds[last] + hold_s
    last += (int(np.flatnonzero(~still)[0]) if not still.all() else len(still)) - 1
    return first, last


def _turning(seconds: _Floats, yaw: _Floats) -> NDArray[np.bool_]:
    half = TURNS.window_s / 2.0
    before = np.maximum(np.searchsorted(seconds, seconds - half, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(seconds, seconds + half), len(seconds) - 1)
    took = np.maximum(seconds[after] - seconds[before], 1e-3)
    rate = np.abs(yaw[after] - yaw[before]) / took
    turning = rate >= TURNS.least_rate_deg_s
    # The averaged rate also exceeds its limit just before and after a rotation: its ends are
    # found from the headings themselves.
    edges = np.zeros(len(yaw), bool)
    for first, last in _runs(turning):
        span = yaw[first:last]
        if abs(span[-1] - span[0]) <= TURNS.stop_deg:
            continue
        gone = np.flatnonzero(np.abs(span - span[0]) > 0.5 * TURNS.stop_deg)
        left = np.flatnonzero(np.abs(span - span[-1]) > 0.5 * TURNS.stop_deg)
        edges[first + int(gone[0]) - 1 : first + int(left[-1]) + 2] = True
    return edges


def _in_flight(east: _Floats, north: _Floats, height_m: _Floats) -> NDArray[np.bool_]:
    known = np.isfinite(height_m)
    if not known.any():
        return np.ones(len(height_m), bool)
    off = ~known | (np.abs(height_m) > TURNS.height_error_m)
    flown = np.flatnonzero(off & known)
    if not len(flown):
        return np.ones(len(height_m), bool)
    away = np.ones(len(height_m), bool)
    away[: flown[0]] = away[flown[-1] + 1 :] = False
    for place in (max(0, flown[0] - 1), min(len(east) - 1, flown[-1] + 1)):
        away &= np.hypot(east - east[place], north - north[place]) > TURNS.around_start_m
    return np.asarray(off | away)


def _climbing(seconds: _Floats, height_m: _Floats) -> NDArray[np.bool_]:
    height = np.where(np.isfinite(height_m), height_m, 0.0)
    half = TURNS.window_s / 2.0
    before = np.maximum(np.searchsorted(seconds, seconds - half, side="right") - 1, 0)
    after = np.minimum(np.searchsorted(seconds, seconds + half), len(seconds) - 1)
    rate = (height[after] - height[before]) / np.maximum(seconds[after] - seconds[before], 1e-3)
    climbing = np.zeros(len(height), bool)
    least_m = TURNS.height_error_m
    for way in (1.0, -1.0):
        for first, last in _runs(way * rate > least_m / TURNS.path_window_s):
            climbing[first:last] |= abs(height[last - 1] - height[first]) >= least_m
    return climbing
