"""The thesis's ``pulse_pose_log.txt``: 23 columns, one pulse per line, with full precision.

docs/reference/flight-directory.md lists the columns. Unknown values are ``nan``, never zero.
The original system writes six digits (11 m in latitude), and 4294967295 in half of column 10.
"""

import contextlib
import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from uavrt.core.earth.on_earth import is_attitude, place_on_earth
from uavrt.core.errors import FormatError, os_errors_as
from uavrt.core.foreign import TEXT_LOG, read_file
from uavrt.core.messages import DetectionStatus, Pose, Pulse, PulsePose
from uavrt.core.units import NANOSECONDS_PER_SECOND, hz_from_mhz, mhz_from_hz
from uavrt.formats.damaged_lines import DamagedLines

COLUMNS = 23
READ_BYTES = 65_536
_SATURATED = 4_294_967_295
_MISSING = "nan"


def format_line(pulse_pose: PulsePose) -> str:
    """Format one pulse as a line with its newline."""
    pulse, pose = pulse_pose.pulse, pulse_pose.pose
    fields = [
        str(pulse.tag_id),
        f"{mhz_from_hz(pulse.frequency_hz):.9f}",
        *_seconds_nanoseconds(pulse.start_time_ns),
        *_seconds_nanoseconds(pulse.end_time_ns),
        *_seconds_nanoseconds(pulse.predicted_next_start_ns),
        *_seconds_nanoseconds(pulse.predicted_next_end_ns),
        repr(float(pulse.snr_db)),
        repr(float(pulse.score)),
        str(pulse.group_index),
        repr(float(pulse.group_snr_db)),
        str(int(pulse.detection_status != "subthreshold")),
        str(int(pulse.confirmed)),
    ]
    if pose is None:
        fields += [_MISSING] * 7
    else:
        w, x, y, z = pose.quaternion_wxyz
        fields += [f"{pose.latitude_deg:.9f}", f"{pose.longitude_deg:.9f}"]
        fields.append(f"{pose.altitude_amsl_m:.4f}")
        fields += [f"{part:.9f}" for part in (x, y, z, w)]
    return ", ".join(fields) + "\n"


class _Groups:
    """Numbers the pulse groups of each tag, as a log does not contain these numbers.

    A new group begins when the index of the pulse in its group does not increase.
    """

    def __init__(self) -> None:
        self._last: dict[int, tuple[int, int]] = {}

    def numbered(self, found: PulsePose) -> PulsePose:
        """Copy the next pulse of a log and set the number of its group."""
        pulse = found.pulse
        count, before = self._last.get(pulse.tag_id, (0, 1 << 30))
        count += pulse.group_index <= before
        self._last[pulse.tag_id] = count, pulse.group_index
        return replace(found, pulse=replace(pulse, group_sequence=count))


