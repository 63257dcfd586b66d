"""Surveys with a monopole: where a tag is from its strength alone, and where it was loudest.

Without a directional antenna there are no bearings. The pulses that were heard along the
flight, and those that must have come and were not heard, give a position; the loudest place is
named for what it is (`uavrt.localization.position.strongest`).
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.errors import UsageError
from uavrt.localization import (
    ONE_FLIGHT_S,
    PoseColumns,
    Position,
    PowerTrack,
    SignalSection,
    SignalSurface,
    StrongestSignal,
    height_bands,
    in_band,
    signal_section,
    signal_surface,
    strongest_signal,
)
from uavrt.messages import PulsePose, Tag
from uavrt.units import NANOSECONDS_PER_SECOND

MISS_THRESHOLD_DB = 13.0
"""SNR from which a pulse that a detector was following is not missed."""
_LEAST_HEIGHT_M = 2.0
"""The antenna over the tag: a drone that stands still hears with its feet."""

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeightBand:
    """How strong a tag was in a layer of heights, and where."""

    low_m: float
    """Above the start."""
    high_m: float
    pulses: int
    median_db: float
    best_db: float
    strongest: StrongestSignal
    surface: SignalSurface | None
    """None when this layer covers no area."""

    @property
    def name(self) -> str:
        """The heights in words."""
        return f"{self.low_m:.0f}–{self.high_m:.0f} m"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagSignal:
    """What the strength of one tag says by itself."""

    tag_id: int
    track: PowerTrack
    strongest: StrongestSignal | None
    surface: SignalSurface | None
    """Colours of the ground; None when the flight covers no area."""
    heights: tuple[HeightBand, ...]
    """The layers that were flown, lowest first, those with three pulses or more."""
    section: SignalSection | None = None
    """From the side, around the tag's position; None when it was flown at one height."""

    @property
    def layers(self) -> tuple[HeightBand, ...]:
        """Layers with a map of their own, where there are several of them to tell apart."""
        mapped = tuple(one for one in self.heights if one.surface is not None)
        return mapped if len(mapped) > 1 else ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardStrength:
    """Pulses of one tag that were heard at known places, in order of time."""

    time_ns: NDArray[np.int64]
    latitude_deg: _Floats
    longitude_deg: _Floats
    height_m: _Floats
    """Above the start; NaN where nobody knows."""
    snr_db: _Floats
    rate: NDArray[np.int64]

    @classmethod
    def of(cls, pulse_poses: Sequence[PulsePose]) -> "HeardStrength":
        """Put pulses into columns; those without pose or strength are passed over."""
        heard = [
            (one.pulse, one.pose)
            for one in pulse_poses
            if one.pose and math.isfinite(one.pulse.snr_db)
        ]
        return cls(
            time_ns=np.array([pulse.start_time_ns for pulse, _ in heard], np.int64),
            latitude_deg=np.array([pose.latitude_deg for _, pose in heard]),
            longitude_deg=np.array([pose.longitude_deg for _, pose in heard]),
            height_m=np.array([pose.altitude_relative_m for _, pose in heard], np.float64),
            snr_db=np.array([pulse.snr_db for pulse, _ in heard]),
            rate=np.array([pulse.rate for pulse, _ in heard], np.int64),
        )


