"""Write and read the path of a commanded vehicle, in a file from the autopilot to the radio.

The simulated autopilot appends 50 records a second. The simulated radio reads them, so that the
strength of a pulse depends on the drone's true position. A file is used because it outlives
either program and needs no port. After the flight it contains the true path.
"""

import bisect
import math
import struct
from collections.abc import Iterable
from pathlib import Path

from uavrt.core.messages import Pose
from uavrt.core.units import wrap_degrees_180, wrap_degrees_360
from uavrt.simulation.scene.flight import VehicleState
from uavrt.simulation.scene.geometry import TangentPlane, from_euler_deg

_RECORD = struct.Struct("<q4d")
"""Binary layout of a record: time [ns, UTC], latitude, longitude [°], altitude above the sea
[m], heading [°]."""
_AHEAD_S = 0.5
"""Longest extrapolation beyond the last record [s]; a buffer of the radio lasts 0.02 s."""
_STEP_NS = 10_000_000


class PathWriter:
    """Writes a vehicle's path to a new file, which replaces the file of a previous run.

    Raises `OSError` if the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        path.write_bytes(b"")

    def add(self, poses: Iterable[tuple[Pose, float]]) -> None:
        """Append poses of the vehicle, each with its heading [°]."""
        records = [
            _RECORD.pack(
                pose.time_ns,
                pose.latitude_deg,
                pose.longitude_deg,
                pose.altitude_amsl_m,
                heading_deg,
            )
            for pose, heading_deg in poses
        ]
        with self._path.open("ab", buffering=0) as file:
            file.write(b"".join(records))


class FlownPath:
    """Reads the state of the vehicle at a time from the file of its path.

    The last `keep_s` of the path stay in memory.
    """

    def __init__(self, path: Path, plane: TangentPlane, *, keep_s: float | None = None) -> None:
        self._path, self._plane = path, plane
        self._keep_ns = None if keep_s is None else round(keep_s * 1e9)
        self._read_to = 0
        self._times_ns: list[int] = []
        self._places: list[tuple[float, float, float, float]] = []
        """Position north, east and up of home [m], and heading [°], for each record."""

    def state(self, time_ns: int) -> VehicleState | None:
        """State of the vehicle at a time, extrapolated by at most 0.5 s; None before the first
        record.
        """
        if not self._times_ns or self._times_ns[-1] < time_ns:
            self._read()
        if not self._times_ns:
            return None
        north, east, up, heading = self._at(time_ns)
        # A difference over 10 ms on either side.
        before, after = self._at(time_ns - _STEP_NS), self._at(time_ns + _STEP_NS)
        speeds = [(b - a) / (2e-9 * _STEP_NS) for a, b in zip(before, after, strict=True)]
        return VehicleState(
            position_ned_m=(north, east, -up),
            heading_deg=heading,
            quaternion_wxyz=from_euler_deg(0.0, 0.0, heading),
            velocity_ned_m_s=(speeds[0], speeds[1], -speeds[2]),
        )

    def _at(self, time_ns: int) -> tuple[float, float, float, float]:
        times, places = self._times_ns, self._places
        if len(times) == 1:
            return places[0]
        number = min(max(bisect.bisect_right(times, time_ns), 1), len(times) - 1)
        (first, second), span = times[number - 1 : number + 1], 0.0
        end_ns = times[-1] + round(_AHEAD_S * 1e9)
        if second > first:
            span = (min(max(time_ns, times[0]), end_ns) - first) / (second - first)
        a, b = places[number - 1], places[number]
        north, east, up = (x + span * (y - x) for x, y in zip(a[:3], b[:3], strict=True))
        heading = a[3] + span * wrap_degrees_180(b[3] - a[3])
        return north, east, up, wrap_degrees_360(heading)

    def _read(self) -> None:
        try:
            with self._path.open("rb") as file:
                file.seek(self._read_to)
                data = file.read()
        except FileNotFoundError:
            return
        whole = len(data) - len(data) % _RECORD.size
        self._read_to += whole
        for time_ns, latitude, longitude, altitude, heading in _RECORD.iter_unpack(
            data[:whole]
        ):
            if not math.isfinite(latitude + longitude + altitude + heading):
                continue
            north, east = self._plane.to_local(latitude, longitude)
            self._times_ns.append(time_ns)
            self._places.append((north, east, altitude - self._plane.altitude_amsl_m, heading))
        if self._keep_ns is not None and self._times_ns:
            old = bisect.bisect_left(self._times_ns, self._times_ns[-1] - self._keep_ns)
            del self._times_ns[:old], self._places[:old]
