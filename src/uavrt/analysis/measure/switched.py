"""Estimate bearings from the samples of a receiver connected to an antenna switch.

The detector finds the pulses as usual. Then their samples are read again from the recording,
whose metadata state the antenna of each sample. A circle of antennas gives a bearing from a
single pulse. Pulses received at one position are combined.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Pose, PulsePose
from uavrt.core.units import SPEED_OF_LIGHT_M_S
from uavrt.dsp.block_times import BlockTimes
from uavrt.localization.bearing.array_bearings import (
    Steering,
    circle_steering,
    pair_steering,
    switched_bearing,
)
from uavrt.localization.bearing.switched_pulse import (
    SwitchedPulse,
    SwitchSchedule,
    measure_switched_pulse,
)
from uavrt.localization.estimates.flight_estimates import TagBearing
from uavrt.localization.headings import Headings
from uavrt.localization.results import ArrayMethod
from uavrt.radio.files.sigmf import sigmf_global
from uavrt.radio.opening import open_recording

SWITCH_KEY = "uavrt:antenna_switch"
"""Name of the antenna switch's entry in SigMF metadata (docs/reference/formats.md)."""
_EDGE = 0.1
"""Share of a pulse's width that is excluded at each end: 2 ms of 20 ms, twice the error of the
measured start."""
_ONE_PLACE_M = 15.0
_METHODS: dict[str, ArrayMethod] = {
    "circle": "pseudo_doppler",
    "pair": "two_point_phased",
    "sum_difference": "two_point_phased",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchedArray:
    """Geometry and switching order of a recording's antenna array."""

    kind: str
    """Type of the switched antenna array: ``circle``, ``pair`` or ``sum_difference``."""
    size_m: float
    """Radius of a circular array, or distance between a pair's antennas [m]."""
    schedule: SwitchSchedule

    @property
    def method(self) -> ArrayMethod:
        """Name of the bearing estimator for this type of array."""
        return _METHODS[self.kind]

    def steering(self, frequency_hz: float) -> Steering:
        """Complex responses of the antennas to a wave, as a function of its direction."""
        size = self.size_m * frequency_hz / SPEED_OF_LIGHT_M_S
        if self.kind == "circle":
            return circle_steering(self.schedule.positions, size)
        return pair_steering(size, modes=self.kind == "sum_difference")


def read_switched_array(recording: str | os.PathLike[str]) -> SwitchedArray:
    """Antenna array in a recording's metadata. Raises `FormatError` if missing or wrong."""
    entry = sigmf_global(Path(recording), SWITCH_KEY)
    if not isinstance(entry, dict):
        raise FormatError(
            f"{os.fspath(recording)} does not specify the antenna of each sample",
            remedy=f"Add {SWITCH_KEY!r} to its metadata, see docs/reference/formats.md",
        )
    try:
        return _array(entry)
    except (KeyError, TypeError, ValueError, UsageError) as error:
        raise FormatError(
            f"{os.fspath(recording)} has an invalid {SWITCH_KEY!r}: {error}",
            remedy="Correct its keys; docs/reference/formats.md lists them",
        ) from None


def _array(entry: dict[str, Any]) -> SwitchedArray:
    kind, size_m = str(entry["kind"]), float(entry["size_m"])
    if kind not in _METHODS:
        raise ValueError(f"kind {kind!r} is not one of {', '.join(_METHODS)}")
    if not 0.0 < size_m < 100.0:
        raise ValueError(f"size_m {size_m:g} must be above 0 and below 100")
    return SwitchedArray(
        kind=kind,
        size_m=size_m,
        schedule=SwitchSchedule(
            positions=int(entry["positions"]),
            dwell_samples=int(entry["dwell_samples"]),
            settle_samples=int(entry.get("settle_samples", 0)),
            first_sample=int(entry.get("first_sample", 0)),
        ),
    )


def switched_bearings(
    recording: str | os.PathLike[str],
    pulse_poses: Sequence[PulsePose],
    *,
    offset_deg: float = 0.0,
) -> list[TagBearing]:
    """Estimate one bearing for each tag from each drone position at which it was received."""
    array = read_switched_array(recording)
    placed = sorted(
        (one for one in pulse_poses if one.pose is not None),
        key=lambda one: one.pulse.start_time_ns,
    )
    if not placed:
        raise UsageError(
            "no pulse has a pose, so headings are unknown",
            remedy="Attach the autopilot's log first: uavrt attach",
        )
    measured = list(_measured(Path(recording), array, placed))
    if not measured:
        raise UsageError(
            "no pulse lies within the time of the recording",
            remedy="Name the recording in which these pulses were detected",
        )
    bearings = []
    for tag_id in sorted({one.pulse.tag_id for one, _ in measured}):
        mine = [(one, what) for one, what in measured if one.pulse.tag_id == tag_id]
        bearings += [_bearing(array, group, offset_deg) for group in _by_place(mine)]
    return bearings


_Measured = tuple[PulsePose, SwitchedPulse]


def _measured(
    recording: Path, array: SwitchedArray, placed: Sequence[PulsePose]
) -> Iterator[_Measured]:
    """Read the recording once, and measure each pulse that it contains completely."""
    source = open_recording(recording)
    try:
        waiting = list(placed)
        kept = np.empty(0, np.complex64)
        first, rate_hz = 0, source.sample_rate_hz
        times = BlockTimes(rate_hz)
        while waiting:
            try:
                block = source.read()
            except EOFError:
                return
            if block is None:
                continue
            if block.lost_before or not len(kept):
                kept, first = np.empty(0, np.complex64), block.sample_index
            times.add(block.sample_index, block.time_ns)
            kept = np.concatenate([kept, block.samples])
            while waiting:
                begin, end = _span(waiting[0], times, rate_hz)
                if end > first + len(kept):
                    kept, first = kept[max(0, begin - first) :], max(first, begin)
                    break
                one = waiting.pop(0)
                if begin < first:
                    continue
                frequency_hz = one.pulse.frequency_hz - source.center_frequency_hz
                yield (
                    one,
                    measure_switched_pulse(
                        kept[begin - first : end - first],
                        array.schedule,
                        first_sample=begin,
                        frequency_hz=frequency_hz,
                        sample_rate_hz=rate_hz,
                    ),
                )
    finally:
        source.close()


def _span(one: PulsePose, times: BlockTimes, rate_hz: float) -> tuple[int, int]:
    """First and last sample index of a pulse without edges; lost samples are counted."""
    width_ns = one.pulse.end_time_ns - one.pulse.start_time_ns
    edge_ns = _EDGE * width_ns
    begin = times.index(one.pulse.start_time_ns + round(edge_ns))
    return round(begin), round(begin + (width_ns - 2.0 * edge_ns) * 1e-9 * rate_hz)


def _by_place(measured: Sequence[_Measured]) -> Iterator[list[_Measured]]:
    group: list[_Measured] = []
    plane: TangentPlane | None = None
    for one in measured:
        pose = _pose(one[0])
        if plane is not None:
            east, north = plane.to_local(pose.latitude_deg, pose.longitude_deg)
            if np.hypot(east, north) > _ONE_PLACE_M:
                yield group
                group, plane = [], None
        if plane is None:
            plane = TangentPlane(
                latitude_deg=pose.latitude_deg, longitude_deg=pose.longitude_deg
            )
        group.append(one)
    if group:
        yield group


def _pose(one: PulsePose) -> Pose:
    assert one.pose is not None
    return one.pose


def _bearing(array: SwitchedArray, group: Sequence[_Measured], offset_deg: float) -> TagBearing:
    poses = [_pose(one) for one, _ in group]
    pulses = [what for _, what in group]
    yaw: NDArray[np.float64] = Headings.from_quaternions(
        [pose.quaternion_wxyz for pose in poses]
    ).yaw_deg
    bearing = switched_bearing(
        np.stack([one.amplitudes for one in pulses]),
        np.stack([one.counts for one in pulses]),
        yaw + offset_deg,
        array.steering(group[0][0].pulse.frequency_hz),
        noise_power=np.array([one.noise_power for one in pulses]),
        method=array.method,
    )
    first_ns = min(one.pulse.start_time_ns for one, _ in group)
    last_ns = max(one.pulse.start_time_ns for one, _ in group)
    return TagBearing(
        tag_id=group[0][0].pulse.tag_id,
        bearing=bearing,
        latitude_deg=float(np.median([pose.latitude_deg for pose in poses])),
        longitude_deg=float(np.median([pose.longitude_deg for pose in poses])),
        altitude_amsl_m=float(np.median([pose.altitude_amsl_m for pose in poses])),
        start_time_ns=first_ns,
        middle_time_ns=(first_ns + last_ns) // 2,
        end_time_ns=max(one.pulse.end_time_ns for one, _ in group),
    )
