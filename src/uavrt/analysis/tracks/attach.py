"""Give pulses poses from another program's log, and estimate the clocks' offset.

An offset is rejected if another one at least 5 s away fits nearly as well (misfit within 15 %).
It is also rejected if its standard deviation (by a jackknife over eighths of the flight)
corresponds to more than 3° of heading in a turn. A single turn at a constant rate fits any
offset, each with a different bearing; starts, stops and several positions remove this
ambiguity.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from uavrt.config.settings import AntennaSettings
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.core.messages import PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.formats.tracks.track import VehicleTrack
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.pose.attacher import PoseAttacher
from uavrt.localization.pose.ring import PoseRing

_ZONES_S, _MOST_ZONES_S = 1800.0, 26 * 3600.0
"""Step and largest value of clock errors caused by local time zones [s]."""
SEARCH_S = 120.0
STEP_S = 1.0
FINE_S = 0.05
CLEAR = 1.15
"""Minimum ratio of the misfit 5 s away to that at the best clock offset."""
_ELSEWHERE_S = 5.0
MOST_HEADING_SIGMA_DEG = 3.0
"""Largest accepted heading error from an uncertain clock offset [deg]; the error of a bearing
from one turn is a few degrees."""
_LEAST_PULSES = 12
_LEAST_SHARE = 0.25
"""Minimum share of pulses that a track covers; less suggests another flight's track."""
_MOST_LOST = 0.2
"""Largest share of the pulses that could be covered which an offset may leave without a pose.

Without this limit, the best offset would be one that excludes the pulses which fit badly."""
_PARTS = 8
_TURNING_DEG_S = 2.0
"""Rate above which the vehicle counts as turning [deg/s]; rotation by wind is slower."""
_NEAR_M = 20.0
_ROUND_CELL, _ROUND_CELL_M = 0.4, 30.0
"""Half-width of the first search grid around a candidate position of a tag: share of its
distance from the flight's middle, plus a constant [m]."""
_ZOOM = 0.4
_FINE_PLACE_M = 2.0
"""Half-width of the 9 × 9 grid of tag positions at which refinement ends [m]."""

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockOffset:
    """Offset of the pulses' clock from the track's clock, positive if the pulses' clock is
    ahead, with its uncertainty.
    """

    offset_s: float
    found_by: str
    """Source of the offset: ``"given"`` by the user, or estimated from the pulses' ``"poses"``
    or their SNR (``"powers"``)."""
    sigma_s: float | None = None
    """Standard deviation of the offset, by a jackknife over eighths of the flight [s]; None if
    the offset was given."""
    heading_sigma_deg: float | None = None
    """Heading error from the clock offset's uncertainty at the flown turn rate [deg]."""


def attach_poses(
    pulse_poses: Sequence[PulsePose],
    track: VehicleTrack,
    offset_s: float,
    antenna: AntennaSettings | None = None,
) -> list[PulsePose]:
    """Give each pulse the antenna's pose from the track, or None where the track has a gap.

    While the log reports landed or disarmed, the height is set to 0, whatever the barometer's
    drift. This distinguishes turns of a carried drone from turns in flight. Poses that pulses
    already have are replaced.
    """
    ring = PoseRing(antenna, capacity=max(1, len(track.attitudes), len(track.positions)))
    shifted = track.shifted(ns_from_s(offset_s))
    for attitude in shifted.attitudes:
        ring.add_attitude(attitude)
    for position in shifted.positions:
        ring.add_position(position)
    attacher = PoseAttacher(ring, wait_s=0.0)
    for one in sorted(pulse_poses, key=lambda one: one.pulse.start_time_ns):
        attacher.add(one.pulse, one.pulse.end_time_ns)
    found = sorted(attacher.flush(), key=lambda one: one.pulse.start_time_ns)
    return [_grounded(one, shifted) for one in found]


