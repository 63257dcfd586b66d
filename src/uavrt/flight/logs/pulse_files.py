"""Write and read pulses as JSON lines or CSV, with the field names of `FIELDS`.

Unknown and non-finite values are ``null`` in JSON and empty cells in CSV. In CSV, a quaternion
is one cell of four numbers with spaces, and the list of other possible tags is one cell.
"""

import csv
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, Literal, TextIO, TypeVar

import msgspec

from uavrt.core.earth.on_earth import is_attitude, place_on_earth
from uavrt.core.errors import FormatError, os_errors_as
from uavrt.core.foreign import TEXT_LOG, read_file
from uavrt.core.messages import BurstInside, Pose, Pulse, PulseKey, PulsePose
from uavrt.flight.database.fields import RecordField, fields_of
from uavrt.formats.csv_line import csv_cells
from uavrt.formats.damaged_lines import DamagedLines

R = TypeVar("R")
PulseFormat = Literal["csv", "jsonl"]

_PULSE = {one.name: one for one in fields_of(Pulse)}
_POSE = {
    one.name: one for one in fields_of(Pose) if one.name != "time_ns" and not one.defaulted
}
PULSE_FIELDS = tuple(name for name, one in _PULSE.items() if not one.defaulted)
POSE_FIELDS = tuple(_POSE)
BURST_FIELDS = ("burst_starts_ns", "burst_snrs_db")
"""Fields of a coded tag's burst; a file without coded tags has no columns for them."""
_INSIDE = fields_of(BurstInside)
DOUBT_FIELDS = tuple(
    name for name, one in _PULSE.items() if one.defaulted and name not in BURST_FIELDS
)
"""Fields of `Pulse` that older files lack. Their columns come last, because programs read
columns by position."""
FIELDS = PULSE_FIELDS + POSE_FIELDS + DOUBT_FIELDS
_KINDS = {name: one.kind for name, one in (_PULSE | _POSE).items()}


def pulse_record(pulse_pose: PulsePose) -> dict[str, Any]:
    """Values of a pulse by field name, as they can be written in JSON."""
    pulse, pose = pulse_pose.pulse, pulse_pose.pose
    record: dict[str, Any] = {name: _known(getattr(pulse, name)) for name in PULSE_FIELDS}
    for name in POSE_FIELDS:
        record[name] = None if pose is None else _known(getattr(pose, name))
    for name in DOUBT_FIELDS:
        record[name] = getattr(pulse, name)
    if pulse.burst_starts_ns:
        for name in BURST_FIELDS:
            record[name] = getattr(pulse, name)
    return record


def inside_record(burst: BurstInside) -> dict[str, Any]:
    """Values of a burst's single pulses by field name, for a JSON line of their own."""
    return {one.name: getattr(burst, one.name) for one in _INSIDE}


def pulse_from_record(record: dict[str, Any]) -> PulsePose:
    """Create a pulse with its pose from values by field name.

    Raises `ValueError`, `KeyError` or `TypeError` for invalid values.
    """
    pulse = _converted(record, Pulse, _PULSE.values())
    time_ns = (pulse.start_time_ns + pulse.end_time_ns) // 2
    return PulsePose(pulse=pulse, pose=_pose_from_record(record, time_ns))


def _pose_from_record(record: dict[str, Any], time_ns: int) -> Pose | None:
    """Antenna pose in a record of a pulse file; None if position or attitude is unknown."""
    if record["quaternion_wxyz"] is None:
        return None
    pose = _converted(record, Pose, _POSE.values(), time_ns=time_ns)
    place = place_on_earth(pose.latitude_deg, pose.longitude_deg)
    if place is None or not is_attitude(pose.quaternion_wxyz):
        return None
    return replace(pose, latitude_deg=place[0], longitude_deg=place[1])


def _converted(
    record: dict[str, Any], kind: type[R], described: Iterable[RecordField], **more: Any
) -> R:
    """Create a record of class `kind` from a line of a file; unknown numbers become NaN.

    Fields that the line lacks get their default values.
    """
    values = {
        one.name: _finite_or_nan(record[one.name]) if one.kind == "real" else record[one.name]
        for one in described
        if not one.defaulted or record.get(one.name) is not None
    }
    return msgspec.convert(values | more, kind, strict=False)


def _finite_or_nan(value: Any) -> float:
    number = math.nan if value is None else float(value)
    return number if math.isfinite(number) else math.nan


