"""Find the times at which a flight has samples for a tag; a tag cannot be found at other times.

A channel's ring buffer overwrites its oldest samples, recording stops when the storage is full,
and a recording may be shorter than the flight.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies

Stretch = tuple[int, int]
"""Start and end of a span of time with samples [ns, UTC]."""
_SECOND = NANOSECONDS_PER_SECOND
_COMPLETE_SHARE = 0.95
"""Share of the flight with samples above which messages do not mention the missing samples."""
_POSELESS_SHARE = 0.02
_POSE_REACH_NS = 2 * _SECOND


def listened_in(energies: SlotEnergies) -> tuple[Stretch, ...]:
    """Return the time spans [ns, UTC], in whole seconds, in which samples exist for at least
    half of each second.
    """
    per_second = max(1, round(1.0 / energies.slot_s))
    seconds = len(energies.heard) // per_second
    heard = energies.heard[: seconds * per_second].reshape(seconds, per_second)
    edges = np.diff(np.concatenate(([0], (heard.mean(axis=1) >= 0.5).astype(int), [0])))
    length_ns = per_second * energies.slot_s * _SECOND
    return tuple(
        (
            energies.start_ns + round(first * length_ns),
            energies.start_ns + round(end * length_ns),
        )
        for first, end in zip(
            np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist(), strict=True
        )
    )


def within(time_ns: NDArray[np.float64], stretches: Sequence[Stretch]) -> NDArray[np.bool_]:
    """Mask of the times that lie in any of the given time spans."""
    inside = np.zeros(len(time_ns), bool)
    for begin, end in stretches:
        inside |= (time_ns >= begin) & (time_ns < end)
    return inside


def missing_in_words(share: float) -> tuple[str, ...]:
    """Sentence on the share of the flight that has samples; empty if nearly all."""
    if share >= _COMPLETE_SHARE:
        return ()
    return (f"samples exist for only {share:.0%} of the flight, and the rest was not searched",)


def with_poses(energies: SlotEnergies, poses: PoseColumns) -> SlotEnergies:
    """Exclude pulse energies measured over 2 s from any pose: the position is unknown."""
    time_ns = energies.start_ns + np.rint(energies.time_s * _SECOND).astype(np.int64)
    away = _away_from_poses(time_ns, poses)
    return energies.where(~away) if away.any() else energies


def _away_from_poses(time_ns: NDArray[np.int64], poses: PoseColumns) -> NDArray[np.bool_]:
    at = np.clip(np.searchsorted(poses.time_ns, time_ns), 1, len(poses.time_ns) - 1)
    before, after = poses.time_ns[at - 1], poses.time_ns[at]
    apart = np.minimum(np.abs(after - time_ns), np.abs(time_ns - before))
    return np.asarray(apart > _POSE_REACH_NS)


def limits_of(energies: SlotEnergies, poses: PoseColumns) -> tuple[str, ...]:
    """Sentences about samples without a pose and times of the flight without samples."""
    seconds = np.concatenate(
        [np.arange(*one, _SECOND) for one in listened_in(energies)] or [np.zeros(0, np.int64)]
    )
    first_ns, last_ns = int(poses.time_ns[0]), int(poses.time_ns[-1])
    inside = np.count_nonzero((seconds >= first_ns) & (seconds <= last_ns))
    missing = missing_in_words(float(inside) * _SECOND / max(last_ns - first_ns, _SECOND))
    away = _away_from_poses(seconds, poses)
    poseless = float(away.mean()) if len(seconds) else 0.0
    if poseless <= _POSELESS_SHARE:
        return missing
    return (
        *missing,
        f"{poseless:.0%} of the samples have no pose within {_POSE_REACH_NS // _SECOND} s "
        "and are left out",
    )
