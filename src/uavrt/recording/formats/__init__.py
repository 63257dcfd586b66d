"""Logs of other systems and of the original's tools; one module for each format.

`read_pulses` and `read_pulse_log` recognise them all.
"""

from uavrt.recording.formats.bearings_csv import (
    BearingRow,
    read_bearing_file,
    write_bearing_file,
)
from uavrt.recording.formats.log import LogKind, PulseLog, RotationMark
from uavrt.recording.formats.positions_csv import (
    PositionRow,
    read_position_file,
    write_position_file,
)
from uavrt.recording.formats.pyradiotracking import read_pyradiotracking
from uavrt.recording.formats.recognise import read_pulse_log, read_pulses, recognised
from uavrt.recording.formats.tagtracker import read_tagtracker, write_tagtracker
from uavrt.recording.formats.ucsd import (
    TargetEstimate,
    read_ucsd_estimates,
    read_ucsd_pings,
)

__all__ = [
    "BearingRow",
    "LogKind",
    "PositionRow",
    "PulseLog",
    "RotationMark",
    "TargetEstimate",
    "read_bearing_file",
    "read_position_file",
    "read_pulse_log",
    "read_pulses",
    "read_pyradiotracking",
    "read_tagtracker",
    "read_ucsd_estimates",
    "read_ucsd_pings",
    "recognised",
    "write_bearing_file",
    "write_position_file",
    "write_tagtracker",
]