class PulseWriter:
    """Writes pulses to a text stream line by line, so that another program can follow.

    The caller opens and closes `stream` (files must be opened with ``newline=""``). With
    `bursts`, a CSV has columns for the single pulses of coded tags' bursts.
    """

    def __init__(self, stream: TextIO, form: PulseFormat, *, bursts: bool = False) -> None:
        self._stream = stream
        self._names = FIELDS + BURST_FIELDS if bursts else FIELDS
        self._csv = csv.writer(stream, lineterminator="\n") if form == "csv" else None
        self.written = 0
        """Number of pulses written to the stream so far."""
        if self._csv is not None:
            self._csv.writerow(self._names)
            stream.flush()

    def write(self, pulse: Pulse | PulsePose) -> None:
        """Write one pulse as a line."""
        if isinstance(pulse, Pulse):
            pulse = PulsePose(pulse=pulse, pose=None)
        record = pulse_record(pulse)
        if self._csv is None:
            self._stream.write(json.dumps(record, allow_nan=False) + "\n")
        else:
            self._csv.writerow([_cell(record.get(name)) for name in self._names])
        self._stream.flush()
        self.written += 1

    def write_inside(self, burst: BurstInside) -> None:
        """Write the single pulses of a burst written before; a CSV file leaves them out."""
        self._stream.write(json.dumps(inside_record(burst), allow_nan=False) + "\n")
        self._stream.flush()


def pulse_format(name: str) -> PulseFormat:
    """Format of a pulse file according to its name: CSV for ``.csv``, otherwise JSON lines.

    For ``-`` (standard output) it is JSON lines.
    """
    return "csv" if name.lower().endswith(".csv") else "jsonl"


def read_pulse_file(
    path: str | os.PathLike[str], warn: Callable[[str], None] | None = None
) -> tuple[PulsePose, ...]:
    """Read pulses that `PulseWriter` wrote; damaged lines are skipped and reported.

    An incomplete last line and a byte order mark are ignored.
    """
    name = os.fspath(path)
    with os_errors_as(FormatError, f"cannot read {name}", "Check the name"):
        content = read_file(path, TEXT_LOG)
    text = content.decode("utf-8-sig", errors="replace")
    if text.count("\ufffd") > len(text) // 100:
        raise FormatError(f"cannot read {name}: it is not text", remedy="Check the name")
    lines = text.split("\n")[:-1]
    is_csv = bool(lines) and lines[0].startswith(FIELDS[0])
    records = _csv_records(lines) if is_csv else _json_records(lines)
    found: list[PulsePose] = []
    insides: dict[PulseKey, BurstInside] = {}
    damaged = DamagedLines(name, "Give a file that `uavrt detect -o` wrote", warn)
    for number, read in records:
        try:
            record = read()
            if "burst_starts_ns" in record and "frequency_hz" not in record:
                burst = _converted(record, BurstInside, _INSIDE)
                insides[burst.key] = burst
            else:
                found.append(pulse_from_record(record))
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            damaged.add(number, error)
    damaged.report(len(found))
    return tuple(_with_inside(item, insides) for item in found) if insides else tuple(found)


def _with_inside(item: PulsePose, insides: dict[PulseKey, BurstInside]) -> PulsePose:
    burst = insides.get(item.pulse.key)
    return item if burst is None else replace(item, pulse=burst.put_into(item.pulse))


def _json_records(lines: list[str]) -> Iterator[tuple[int, Callable[[], dict[str, Any]]]]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield number, lambda line=line: json.loads(line)  # type: ignore[misc]


def _csv_records(lines: list[str]) -> Iterator[tuple[int, Callable[[], dict[str, Any]]]]:
    for number, line in enumerate(lines[1:], start=2):
        if line.strip():
            yield number, lambda line=line: _from_line(lines[0], line)  # type: ignore[misc]


def _from_line(heading: str, line: str) -> dict[str, Any]:
    return _from_cells(csv_cells(heading), csv_cells(line))


def _from_cells(names: list[str], cells: list[str]) -> dict[str, Any]:
    if len(cells) != len(names):
        raise ValueError(f"the line has {len(cells)} columns instead of {len(names)}")
    record: dict[str, Any] = {}
    for name, cell in zip(names, cells, strict=True):
        several = cell and _KINDS.get(name) in ("wholes", "reals")
        record[name] = cell.split() if several else cell or None
    return record


def _known(value: Any) -> Any:
    parts = value if isinstance(value, tuple) else (value,)
    unknown = any(isinstance(part, float) and not math.isfinite(part) for part in parts)
    return None if unknown else value


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return " ".join(map(repr, value))
    return str(value)
