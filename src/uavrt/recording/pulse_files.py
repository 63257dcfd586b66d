"""Pulses as JSON lines or CSV, one record each, with the field names of `FIELDS`.

What is unknown is ``null`` in JSON and an empty cell in CSV; a number that is not finite is
unknown too. In CSV the quaternion is one cell with four numbers between spaces, and so are the
other tags that a pulse may be of.
"""

import csv
import json
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal, TextIO, get_args

from uavrt.errors import FormatError
from uavrt.messages import DetectionStatus, Pose, Pulse, PulsePose
from uavrt.recording.csv_line import csv_cells
from uavrt.recording.damaged_lines import DamagedLines

PulseFormat = Literal["csv", "jsonl"]

PULSE_FIELDS = (
    "tag_id",
    "frequency_hz",
    "start_time_ns",
    "end_time_ns",
    "snr_db",
    "group_snr_db",
    "score",
    "group_index",
    "group_sequence",
    "noise_psd",
    "detection_status",
    "confirmed",
    "rate",
    "predicted_next_start_ns",
    "predicted_next_end_ns",
)
POSE_FIELDS = (
    "latitude_deg",
    "longitude_deg",
    "altitude_amsl_m",
    "altitude_relative_m",
    "quaternion_wxyz",
)
DOUBT_FIELDS = ("also_possible_tag_ids", "ghost_of_tag_id", "clipped")
"""Last, for programs that go by the place of a column; files of older versions have none."""
FIELDS = PULSE_FIELDS + POSE_FIELDS + DOUBT_FIELDS


def pulse_record(pulse_pose: PulsePose) -> dict[str, Any]:
    """One record by field names, ready for JSON."""
    pulse, pose = pulse_pose.pulse, pulse_pose.pose
    record: dict[str, Any] = {name: _known(getattr(pulse, name)) for name in PULSE_FIELDS}
    for name in POSE_FIELDS:
        record[name] = None if pose is None else _known(getattr(pose, name))
    for name in DOUBT_FIELDS:
        record[name] = getattr(pulse, name)
    return record


def pulse_from_record(record: dict[str, Any]) -> PulsePose:
    """Pulse with pose of a record.

    Raises
    ------
    ValueError, KeyError, TypeError
        A field is missing or of the wrong kind.
    """
    optional = {"predicted_next_start_ns", "predicted_next_end_ns"}
    values: dict[str, Any] = {}
    for name in PULSE_FIELDS:
        value = record[name]
        if name == "detection_status":
            if value not in get_args(DetectionStatus):
                raise ValueError(f"detection_status {value!r} is unknown")
        elif name == "confirmed":
            if not isinstance(value, bool):
                raise ValueError("confirmed must be true or false")
        elif name in ("frequency_hz", "snr_db", "group_snr_db", "score", "noise_psd"):
            value = _float(value)
        elif value is not None or name not in optional:
            value = int(value)
        values[name] = value
    original = record.get("ghost_of_tag_id")
    pulse = Pulse(
        **values,
        also_possible_tag_ids=tuple(map(int, record.get("also_possible_tag_ids") or ())),
        ghost_of_tag_id=None if original is None else int(original),
        clipped=bool(record.get("clipped")),
    )
    if record["latitude_deg"] is None or record["quaternion_wxyz"] is None:
        return PulsePose(pulse=pulse, pose=None)
    w, x, y, z = map(float, record["quaternion_wxyz"])
    pose = Pose(
        time_ns=(pulse.start_time_ns + pulse.end_time_ns) // 2,
        latitude_deg=float(record["latitude_deg"]),
        longitude_deg=_float(record["longitude_deg"]),
        altitude_amsl_m=_float(record["altitude_amsl_m"]),
        altitude_relative_m=_float(record["altitude_relative_m"]),
        quaternion_wxyz=(w, x, y, z),
    )
    return PulsePose(pulse=pulse, pose=pose)


class PulseWriter:
    """Writes pulses to a text stream, a line at a time, so that a reader can follow.

    Parameters
    ----------
    stream : text stream
        Where to; the caller opens and closes it (files with ``newline=""``).
    form : {"csv", "jsonl"}
        The format.
    """

    def __init__(self, stream: TextIO, form: PulseFormat) -> None:
        self._stream = stream
        self._csv = csv.writer(stream, lineterminator="\n") if form == "csv" else None
        self.written = 0
        """Pulses written."""
        if self._csv is not None:
            self._csv.writerow(FIELDS)
            stream.flush()

    def write(self, pulse: Pulse | PulsePose) -> None:
        """Write a pulse."""
        if isinstance(pulse, Pulse):
            pulse = PulsePose(pulse=pulse, pose=None)
        record = pulse_record(pulse)
        if self._csv is None:
            self._stream.write(json.dumps(record, allow_nan=False) + "\n")
        else:
            self._csv.writerow([_cell(record[name]) for name in FIELDS])
        self._stream.flush()
        self.written += 1


def pulse_format(name: str) -> PulseFormat:
    """Tell the format by a file's name: CSV when it ends so, else JSON lines (also ``-``)."""
    return "csv" if name.lower().endswith(".csv") else "jsonl"


def read_pulse_file(path: str | os.PathLike[str]) -> tuple[PulsePose, ...]:
    """Read pulses that `PulseWriter` wrote; an unfinished last line is passed over.

    Damaged lines among good ones are passed over, too, and told in the log.

    Raises
    ------
    FormatError
        The file cannot be read, or more lines are no pulses than are.
    """
    name = os.fspath(path)
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise FormatError(f"cannot read {name}: {error}", remedy="Check the name") from error
    text = content.decode("utf-8", errors="replace")
    if text.count("\ufffd") > len(text) // 100:
        raise FormatError(f"cannot read {name}: it is no text", remedy="Check the name")
    lines = text.split("\n")[:-1]
    is_csv = bool(lines) and lines[0].startswith(FIELDS[0])
    records = _csv_records(lines) if is_csv else _json_records(lines)
    found: list[PulsePose] = []
    damaged = DamagedLines(name, "Give a file that `uavrt detect -o` wrote")
    for number, read in records:
        try:
            found.append(pulse_from_record(read()))
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            damaged.add(number, error)
    damaged.judge(len(found))
    return tuple(found)


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
    record: dict[str, Any] = {}
    for name, cell in zip(names, cells, strict=True):
        if name in ("confirmed", "clipped"):
            record[name] = {"true": True, "false": False}.get(cell)
        elif name in ("quaternion_wxyz", "also_possible_tag_ids") and cell:
            record[name] = cell.split()
        else:
            record[name] = cell or None
    return record


def _float(value: Any) -> float:
    return math.nan if value is None else float(value)


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
