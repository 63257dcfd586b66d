"""Pulse CSV of TagTracker, the newer custom QGroundControl: every variant that was flown.

A row has one pulse and begins with the tunnel's command number; ``#`` lines are headings, of
which four forms exist. The cells of a row ``7``::

    7, tag_id, frequency_hz, start_time_s, predict_next_start_s, snr, stft_score,
       group_seq_counter, group_ind, group_snr, [noise_psd,]
       detection_status, confirmed_status, latitude, longitude, altitude_rel,
       roll, pitch, yaw  |  orientation_x, _y, _z, _w     [, antenna_offset]

docs/reference/formats.md lists the variants, with 19 to 21 columns. They are distinguished by
what fits *every* row, not by their count: a quaternion has length 1, states are small whole
numbers. Programs that write tables pad short rows with empty cells, zeros or ``NaN``.

A row ``20`` (since September 2026, 23 columns) comes from the detector in Python::

    20, collection_id, slice_id, tag_id, frequency_hz, cycle_counter, start, predict, snr,
        score_ratio, signal_psd, noise_psd, detection_status, confirmed_status, rate_state,
        candidate_id, latitude, longitude, altitude_rel, roll, pitch, yaw, antenna_offset

Rows ``10`` and ``11`` mark where a rotation starts and stops: latitude, longitude, altitude
AMSL. The antenna's offset is applied here, once.
"""

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TextIO, get_args

from uavrt.core.earth.attitude import Quaternion, euler_deg, from_euler_deg, normalised, product
from uavrt.core.earth.on_earth import is_attitude
from uavrt.core.errors import FormatError
from uavrt.core.messages import DetectionStatus, Pose, Pulse, PulsePose
from uavrt.formats.pulses.pulse_log import PulseLog, RotationMark, ungrouped_pulse
from uavrt.formats.text import (
    cells_of,
    finite,
    latitude,
    longitude,
    number_or_nan,
    place_or_none,
    read_lines,
    seconds_ns,
    seconds_text,
    whole,
    with_commas,
    wrong_line,
)

HEADER = (
    "# 7, tag_id, frequency_hz, start_time_seconds, predict_next_start_seconds, snr, "
    "stft_score, group_seq_counter, group_ind, group_snr, noise_psd, detection_status, "
    "confirmed_status, latitude, longitude, altitude_rel, roll_deg, pitch_deg, yaw_deg, "
    "antenna_offset"
)
PLACEHOLDER_DB = -9999.0
"""Value that TagTracker writes for an unknown SNR [dB]."""
STATUSES: tuple[DetectionStatus, ...] = get_args(DetectionStatus)
"""Detection statuses by their number in TagTracker's log; 3, integrated, is uavrt's own."""
_NORM_TOLERANCE = 2e-3
"""Maximum deviation of a quaternion's length from 1. Six decimals would allow 1e-6, but
TagTracker computes in single precision."""
_MARKS = {"10": "start", "11": "stop"}
_REMEDY = "Rows of a TagTracker pulse CSV begin with 7, 10, 11 or 20"


@dataclass(frozen=True, slots=True)
class _Layout:
    """Order of the cells in rows of kind 7; a cell with the antenna's offset may come last."""

    noise: bool
    quaternion: bool

    @property
    def least_columns(self) -> int:
        """Minimum number of columns: up to the last cell of the attitude."""
        return 15 + self.noise + (4 if self.quaternion else 3)

    def fits(self, cells: Sequence[str]) -> bool | None:
        """True if a row fits this layout; None if its attitude is missing, so it is unknown."""
        try:
            states = [finite(cell) for cell in cells[10 + self.noise : 12 + self.noise]]
            attitude = self.attitude(cells)
            self.offset_deg(cells)
        except (ValueError, IndexError):
            return False
        if any(state not in (0, 1, 2, 3) for state in states):
            return False
        length = math.hypot(*attitude)
        if math.isnan(length) or (self.quaternion and length == 0.0):
            return None
        return not self.quaternion or abs(length - 1.0) < _NORM_TOLERANCE

    def attitude(self, cells: Sequence[str]) -> list[float]:
        """Quaternion, or roll, pitch and yaw, as written; NaN for unknown values."""
        return [number_or_nan(cell) for cell in cells[15 + self.noise : self.least_columns]]

    def offset_deg(self, cells: Sequence[str]) -> float:
        """Offset of the antenna [deg], in the last cell after the attitude; 0 if missing."""
        if len(cells) < self.least_columns:
            raise ValueError(f"the row has {len(cells)} columns, fewer than other rows")
        said = [cell for cell in cells[self.least_columns :] if not _is_padding(cell)]
        if len(said) > 1:
            raise ValueError(f"the row has {len(cells)} columns, more than other rows")
        return finite(said[0]) if said else 0.0


def _is_padding(cell: str) -> bool:
    """True if a cell after the last value only fills the row: empty, NaN or zero."""
    if not cell or cell.lower() == "nan":
        return True
    try:
        return float(cell) == 0.0
    except ValueError:
        return False


