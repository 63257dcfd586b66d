"""Read a ground station's telemetry log (``.tlog``).

::

    microseconds since 1970, 8 bytes big endian | one MAVLink frame | …

Samples are timed by the autopilot's boot time. UTC comes from SYSTEM_TIME (GPS) if present,
else from the ground station's clock, using the messages with the least delay. A ground station
with several drones writes all of them into one log.
"""

import math
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path

from uavrt.core.earth.attitude import from_euler_deg
from uavrt.core.earth.on_ground import spans_on_ground
from uavrt.core.errors import FormatError, os_errors_as
from uavrt.core.foreign import TRACK, read_file
from uavrt.core.messages import AttitudeSample, PositionSample
from uavrt.formats.tracks.track import VehicleTrack, attitude, in_order
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.pose_samples import attitude_sample, position_sample
from uavrt.link.mavlink.frame import (
    MARKER_V1,
    MARKER_V2,
    SIGNED,
    Frame,
    FrameParser,
    crc16_mcrf4xx,
)

_ATTITUDE_ID, _ATTITUDE_SEED = 30, 39
"""MAVLink id and checksum seed of the message ATTITUDE, which uavrt's message set lacks."""
_AUTOPILOT = 1
"""MAVLink component id of an autopilot."""
_MOST_WRONG = 300_000
"""Maximum number of frame markers without a valid frame; reading stops there."""
_SANE_UNIX_US = 1_400_000_000_000_000


class _Vehicle:
    """Samples of one vehicle of the log."""

    def __init__(self) -> None:
        self.attitudes: dict[str, list[AttitudeSample]] = {"quaternion": [], "euler": []}
        self.positions: list[PositionSample] = []
        self.armed: list[tuple[int, bool]] = []
        self.landed: list[tuple[int, bool]] = []
        self._boot_ns: int | None = None
        """Time since boot of the newest sample [ns]; used for messages without a time."""
        self.ground_offset_ns: int | None = None
        self.gps_offset_ns: int | None = None

    def add(self, frame: Frame, stamp_us: int) -> None:
        message = frame.message()
        self._keep_ground(message)
        if isinstance(message, dialect.SystemTime):
            if message.time_unix_usec > _SANE_UNIX_US:
                offset = message.time_unix_usec * 1000 - message.time_boot_ms * 1_000_000
                self.gps_offset_ns = self.gps_offset_ns or offset
            return
        sample: AttitudeSample | PositionSample | None = None
        if isinstance(message, dialect.AttitudeQuaternion):
            sample = attitude_sample(message, message.time_boot_ms * 1_000_000)
            self._keep(sample, self.attitudes["quaternion"])
        elif isinstance(message, dialect.GlobalPositionInt):
            sample = position_sample(message, message.time_boot_ms * 1_000_000)
            self._keep(sample, self.positions)
        elif frame.message_id == _ATTITUDE_ID:
            sample = _euler(frame)
            self._keep(sample, self.attitudes["euler"])
        if sample is not None:
            self._boot_ns = sample.time_ns
            offset = stamp_us * 1000 - sample.time_ns
            old = self.ground_offset_ns
            self.ground_offset_ns = offset if old is None else min(old, offset)

    def _keep_ground(self, message: object) -> None:
        if self._boot_ns is None:
            return
        if isinstance(message, dialect.Heartbeat):
            armed = bool(message.base_mode & dialect.MavModeFlag.SAFETY_ARMED)
            self.armed.append((self._boot_ns, armed))
        elif isinstance(message, dialect.ExtendedSysState):
            state = message.landed_state
            if state != dialect.MavLandedState.UNDEFINED:
                landed = state == dialect.MavLandedState.ON_GROUND
                self.landed.append((self._boot_ns, landed))

    @staticmethod
    def _keep(sample: object, kept: "list[AttitudeSample] | list[PositionSample]") -> None:
        if sample is not None:
            kept.append(sample)  # type: ignore[arg-type]


def read_tlog(path: Path, vehicle: int | None = None) -> VehicleTrack:
    """Read one vehicle of a telemetry log, by its MAVLink system id; None: the only one.

    Raises `FormatError` if the log is unreadable, contains no MAVLink frame or not this
    vehicle, or contains several and `vehicle` is None.
    """
    with os_errors_as(FormatError, f"cannot read {path}"):
        content = read_file(path, TRACK)
    vehicles: dict[int, _Vehicle] = {}
    empty = True
    for stamp_us, frame in stamped_frames(content):
        empty = False
        if frame.component_id == _AUTOPILOT:
            vehicles.setdefault(frame.system_id, _Vehicle()).add(frame, stamp_us)
    if empty:
        raise FormatError(f"{path} contains no MAVLink frame", remedy="Give a .tlog file")
    log = _chosen(path, vehicles, vehicle)
    offset_ns = log.gps_offset_ns or log.ground_offset_ns or 0
    attitudes = log.attitudes["quaternion"] or log.attitudes["euler"]
    track = VehicleTrack(
        kind="tlog",
        attitudes=in_order(attitudes),
        positions=in_order(log.positions),
        on_ground_ns=spans_on_ground(log.armed, log.landed),
    )
    return track.shifted(offset_ns)


def _chosen(path: Path, vehicles: Mapping[int, _Vehicle], wanted: int | None) -> _Vehicle:
    flown = {number: one for number, one in vehicles.items() if one.positions}
    if wanted is None and len(flown) < 2:
        return next(iter((flown or vehicles).values()), _Vehicle())
    if wanted in flown:
        return flown[wanted]
    names = " and ".join(map(str, sorted(flown))) or "no position of any vehicle"
    if wanted is None:
        raise FormatError(
            f"{path} contains vehicles {names}",
            remedy="Name the one with the receiver with --vehicle",
        )
    raise FormatError(
        f"{path} contains no vehicle {wanted}", remedy=f"The log contains {names}"
    )


def stamped_frames(content: bytes) -> Iterator[tuple[int, Frame]]:
    """Yield all valid frames of a telemetry log, each with its time [microseconds]."""
    parser = FrameParser()
    place = wrong = 0
    while place + 11 <= len(content) and wrong < _MOST_WRONG:
        length = _length(content, place + 8)
        if length is None:
            place += 1  # damaged: look for the next stamp and marker
            continue
        frames = parser.feed(content[place + 8 : place + 8 + length])
        parser.reset()
        if frames:
            yield struct.unpack_from(">Q", content, place)[0], frames[0]
            place += 8 + length
        else:
            place, wrong = place + 1, wrong + 1


def _length(content: bytes, place: int) -> int | None:
    if content[place] == MARKER_V1:
        return 8 + content[place + 1]
    if content[place] == MARKER_V2:
        return 12 + content[place + 1] + (13 if content[place + 2] & SIGNED else 0)
    return None


def _euler(frame: Frame) -> AttitudeSample | None:
    body = frame.raw[1 : len(frame.raw) - 2 - (13 if frame.signed else 0)]
    checked = crc16_mcrf4xx(body + bytes((_ATTITUDE_SEED,)))
    if checked != int.from_bytes(frame.raw[1 + len(body) : 3 + len(body)], "little"):
        return None
    boot_ms, roll, pitch, yaw = struct.unpack("<Ifff", frame.payload.ljust(28, b"\0")[:16])
    if not all(map(math.isfinite, (roll, pitch, yaw))):
        return None
    turned = from_euler_deg(*map(math.degrees, (yaw, pitch, roll)))
    return attitude(boot_ms * 1_000_000, turned)