def _grounded(one: PulsePose, track: VehicleTrack) -> PulsePose:
    if one.pose is None or not track.on_ground(one.pulse.start_time_ns):
        return one
    return replace(one, pose=replace(one.pose, altitude_relative_m=0.0))


def require_poses(attached: Sequence[PulsePose], offset_s: float) -> int:
    """Number of pulses with a pose. Raises `UsageError` if under a quarter have one."""
    placed = sum(one.pose is not None for one in attached)
    if attached and placed < _LEAST_SHARE * len(attached):
        raise UsageError(
            f"only {placed} of {len(attached)} pulses would get a pose with a clock offset of "
            f"{offset_s:+.2f} s: fewer than a quarter",
            remedy="Check --clock-offset (clock of the pulses minus clock of the track, "
            "in seconds), and that pulses and track are from one flight",
        )
    return placed


def estimate_offset(
    pulse_poses: Sequence[PulsePose], track: VehicleTrack, *, antenna: str = "RA-23K"
) -> ClockOffset:
    """Estimate the offset between the clocks of a track and of a log of pulses.

    If the pulses have poses, even inaccurate ones, headings and positions are compared.
    Otherwise the SNR is compared with antenna pattern and distance. A single turn at a constant
    rate cannot distinguish an offset from another bearing; starts, stops and several turns can.
    Raises `UsageError` if the offset is uncertain.
    """
    if len(track.attitudes) < 2 or len(track.positions) < 2:
        text = "the track has fewer than two positions or attitudes"
        raise UsageError(text, remedy="Give the log of the whole flight")
    common = _Common(pulse_poses, track)
    misfit: Callable[..., float]
    if len(common.posed) >= _LEAST_PULSES:
        found_by, misfit = "poses", common.pose_misfit
    elif len(common.time_s) >= _LEAST_PULSES:
        found_by, misfit = "powers", partial(common.power_misfit, antenna=antenna)
    else:
        raise UsageError(
            f"{len(common.time_s)} pulses are too few to find the clock offset",
            remedy="Give --clock-offset; it is 0 if both clocks were set by GPS",
        )
    coarse = np.arange(-SEARCH_S, SEARCH_S + STEP_S, STEP_S)
    common.require_cover(coarse, posed=found_by == "poses")
    cost = np.array([misfit(offset) for offset in coarse])
    best = float(coarse[int(np.nanargmin(cost))])
    if found_by == "powers":
        misfit = common.sharper_misfit(best, antenna)
    fine = np.arange(best - STEP_S, best + STEP_S + FINE_S / 2, FINE_S)
    posed = found_by == "poses"
    # All on the same pulses: one at the track's edge, heard on the ground, would make a jump.
    covered = common.covered(fine[0], posed=posed) & common.covered(fine[-1], posed=posed)
    if not covered.any():
        covered = common.covered(best, posed=posed)
    fine_cost = np.array([misfit(offset, keep=covered) for offset in fine])
    offset_s, least = float(fine[int(np.nanargmin(fine_cost))]), float(np.nanmin(fine_cost))
    away = cost[np.abs(coarse - offset_s) > _ELSEWHERE_S]
    if float(np.nanmin(away)) / max(least, 1e-6) < CLEAR:
        raise UsageError(
            f"the clock offset is ambiguous: {offset_s:.1f} s fits best, but other "
            "offsets fit nearly as well",
            remedy="Give --clock-offset; it is 0 if both clocks were set by GPS",
        )
    sigma_s = _sigma_s(misfit, fine, covered)
    heading_sigma_deg = sigma_s * common.turn_rate_deg_s
    if heading_sigma_deg > MOST_HEADING_SIGMA_DEG:
        raise UsageError(
            f"the clock offset is {offset_s:+.2f} s ± {sigma_s:.2f} s, which leaves headings "
            f"in a turn uncertain by {heading_sigma_deg:.0f}°",
            remedy=f"Give --clock-offset {offset_s:.2f} to accept this value, or "
            "--clock-offset 0 if both clocks were set by GPS",
        )
    return ClockOffset(
        offset_s=offset_s,
        found_by=found_by,
        sigma_s=sigma_s,
        heading_sigma_deg=heading_sigma_deg,
    )