# Quaternions first: three angles and an offset are not of length 1 in every row of a log.
_LAYOUTS = [
    _Layout(noise, quaternion) for quaternion in (True, False) for noise in (True, False)
]


def read_tagtracker(path: str | os.PathLike[str]) -> PulseLog:
    """Read a pulse CSV of TagTracker; raises `FormatError` with the number of a bad row."""
    lines = with_commas(read_lines(path))
    rows = [(number, _cells(line)) for number, line in enumerate(lines, start=1)]
    rows = [(number, cells) for number, cells in rows if cells and not is_heading(cells)]
    layout = _layout([cells for _, cells in rows if cells[0] == "7"], path)
    found: list[PulsePose] = []
    marks: list[RotationMark] = []
    nothing = 0
    for number, cells in rows:
        try:
            if cells[0] in _MARKS:
                marks.append(_mark(cells, len(found)))
            elif cells[0] == "7" and layout is not None:
                found.append(_pulse_7(cells, layout))
            elif cells[0] == "20":
                pulse = _pulse_20(cells)
                nothing += pulse is None
                found += [] if pulse is None else [pulse]
            else:
                raise ValueError(f"rows that begin with {cells[0][:20]!r} are unknown")
        except (ValueError, IndexError, OverflowError) as error:
            if number == len(lines) and found:
                break  # cut off while it was written
            raise wrong_line(path, number, error, _REMEDY) from None
    return PulseLog(
        kind="tagtracker",
        pulse_poses=tuple(found),
        marks=tuple(marks),
        warnings=tuple(_warnings(found, layout)),
        passed_over=nothing,
    )


def write_tagtracker(stream: TextIO, pulse_poses: Iterable[PulsePose]) -> None:
    """Write a pulse CSV as TagTracker does, with rows of kind 7.

    Pulses without a pose are left out: the format has no value for "unknown", and zeros would
    be a place in the Atlantic.
    """
    stream.write(HEADER + "\n")
    for one in pulse_poses:
        if one.pose is not None:
            stream.write(_line(one.pulse, one.pose) + "\n")


def _line(pulse: Pulse, pose: Pose) -> str:
    predicted = pulse.predicted_next_start_ns
    yaw, pitch, roll = euler_deg(pose.quaternion_wxyz)
    status = STATUSES.index(pulse.detection_status)
    return ", ".join(
        [
            *("7", str(pulse.tag_id), str(round(_zero_for_nan(pulse.frequency_hz)))),
            seconds_text(pulse.start_time_ns),
            "0.000000" if predicted is None else seconds_text(predicted),
            *(_six(value) for value in (pulse.snr_db, pulse.score)),
            *(str(pulse.group_sequence), str(pulse.group_index), _six(pulse.group_snr_db)),
            f"{_zero_for_nan(pulse.noise_psd):.7g}",
            *(str(status), str(int(pulse.confirmed))),
            # The original writes 6 decimals, 0.11 m; two more do no harm.
            *(f"{value:.8f}" for value in (pose.latitude_deg, pose.longitude_deg)),
            _six(_zero_for_nan(pose.altitude_relative_m)),
            *(_six(angle) for angle in (roll, pitch, yaw, 0.0)),
        ]
    )


def _zero_for_nan(value: float) -> float:
    """Replace NaN by 0, which TagTracker writes for an unknown frequency, noise or height."""
    return 0.0 if math.isnan(value) else value


def _six(value: float) -> str:
    return f"{PLACEHOLDER_DB if math.isnan(value) else value:.6f}"


def is_heading(cells: Sequence[str]) -> bool:
    """True if a row of a TagTracker log contains column names, with or without ``#``."""
    return cells[0][:1] == "#" or ("tag_id" in cells[1:] and not cells[0].isdigit())


def row_kind(cell: str) -> str:
    """Command number at the start of a TagTracker row: ``7``, or written as ``7.000000``."""
    try:
        number = float(cell)
    except ValueError:
        return cell
    return str(int(number)) if number in (7, 10, 11, 20) else cell


def _cells(line: str) -> list[str]:
    cells = cells_of(line)
    return [row_kind(cells[0]), *cells[1:]] if cells else cells


def _layout(rows: Sequence[Sequence[str]], path: str | os.PathLike[str]) -> _Layout | None:
    if not rows:
        return None
    whole_rows = rows if len(rows) == 1 else rows[:-1]  # the last may be cut off
    for layout in _LAYOUTS:
        fitting = [layout.fits(cells) for cells in whole_rows]
        if True in fitting and False not in fitting:
            return layout
    counts = sorted({len(cells) for cells in rows})
    raise FormatError(
        f"{os.fspath(path)}: pulse rows with {_listed(counts)} columns are not supported",
        remedy="Files with 19 to 21 columns are supported; see the reference of file formats",
    )


def _listed(counts: Sequence[int]) -> str:
    return ", ".join(map(str, counts[:6]))


