"""Read PX4's onboard log (``.ulg``) with the package pyulog.

Topics are ``vehicle_attitude`` (quaternion), ``vehicle_global_position``, the GPS topics for
UTC, and if present ``vehicle_land_detected`` and ``vehicle_status`` (arming). Times are
microseconds since boot.
"""

import contextlib
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from uavrt.core.earth.on_ground import spans_on_ground
from uavrt.core.errors import FormatError, needs_extra
from uavrt.core.foreign import TRACK, size_of
from uavrt.formats.tracks.track import (
    VehicleTrack,
    attitude,
    in_order,
    over_the_first,
    position,
)

_GPS = ("vehicle_gps_position", "sensor_gps")
_LANDED, _STATUS = "vehicle_land_detected", "vehicle_status"
_TOPICS = ["vehicle_attitude", "vehicle_global_position", _LANDED, _STATUS, *_GPS]
_HEADER_BYTES = 16
_DEFINING = frozenset(bytes((letter,)) for letter in b"FIMPBQ")
_FIELD = re.compile(r"(\w+)(?:\[(\d{1,9})\d*\])? +\w+;")
_MOST_DEFINITIONS, _MOST_FIELDS, _MOST_DEPTH = 50_000, 2_000, 4
_MOST_STEPS = 300_000
"""Maximum number of damaged bytes, or 512-byte pieces, skipped before the end is assumed."""
_ARMED = 2
_SANE_UNIX_US = 1_400_000_000_000_000


def read_ulog(path: Path) -> VehicleTrack:
    """Read a ULog file; raises `FormatError` without GPS time, `UsageError` without pyulog."""
    with needs_extra("analysis", "a log of PX4"):
        from pyulog import ULog
    try:
        TRACK.check_size(size_of(path), path)
        # Open the file here: pyulog leaves an unreadable file open, and prints.
        with path.open("rb") as file, contextlib.redirect_stdout(io.StringIO()):
            _check_formats(file)
            log = ULog(_Damaged(file), _TOPICS)
    except FormatError:
        raise
    except OSError as error:
        raise FormatError(
            f"cannot read {path}: {error.strerror}", remedy="Check the name of the file"
        ) from error
    except Exception as error:
        raise FormatError(
            f"{path} is a damaged ULog file: {error}",
            remedy="Copy it from the autopilot again, or take another flight's",
        ) from error
    topics: dict[str, Any] = {one.name: one.data for one in log.data_list if not one.multi_id}
    offset_us = _utc_of_boot_us(topics)
    if offset_us is None:
        raise FormatError(f"{path} has no GPS time", remedy="Give a log of a flight with GPS")
    turns = topics.get("vehicle_attitude", {"timestamp": ()})
    places = topics.get("vehicle_global_position", {"timestamp": ()})
    attitudes = (
        attitude(
            (int(time) + offset_us) * 1000,
            (
                float(turns["q[0]"][i]),
                float(turns["q[1]"][i]),
                float(turns["q[2]"][i]),
                float(turns["q[3]"][i]),
            ),
        )
        for i, time in enumerate(turns["timestamp"])
    )
    positions = (
        position(
            (int(time) + offset_us) * 1000,
            *(float(places[name][i]) for name in ("lat", "lon", "alt")),
        )
        for i, time in enumerate(places["timestamp"])
    )
    return VehicleTrack(
        kind="ULog",
        attitudes=in_order(one for one in attitudes if one),
        positions=over_the_first(one for one in positions if one),
        on_ground_ns=spans_on_ground(
            _states(topics.get(_STATUS), "arming_state", _ARMED, offset_us),
            _states(topics.get(_LANDED), "landed", 1, offset_us),
        ),
    )


class _Damaged:
    """A log file that reports its end after too many damaged bytes.

    Without this limit, pyulog skips unknown data byte by byte, which takes hours for gigabytes
    of zeros.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._steps = 0
        self.name = file.name

    def read(self, size: int = -1) -> bytes:
        return b"" if self._steps > _MOST_STEPS else self._file.read(size)

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move the read position; backward steps, which only damage causes, are counted."""
        if whence == 1 and offset < 0:
            self._steps += 1
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def close(self) -> None:
        self._file.close()


def _check_formats(file: BinaryIO) -> None:
    """Raise `ValueError` for records with more fields than memory can hold. Definitions ``F``
    (``name:type field;type[9] field;…``) precede the data; a type may be another definition.
    """
    fields: dict[str, list[tuple[str, int]]] = {}
    file.seek(_HEADER_BYTES)
    for _ in range(_MOST_DEFINITIONS):
        head = file.read(3)
        if len(head) < 3 or head[2:] not in _DEFINING:
            break
        body = file.read(int.from_bytes(head[:2], "little"))
        if head[2:] == b"F":
            name, _, listed = body.decode("ascii", "replace").partition(":")
            fields[name] = [
                (kind, min(int(count or 1), _MOST_FIELDS))
                for kind, count in _FIELD.findall(listed)
            ]
    file.seek(0)

    def size(kind: str, depth: int = 0) -> int:
        if depth > _MOST_DEPTH:
            raise ValueError("the record types are nested too deeply")
        total = 0
        for inner, count in fields.get(kind, []):
            total += count * (size(inner, depth + 1) if inner in fields else 1)
            if total > _MOST_FIELDS:
                raise ValueError(f"a record {kind[:40]!r} has more than {_MOST_FIELDS} fields")
        return total

    for topic in _TOPICS:
        size(topic)


def _states(
    data: Mapping[str, Sequence[Any]] | None, name: str, yes: int, offset_us: int
) -> list[tuple[int, bool]]:
    """Times [ns] of a topic, each with True if field `name` is `yes`; empty if not logged."""
    if data is None or name not in data:
        return []
    pairs = zip(data["timestamp"], data[name], strict=True)
    return [((int(time) + offset_us) * 1000, int(state) == yes) for time, state in pairs]


def _utc_of_boot_us(topics: dict[str, Any]) -> int | None:
    """UTC at boot [µs]: the smallest difference between GPS time and boot time in the log."""
    for name in _GPS:
        data = topics.get(name)
        if data is not None and "time_utc_usec" in data:
            pairs = zip(data["time_utc_usec"], data["timestamp"], strict=True)
            found = [int(utc) - int(boot) for utc, boot in pairs if utc > _SANE_UNIX_US]
            if found:
                return min(found)
    return None
