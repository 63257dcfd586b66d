"""Compute the signal levels of tags from pulses outside turns, where a receiver kept its
heading.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_180
from uavrt.localization.antenna import MONOPOLE, AntennaPattern, pattern_named
from uavrt.localization.bearing.tuning import TURNS
from uavrt.localization.estimates.heard import PulseColumns, Rhythm
from uavrt.localization.headings import yaws_deg
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.tuning import RECEIVERS

_Floats = NDArray[np.float64]


def strengths_of(
    listener: str,
    pulses: PulseColumns,
    height_m: _Floats,
    on_ground_ns: Sequence[tuple[int, int]],
    antenna: AntennaPattern | str,
    rhythm: Rhythm | None = None,
) -> Strengths:
    """Convert a tag's pulses, in order of time, to signal levels, one for each position and
    heading.

    Pulses received on the ground are excluded. Missed pulses at the times of `rhythm` count as
    strong as the weakest received pulse.
    """
    monopole = antenna == MONOPOLE
    pattern = None if monopole else pattern_named(antenna)
    flown = _off_ground(pulses.time_ns, on_ground_ns)
    yaw = yaws_deg(pulses.quaternion_wxyz)
    stood = [
        part
        for part in _standing(pulses, yaw, flown, one_heading=not monopole)
        if len(part) >= RECEIVERS.least_pulses
    ]
    if not stood:
        why = (
            "the pulses were received on the ground, before or after a flight"
            if len(flown) < len(pulses.time_ns)
            else "fewer than three pulses have the same position and heading"
        )
        return _levels(listener, pulses, yaw, height_m, pattern, [], why)
    clear = [
        part for part in stood if _heard_share(pulses, part, rhythm) >= RECEIVERS.received_share
    ]
    clear = sorted(
        sorted(clear, key=len, reverse=True)[: RECEIVERS.most_places], key=lambda one: one[0]
    )
    missed = None if clear else "more pulses were missed than detected"
    return _levels(listener, pulses, yaw, height_m, pattern, clear, missed, rhythm)


def _off_ground(
    time_ns: NDArray[np.int64], on_ground_ns: Sequence[tuple[int, int]]
) -> NDArray[np.intp]:
    """Indices of the pulses received at times not reported as on the ground."""
    down = np.zeros(len(time_ns), bool)
    for first, last in on_ground_ns:
        down |= (time_ns >= first) & (time_ns <= last)
    return np.flatnonzero(~down)


def _standing(
    pulses: PulseColumns, yaw_deg: _Floats, chosen: NDArray[np.intp], *, one_heading: bool
) -> list[NDArray[np.intp]]:
    if not len(chosen):
        return []
    plane = plane_around(pulses.latitude_deg, pulses.longitude_deg)
    east, north = plane.to_local(pulses.latitude_deg, pulses.longitude_deg)
    cuts, first = [0], int(chosen[0])
    for at, number in enumerate(chosen):
        away = float(np.hypot(east[number] - east[first], north[number] - north[first]))
        turned = abs(wrap_degrees_180(float(yaw_deg[number] - yaw_deg[first])))
        if away > RECEIVERS.one_place_m or (one_heading and turned > TURNS.reversal_deg):
            cuts.append(at)
            first = int(number)
    return [chosen[low:high] for low, high in pairwise([*cuts, len(chosen)])]


def _expected(pulses: PulseColumns, part: NDArray[np.intp], rhythm: Rhythm | None) -> int:
    """Number of pulses that a tag must have sent between the first and the last received pulse,
    both included.
    """
    if rhythm is None:
        return len(part)
    interval_ns = max(rhythm.intervals_s) * NANOSECONDS_PER_SECOND
    span_ns = int(pulses.time_ns[part[-1]] - pulses.time_ns[part[0]])
    return max(len(part), round(span_ns / interval_ns) + 1)


def _heard_share(pulses: PulseColumns, part: NDArray[np.intp], rhythm: Rhythm | None) -> float:
    return len(part) / _expected(pulses, part, rhythm)


def _levels(
    listener: str,
    pulses: PulseColumns,
    yaw_deg: _Floats,
    height_m: _Floats,
    pattern: AntennaPattern | None,
    parts: Sequence[NDArray[np.intp]],
    why: str | None,
    rhythm: Rhythm | None = None,
) -> Strengths:
    def medians(values: _Floats) -> _Floats:
        return np.array([float(np.median(values[part])) for part in parts], np.float64)

    level_db = pulses.snr_db + pulses.noise_db
    levels, sigmas, yaws = [], [], []
    for part in parts:
        heard = level_db[part]
        missed = _expected(pulses, part, rhythm) - len(part)
        whole = np.concatenate([np.full(missed, heard.min()), heard])
        levels.append(float(np.median(whole)))
        spread = float(np.subtract(*np.quantile(heard, [0.84, 0.16]))) / 2.0
        sigmas.append(max(1.0, 1.25 * spread / len(part) ** 0.5))
        turned = np.exp(1j * np.radians(yaw_deg[part]))
        yaws.append(float(np.angle(turned.mean(), deg=True)))
    return Strengths(
        listener=listener,
        pulses=sum(map(len, parts)) if parts else len(pulses.time_ns),
        latitude_deg=medians(pulses.latitude_deg),
        longitude_deg=medians(pulses.longitude_deg),
        height_m=medians(height_m),
        yaw_deg=np.array(yaws),
        level_db=np.array(levels),
        sigma_db=np.array(sigmas),
        antenna=pattern,
        unused=why,
    )