def _mark(cells: Sequence[str], before_pulse: int) -> RotationMark:
    if not all(_is_padding(cell) for cell in cells[4:]):
        raise ValueError(
            f"the row has {len(cells)} columns instead of the 4 of a rotation mark"
        )
    return RotationMark(
        kind="start" if _MARKS[cells[0]] == "start" else "stop",
        latitude_deg=latitude(cells[1]),
        longitude_deg=longitude(cells[2]),
        altitude_amsl_m=number_or_nan(cells[3]),
        before_pulse=before_pulse,
    )


def _pulse_7(cells: Sequence[str], layout: _Layout) -> PulsePose:
    offset = layout.offset_deg(cells)
    after = 10 + layout.noise
    start_ns = seconds_ns(cells[3])
    pulse = replace(
        _pulse(cells[1:3], start_ns, cells[5], cells[after : after + 2]),
        group_snr_db=_snr(cells[9]),
        score=number_or_nan(cells[6]),
        group_index=whole(cells[8]),
        group_sequence=whole(cells[7]),
        noise_psd=(number_or_nan(cells[10]) or math.nan) if layout.noise else math.nan,
        predicted_next_start_ns=_predicted(cells[4]),
    )
    attitude = layout.attitude(cells)
    vehicle: Quaternion | None
    if layout.quaternion:
        x, y, z, w = attitude
        vehicle = normalised((w, x, y, z)) if is_attitude((w, x, y, z)) else None
    else:
        vehicle = _attitude(attitude)
    return PulsePose(pulse=pulse, pose=_pose(cells[after + 2 :], start_ns, vehicle, offset))


def _pulse_20(cells: Sequence[str]) -> PulsePose | None:
    if len(cells) < 23 or not all(_is_padding(cell) for cell in cells[23:]):
        raise ValueError(f"the row has {len(cells)} columns instead of 23")
    if whole(cells[12]) == 3:
        return None
    start_ns = seconds_ns(cells[6])
    pulse = replace(
        _pulse(cells[3:5], start_ns, cells[8], cells[12:14]),
        score=number_or_nan(cells[9]),
        group_sequence=whole(cells[5]),
        noise_psd=number_or_nan(cells[11]) or math.nan,
        rate=max(1, whole(cells[14])),
        predicted_next_start_ns=_predicted(cells[7]),
    )
    vehicle = _attitude([number_or_nan(cell) for cell in cells[19:22]])
    return PulsePose(pulse=pulse, pose=_pose(cells[16:], start_ns, vehicle, finite(cells[22])))


def _pulse(tag: Sequence[str], start_ns: int, snr: str, states: Sequence[str]) -> Pulse:
    """Create a pulse from tag number, frequency and status numbers of a TagTracker row."""
    confirmed = whole(states[1]) != 0
    frequency_hz = number_or_nan(tag[1]) or math.nan
    pulse = ungrouped_pulse(whole(tag[0]), frequency_hz, start_ns, start_ns, _snr(snr))
    return replace(pulse, detection_status=_status(states[0], confirmed), confirmed=confirmed)


def _pose(
    cells: Sequence[str], time_ns: int, vehicle: Quaternion | None, offset_deg: float
) -> Pose | None:
    """Antenna pose from latitude, longitude and height; None if all are zero.

    TagTracker writes zeros if it has no telemetry.
    """
    place = place_or_none(cells[0], cells[1])
    if place is None or place == (0.0, 0.0) or vehicle is None:
        return None
    return Pose(
        time_ns=time_ns,
        latitude_deg=place[0],
        longitude_deg=place[1],
        altitude_amsl_m=math.nan,
        altitude_relative_m=number_or_nan(cells[2]),
        quaternion_wxyz=product(vehicle, from_euler_deg(offset_deg, 0.0, 0.0)),
    )


def _attitude(roll_pitch_yaw_deg: Sequence[float]) -> Quaternion | None:
    if not all(map(math.isfinite, roll_pitch_yaw_deg)):
        return None
    roll, pitch, yaw = roll_pitch_yaw_deg
    return from_euler_deg(yaw, pitch, roll)


def _snr(cell: str) -> float:
    """SNR [dB] in a cell, NaN if unknown; minus infinity means power equal to the noise."""
    value = float(cell)
    return math.nan if value in (PLACEHOLDER_DB, math.inf) else value


def _status(cell: str, confirmed: bool) -> DetectionStatus:
    status = whole(cell)
    if status == STATUSES.index("integrated"):
        return "integrated"
    if status == 2 or confirmed:
        return "confirmed"
    return "subthreshold" if status == 0 else "detected"


def _predicted(cell: str) -> int | None:
    time_ns = seconds_ns(cell) if cell and number_or_nan(cell) > 0.0 else 0
    return time_ns or None


def _warnings(found: Sequence[PulsePose], layout: _Layout | None) -> list[str]:
    texts = []
    times = {one.pulse.start_time_ns for one in found}
    if len(found) > 3 and len(times) <= len(found) // 3:
        texts.append(
            "The times of this log are rounded so coarsely that several pulses have the same "
            "time; only the order of the rows shows which came first."
        )
    if layout is not None and layout.quaternion and found:
        texts.append(
            "These poses were attached on the drone by the original's uavrt_connection, which "
            "may have logged half of each turn; a sign of this is that all headings are "
            "within one half circle."
        )
    return texts