def _sigma_s(
    misfit: Callable[..., float], offsets_s: _Floats, covered: NDArray[np.bool_]
) -> float:
    """Standard deviation of the best offset by a jackknife over the flight's eighths [s].

    Errors of neighbouring pulses are correlated, so whole time spans are omitted (Künsch 1989,
    The jackknife and the bootstrap for general stationary observations).
    """
    counted = np.cumsum(covered) - 1
    part_of = np.where(covered, counted * _PARTS // int(np.count_nonzero(covered)), -1)
    best = []
    for part in range(_PARTS):
        cost = np.array(
            [misfit(offset, keep=covered & (part_of != part)) for offset in offsets_s]
        )
        best.append(float(offsets_s[int(np.nanargmin(cost))]))
    spread = np.array(best) - np.mean(best)
    step = FINE_S / np.sqrt(12.0)
    return float(np.hypot(np.sqrt((_PARTS - 1) / _PARTS * np.sum(spread**2)), step))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _TagOnTrack:
    east_m: _Floats
    north_m: _Floats
    yaw_deg: _Floats
    snr_db: _Floats
    antenna: str

    def squares(self, east_m: _Floats, north_m: _Floats) -> _Floats:
        """Sum of squared SNR residuals for a tag at each place [dB²], shape (places,).

        The model is antenna pattern and distance; the level is fitted.
        """
        towards_e = east_m[:, None] - self.east_m[None, :]
        towards_n = north_m[:, None] - self.north_m[None, :]
        bearing = np.degrees(np.arctan2(towards_e, towards_n))
        gain = PATTERNS[self.antenna].gain_db(bearing - self.yaw_deg[None, :])
        far = 10.0 * np.log10(towards_e**2 + towards_n**2 + _NEAR_M**2)
        rest = self.snr_db[None, :] - gain + far
        spread = rest - np.median(rest, axis=1, keepdims=True)
        # Nulls are deep and uncertain: beyond 10 dB a pulse counts no more.
        return np.asarray(np.minimum(spread**2, 100.0).sum(axis=1))

    def least(self, start: tuple[float, float], middle: tuple[float, float]) -> float:
        """Smallest sum of squared residuals near a position [dB²], on ever finer grids.

        The first grid is as wide as the cells of the polar grid at the position's distance from
        `middle`.
        """
        (east, north), best = start, np.inf
        half_m = _ROUND_CELL_M + _ROUND_CELL * math.dist(start, middle)
        steps = np.linspace(-1.0, 1.0, 9)
        over_e, over_n = (one.ravel() for one in np.meshgrid(steps, steps))
        while half_m > _FINE_PLACE_M:
            places = (east + half_m * over_e, north + half_m * over_n)
            squares = self.squares(*places)
            first = int(np.argmin(squares))
            east, north = float(places[0][first]), float(places[1][first])
            best, half_m = min(best, float(squares[first])), _ZOOM * half_m
        return best


class _Common:
    def __init__(self, pulse_poses: Sequence[PulsePose], track: VehicleTrack) -> None:
        known = [one for one in pulse_poses if np.isfinite(one.pulse.snr_db)]
        base_ns = known[0].pulse.start_time_ns if known else 0

        def seconds(times_ns: Sequence[int]) -> _Floats:
            return np.array([(time - base_ns) / NANOSECONDS_PER_SECOND for time in times_ns])

        self.time_s = seconds([one.pulse.start_time_ns for one in known])
        self.snr_db = np.array([one.pulse.snr_db for one in known])
        self.tag = np.array([one.pulse.tag_id for one in known])
        self.posed = [one for one in known if one.pose is not None]
        self._posed_s = seconds([one.pulse.start_time_ns for one in self.posed])
        self._yaw = np.array([yaw_deg(p.pose.quaternion_wxyz) for p in self.posed if p.pose])
        first = track.positions[0]
        plane = TangentPlane(latitude_deg=first.latitude_deg, longitude_deg=first.longitude_deg)
        self._place = plane.to_local(
            [one.pose.latitude_deg for one in self.posed if one.pose],
            [one.pose.longitude_deg for one in self.posed if one.pose],
        )
        self._turn_s = seconds([one.time_ns for one in track.attitudes])
        yaw = [yaw_deg(one.quaternion_wxyz) for one in track.attitudes]
        self._track_yaw = np.unwrap(yaw, period=360.0)
        self._place_s = seconds([one.time_ns for one in track.positions])
        self._places = plane.to_local(
            [one.latitude_deg for one in track.positions],
            [one.longitude_deg for one in track.positions],
        )
        self.turn_rate_deg_s = self._turn_rate_deg_s()
        bearing = np.radians(np.arange(0.0, 360.0, 6.0))
        radius = np.geomspace(60.0, 3000.0, 12)
        self._least_covered = 1
        self._grid = [
            (way.mean() + np.outer(radius, turned(bearing))).ravel()
            for way, turned in zip(self._places, (np.sin, np.cos), strict=True)
        ]

    def _turn_rate_deg_s(self) -> float:
        """Median rate of the vehicle's turns [deg/s]; 0 if it never turns."""
        passed = np.diff(self._turn_s)
        rates = np.abs(np.diff(self._track_yaw)[passed > 0.0]) / passed[passed > 0.0]
        turning = rates[rates > _TURNING_DEG_S]
        return float(np.median(turning)) if len(turning) else 0.0

    def pose_misfit(self, offset_s: float, keep: NDArray[np.bool_] | None = None) -> float:
        """Mean misfit at a clock offset: squared errors of heading / 10° and position / 5 m."""
        inside = self._inside(self._posed_s, offset_s)
        if inside is None:
            return np.nan
        inside = inside if keep is None else inside & keep
        times = self._posed_s[inside] - offset_s
        yaw = np.interp(times, self._turn_s, self._track_yaw) - self._yaw[inside]
        # The antenna's own offset is the same all the time.
        turned = np.exp(1j * np.radians(yaw))
        off = np.degrees(np.angle(turned * np.conj(turned.mean())))
        away = [
            np.interp(times, self._place_s, way) - place[inside]
            for way, place in zip(self._places, self._place, strict=True)
        ]
        apart = np.hypot(*away) / 5.0
        return float(np.mean(np.minimum((off / 10.0) ** 2, 9.0) + np.minimum(apart**2, 9.0)))

    def power_misfit(
        self, offset_s: float, antenna: str, keep: NDArray[np.bool_] | None = None
    ) -> float:
        """Mean squared SNR residual at a clock offset [dB²], with each tag's best position.

        Power falls with the square of the distance. The candidate positions are a polar grid
        around the path.
        """
        heard = self._heard(offset_s, antenna, keep)
        if heard is None:
            return np.nan
        total = sum(float(one.squares(*self._grid).min()) for one in heard.values())
        return total / sum(len(one.snr_db) for one in heard.values())

    def sharper_misfit(self, offset_s: float, antenna: str) -> Callable[..., float]:
        """Function like `power_misfit` for nearby offsets, with tags placed to a metre.

        The cells of the polar grid are tens of metres wide, but the bearing of a turn is more
        accurate. Without this step, the best offset would be the one that rotates all bearings
        towards the middle of a cell.
        """
        heard = self._heard(offset_s, antenna) or {}
        cells = [int(np.argmin(one.squares(*self._grid))) for one in heard.values()]
        starts = {
            tag_id: (float(self._grid[0][cell]), float(self._grid[1][cell]))
            for tag_id, cell in zip(heard, cells, strict=True)
        }
        middle = (float(self._places[0].mean()), float(self._places[1].mean()))

        def misfit(offset_s: float, keep: NDArray[np.bool_] | None = None) -> float:
            near = self._heard(offset_s, antenna, keep)
            if near is None:
                return np.nan
            total = sum(one.least(starts[tag], middle) for tag, one in near.items())
            return total / sum(len(one.snr_db) for one in near.values())

        return misfit

    def _heard(
        self, offset_s: float, antenna: str, keep: NDArray[np.bool_] | None = None
    ) -> "dict[int, _TagOnTrack] | None":
        """Pulses of each tag with poses of the track; None if it covers too few."""
        inside = self._inside(self.time_s, offset_s)
        if inside is None:
            return None
        inside = inside if keep is None else inside & keep
        times = self.time_s[inside] - offset_s
        yaw = np.interp(times, self._turn_s, self._track_yaw)
        east, north = (np.interp(times, self._place_s, way) for way in self._places)
        found = {}
        for tag_id in np.unique(self.tag[inside]):
            own = self.tag[inside] == tag_id
            found[int(tag_id)] = _TagOnTrack(
                east_m=east[own],
                north_m=north[own],
                yaw_deg=yaw[own],
                snr_db=self.snr_db[inside][own],
                antenna=antenna,
            )
        return found

    def require_cover(self, offsets_s: _Floats, *, posed: bool) -> None:
        """Exclude offsets at which the track covers less than 80 % of the best one's pulses.

        Raises `UsageError` if even the best offset covers too few pulses for an estimate.
        """
        times_s = self._posed_s if posed else self.time_s
        most = max(int(np.count_nonzero(self.covered(one, posed=posed))) for one in offsets_s)
        remedy = "Check that track and pulses are from one flight, or give --clock-offset"
        if not most:
            raise self._no_overlap(times_s, remedy)
        if most < max(_LEAST_PULSES, _LEAST_SHARE * len(times_s)):
            raise UsageError(
                f"the track covers at most {most} of {len(times_s)} pulses at any clock "
                "offset, too few to find the offset",
                remedy=remedy,
            )
        self._least_covered = math.ceil((1.0 - _MOST_LOST) * most)

    def _no_overlap(self, times_s: _Floats, remedy: str) -> UsageError:
        """Error for logs that do not overlap; names a time zone that would explain it."""
        ahead_s = float(times_s.min()) - max(self._turn_s[0], self._place_s[0])
        zones_s = _ZONES_S * round(ahead_s / _ZONES_S)
        if abs(zones_s) <= _MOST_ZONES_S and self._between(times_s, zones_s).any():
            remedy = (
                "If the clock was set to local time, give "
                f"--clock-offset {zones_s:+.0f}. {remedy}"
            )
        minutes = round(abs(ahead_s) / 60.0)
        duration = (
            f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
        )
        return UsageError(
            f"pulses and track do not overlap, even {SEARCH_S:.0f} s apart: the pulses begin "
            f"{duration} {'after' if ahead_s > 0.0 else 'before'} the track",
            remedy=remedy,
        )

    def _inside(self, times_s: _Floats, offset_s: float) -> NDArray[np.bool_] | None:
        """Mask of the pulses that the track covers; None if there are too few."""
        inside = self._between(times_s, offset_s)
        return inside if np.count_nonzero(inside) >= self._least_covered else None

    def covered(self, offset_s: float, *, posed: bool) -> NDArray[np.bool_]:
        return self._between(self._posed_s if posed else self.time_s, offset_s)

    def _between(self, times_s: _Floats, offset_s: float) -> NDArray[np.bool_]:
        low = max(self._turn_s[0], self._place_s[0]) + offset_s
        high = min(self._turn_s[-1], self._place_s[-1]) + offset_s
        return np.asarray((times_s >= low) & (times_s <= high))
