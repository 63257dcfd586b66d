"""Read ArduPilot's onboard log (``.BIN``, DataFlash).

::

    0xA3 0x95 | type | values of that type's format …      little endian
    type 128, FMT: type u8, length u8, name 4, format 16, columns 64 (with commas)

These messages are used: FMT, ATT (roll, pitch, yaw), POS (fused position; else GPS), GPS (week
and milliseconds, for UTC), and EV (armed, landed) if present. Times are microseconds since
boot. GPS time is ahead of UTC by 18 leap seconds since 2017.
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
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.formats.tracks.track import (
    VehicleTrack,
    attitude,
    in_order,
    over_the_first,
    position,
)

MARK = b"\xa3\x95"
_FMT = 128
_CODES = {
    **dict(zip("bBhHiIfdqQ", "bBhHiIfdqQ", strict=True)),
    "c": "h",
    "C": "H",
    "e": "i",
    "E": "I",
    "L": "i",
    "M": "B",
    "g": "e",
    "n": "4s",
    "N": "16s",
    "Z": "64s",
    "a": "64s",
}
_SCALES = {"c": 1e-2, "C": 1e-2, "e": 1e-2, "E": 1e-2, "L": 1e-7}
_GPS_EPOCH_S = 315_964_800
_LEAP_S = 18
_WANTED = frozenset({"ATT", "POS", "GPS", "EV"})
_ARMED = {10: True, 11: False}
_LANDED = {18: True, 28: False}

_Row = dict[str, float]


def read_dataflash(path: Path) -> VehicleTrack:
    """Read a DataFlash log; raises `FormatError` if time, attitude or position is missing."""
    with os_errors_as(FormatError, f"cannot read {path}"):
        content = read_file(path, TRACK)
    rows: dict[str, list[_Row]] = {name: [] for name in _WANTED}
    for name, row in _rows(content):
        rows[name].append(row)
    offset_ns = _utc_of_boot_ns(rows["GPS"])
    if offset_ns is None:
        raise FormatError(
            f"{path} has no GPS time",
            remedy="Record the log with GPS reception, or give a .tlog file",
        )
    fixes = [row for row in rows["GPS"] if row.get("Status", 0) >= 3 and "Lat" in row]
    places = [_position(row, offset_ns) for row in rows["POS"] or fixes]
    turns = [_attitude(row, offset_ns) for row in rows["ATT"]]
    return VehicleTrack(
        kind="DataFlash",
        attitudes=in_order(one for one in turns if one),
        positions=over_the_first(one for one in places if one),
        on_ground_ns=spans_on_ground(
            _states(rows["EV"], _ARMED, offset_ns), _states(rows["EV"], _LANDED, offset_ns)
        ),
    )


def _states(
    rows: list[_Row], states: Mapping[int, bool], offset_ns: int
) -> list[tuple[int, bool]]:
    return [
        (offset_ns + round(row["TimeUS"] * 1e3), states[int(row["Id"])])
        for row in rows
        if "TimeUS" in row and row.get("Id") in states
    ]


def _rows(content: bytes) -> Iterator[tuple[str, _Row]]:
    """Yield the wanted messages of the log; skip unknown bytes up to the next frame marker."""
    formats: dict[int, tuple[str, int, str, list[str]]] = {_FMT: ("FMT", 89, "", [])}
    place = content.find(MARK)
    while 0 <= place <= len(content) - 3:
        known = formats.get(content[place + 2])
        if known is None or place + known[1] > len(content):
            place = content.find(MARK, place + 1)
            continue
        name, length, code, columns = known
        body = content[place + 3 : place + length]
        if name == "FMT":
            _learn(body, formats)
        elif name in _WANTED:
            yield name, _values(body, code, columns)
        following = content[place + length : place + length + 2]
        place = place + length if following == MARK else content.find(MARK, place + length)


def _learn(body: bytes, formats: dict[int, tuple[str, int, str, list[str]]]) -> None:
    kind, length, name, code, columns = struct.unpack("<BB4s16s64s", body)
    texts = [text.rstrip(b"\0").decode("ascii", "replace") for text in (name, code, columns)]
    sizes = [_CODES.get(letter) for letter in texts[1]]
    if length < 3 or None in sizes or kind == _FMT:
        return
    if struct.calcsize("<" + "".join(size or "" for size in sizes)) == length - 3:
        formats[kind] = (texts[0], length, texts[1], texts[2].split(","))


def _values(body: bytes, code: str, columns: list[str]) -> _Row:
    values = struct.unpack("<" + "".join(_CODES[letter] for letter in code), body)
    return {
        name: float(value) * _SCALES.get(letter, 1.0)
        for name, letter, value in zip(columns, code, values, strict=False)
        if not isinstance(value, bytes)
    }


def _utc_of_boot_ns(rows: list[_Row]) -> int | None:
    """UTC at boot [ns]: the smallest difference between GPS time and boot time in the log."""
    found = [
        round(
            (_GPS_EPOCH_S + row["GWk"] * 604_800 - _LEAP_S) * NANOSECONDS_PER_SECOND
            + row["GMS"] * 1e6
            - row["TimeUS"] * 1e3
        )
        for row in rows
        if row.get("GWk", 0) > 1000 and {"GMS", "TimeUS"} <= row.keys()
    ]
    return min(found, default=None)


def _attitude(row: _Row, offset_ns: int) -> AttitudeSample | None:
    angles = [row.get(name, math.nan) for name in ("Yaw", "Pitch", "Roll")]
    if not all(map(math.isfinite, angles)) or "TimeUS" not in row:
        return None
    return attitude(offset_ns + round(row["TimeUS"] * 1e3), from_euler_deg(*angles))


def _position(row: _Row, offset_ns: int) -> PositionSample | None:
    if not {"TimeUS", "Lat", "Lng"} <= row.keys():
        return None
    time_ns = offset_ns + round(row["TimeUS"] * 1e3)
    return position(time_ns, row["Lat"], row["Lng"], row.get("Alt", math.nan))