def parse_line(line: str, *, group_sequence: int = 0) -> PulsePose:
    """Parse one line of a log of uavrt or of the thesis; raises `ValueError` for other lines.

    Some fields of a pulse are not among the 23 columns: the caller gives `group_sequence`, the
    rate is 1, and noise and relative altitude are NaN.
    """
    fields = [field.strip() for field in line.split(",")]
    while len(fields) > COLUMNS and not fields[-1]:
        fields.pop()  # what writes tables fills rows, or ends them, with separators
    if len(fields) != COLUMNS:
        raise ValueError(f"the line has {len(fields)} columns instead of {COLUMNS}")
    start_ns, end_ns = _time_ns(fields[2], fields[3]), _time_ns(fields[4], fields[5])
    if start_ns is None or end_ns is None:
        raise ValueError("the pulse has no time")
    confirmed = bool(int(fields[15]))
    status: DetectionStatus = "detected"
    if not int(fields[14]):
        status = "subthreshold"
    elif confirmed:
        status = "confirmed"
    pulse = Pulse(
        tag_id=int(fields[0]),
        frequency_hz=_frequency_hz(fields[1]),
        start_time_ns=start_ns,
        end_time_ns=end_ns,
        snr_db=float(fields[10]),
        group_snr_db=float(fields[13]),
        score=float(fields[11]),
        group_index=int(fields[12]),
        group_sequence=group_sequence,
        noise_psd=math.nan,
        detection_status=status,
        confirmed=confirmed,
        rate=1,
        predicted_next_start_ns=_time_ns(fields[6], fields[7]),
        predicted_next_end_ns=_time_ns(fields[8], fields[9]),
    )
    return PulsePose(pulse=pulse, pose=_pose(fields[16:], (start_ns + end_ns) // 2))


def read_pulse_pose_log(
    path: str | os.PathLike[str], warn: Callable[[str], None] | None = None
) -> tuple[PulsePose, ...]:
    """Read a whole log; damaged lines and an incomplete last line are skipped."""
    with os_errors_as(FormatError, f"cannot read {os.fspath(path)}", "Check the name"):
        text = read_file(path, TEXT_LOG).decode("utf-8-sig", "replace")
    lines = text.split("\n")
    finished, rest = lines[:-1], lines[-1]
    found: list[PulsePose] = []
    damaged = DamagedLines(
        os.fspath(path), "A pulse_pose_log.txt has 23 columns in each line", warn
    )
    groups = _Groups()
    for number, line in enumerate(finished, start=1):
        if not line.strip("\0 \r\t"):
            continue
        try:
            found.append(groups.numbered(parse_line(line)))
        except (ValueError, OverflowError) as error:
            if number == len(finished) and not rest.strip("\0"):
                break
            damaged.add(number, error)
    damaged.report(len(found))
    return tuple(found)


class PulsePoseLog:
    """Appends lines to the log at `path`; the first line creates the file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def append(self, lines: Iterable[str]) -> None:
        """Append lines; if this fails, remove what was written and raise `OSError`."""
        content = memoryview("".join(lines).encode())
        file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        try:
            size = os.fstat(file).st_size
            try:
                while content:
                    content = content[os.write(file, content) :]
            except OSError:
                os.ftruncate(file, size)
                raise
        finally:
            os.close(file)

    def sync(self) -> None:
        """Sync the log to the disk; raises `OSError` on failure."""
        if self._path.exists():
            file = os.open(self._path, os.O_RDONLY | os.O_CLOEXEC)
            try:
                os.fsync(file)
            finally:
                os.close(file)

    def repair(self) -> None:
        """Cut off an unfinished last line; raises `OSError` on failure."""
        if not self._path.exists():
            return
        size = whole = self._path.stat().st_size
        with self._path.open("rb") as file:
            while whole:
                start = max(0, whole - READ_BYTES)
                file.seek(start)
                place = file.read(whole - start).rfind(b"\n")
                if place >= 0:
                    whole = start + place + 1
                    break
                whole = start
        if whole < size:
            os.truncate(self._path, whole)

    def keys(self) -> Iterator[tuple[int, int]]:
        """Yield tag id and start time [ns] of every line; raises `OSError`."""
        for line in self._lines():
            fields = line.split(b",", 4)
            try:
                key = int(fields[0]), int(fields[2]) * NANOSECONDS_PER_SECOND + int(fields[3])
            except (ValueError, IndexError):
                continue
            if max(map(abs, key)) < 1 << 63:
                yield key

    def pulse_poses(self) -> Iterator[PulsePose]:
        """Yield every pulse of the log, with the number of its group; raises `OSError`."""
        groups = _Groups()
        for line in self._lines():
            with contextlib.suppress(ValueError, OverflowError):
                yield groups.numbered(parse_line(line.decode("utf-8", "replace")))

    def _lines(self) -> Iterator[bytes]:
        """Yield the log's lines; a line that is too long is split and then does not parse."""
        if not self._path.exists():
            return
        with self._path.open("rb") as file:
            while line := file.readline(READ_BYTES):
                yield line


def _seconds_nanoseconds(time_ns: int | None) -> tuple[str, str]:
    if time_ns is None:
        return _MISSING, _MISSING
    seconds, nanoseconds = divmod(time_ns, NANOSECONDS_PER_SECOND)
    return str(seconds), str(nanoseconds)


def _time_ns(seconds: str, nanoseconds: str) -> int | None:
    if _MISSING in (seconds, nanoseconds) or int(nanoseconds) == _SATURATED:
        return None
    return int(seconds) * NANOSECONDS_PER_SECOND + int(nanoseconds)


def _frequency_hz(megahertz: str) -> float:
    value = float(megahertz)
    if not math.isfinite(value):
        return math.nan
    return hz_from_mhz(value) if abs(value) < 1e6 else value * 1e6


def _pose(fields: list[str], time_ns: int) -> Pose | None:
    latitude, longitude, altitude, x, y, z, w = map(float, fields)
    # In the thesis's logs a quaternion of zeros means "no telemetry yet".
    if not is_attitude((w, x, y, z)):
        return None
    place = place_on_earth(latitude, longitude)
    if place is None:
        return None
    return Pose(
        time_ns=time_ns,
        latitude_deg=place[0],
        longitude_deg=place[1],
        altitude_amsl_m=altitude,
        altitude_relative_m=math.nan,
        quaternion_wxyz=(w, x, y, z),
    )