def power_track(
    heard: HeardStrength,
    tag: Tag | None,
    poses: PoseColumns,
    *,
    height_m: float | None = None,
) -> PowerTrack:
    """Collect a tag's pulses along the flight, missed ones included.

    Parameters
    ----------
    heard : HeardStrength
        Its pulses.
    tag : Tag, optional
        With it, pulses that must have come between two heard ones count as missed.
    poses : PoseColumns
        Of the vehicle: where the missed ones would have been heard.
    height_m : float, optional
        Over the tag, where the poses do not tell their height above the start.

    Raises
    ------
    UsageError
        Fewer than three pulses were heard at a known place, or no height is known.
    """
    count = len(heard.time_ns)
    if count < 3:
        raise UsageError(
            f"heard {count} times at a known place",
            remedy="At least three pulses are needed",
        )
    columns = [heard.latitude_deg, heard.longitude_deg, heard.height_m, heard.snr_db]
    times_ns = heard.time_ns
    missed_ns = _missed_times_ns(times_ns.tolist(), heard.rate.tolist(), tag)
    if missed_ns and len(poses.time_ns) > 1:
        columns = [
            np.append(own, added)
            for own, added in zip(columns, _between(poses, missed_ns), strict=True)
        ]
        times_ns = np.append(times_ns, np.array(missed_ns, np.int64))
    order = np.argsort(times_ns, kind="stable")
    latitude, longitude, height, snr = (column[order] for column in columns)
    times_ns = times_ns[order]
    times_s = (times_ns - times_ns[0]) / NANOSECONDS_PER_SECOND
    if height_m is not None:
        height = np.where(np.isfinite(height), height, height_m)
    if not np.isfinite(height).all():
        raise UsageError(
            "the log contains no heights above the ground",
            remedy="Give the drone's height above the tags: --height 40",
        )
    return PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.maximum(height, _LEAST_HEIGHT_M),
        snr_db=snr,
        threshold_db=MISS_THRESHOLD_DB,
        time_s=times_s if times_s[-1] <= ONE_FLIGHT_S else None,
        origin_ns=int(times_ns[0]),
    )


def signal_of(tag_id: int, track: PowerTrack, position: Position | None = None) -> TagSignal:
    """Draw what a track says of strength alone, from the side around a position if any."""
    strongest = strongest_signal(track)
    place = strongest if position is None else position
    section = None
    with suppress(UsageError):
        section = signal_section(track, place.latitude_deg, place.longitude_deg)
    return TagSignal(
        tag_id=tag_id,
        track=track,
        strongest=strongest,
        surface=_surface(track),
        heights=tuple(_heights(track)),
        section=section,
    )


def _surface(track: PowerTrack) -> SignalSurface | None:
    try:
        return signal_surface(track)
    except UsageError:
        return None


def _missed_times_ns(
    times_ns: Sequence[int], rates: Sequence[int], tag: Tag | None
) -> list[int]:
    """When pulses must have come between two heard ones that are whole intervals apart."""
    missed: list[int] = []
    if tag is None:
        return missed
    for (before, after), rate in zip(pairwise(times_ns), rates, strict=False):
        number = min(max(rate, 1), len(tag.pulse_intervals_s))
        interval_ns = tag.pulse_intervals_s[number - 1] * NANOSECONDS_PER_SECOND
        count = round((after - before) / interval_ns)
        tolerance_ns = (
            NANOSECONDS_PER_SECOND * tag.interval_uncertainty_s * count + 0.1 * interval_ns
        )
        if count > 1 and abs(after - before - count * interval_ns) <= tolerance_ns:
            step = (after - before) / count
            missed += [before + round(step * index) for index in range(1, count)]
    return missed


def _between(poses: PoseColumns, times_ns: Sequence[int]) -> tuple[_Floats, ...]:
    """Latitude, longitude and height at some times, and NaN for the strength."""
    known, wanted = poses.time_ns.astype(np.float64), np.array(times_ns, np.float64)
    columns = (
        poses.latitude_deg,
        np.unwrap(poses.longitude_deg, period=360.0),
        poses.height_m,
    )
    return (
        *(np.interp(wanted, known, values) for values in columns),
        np.full(len(times_ns), math.nan),
    )


def _heights(track: PowerTrack) -> list[HeightBand]:
    found = []
    for low, high in height_bands(track.height_m[~np.isnan(track.snr_db)]):
        part = in_band(track, (low, high))
        snr = part.snr_db[~np.isnan(part.snr_db)]
        if len(snr) >= 3:
            found.append(
                HeightBand(
                    low_m=low,
                    high_m=high,
                    pulses=len(snr),
                    median_db=float(np.median(snr)),
                    best_db=float(snr.max()),
                    strongest=strongest_signal(part),
                    surface=_surface(part),
                )
            )
    return found
