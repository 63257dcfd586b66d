"""Logs of other systems and of the original's tools, one module per format.

`read_pulses` and `read_pulse_log` recognise them all.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.recording.formats.bearings_csv import (
        BearingRow,
        read_bearing_file,
        write_bearing_file,
    )
    from uavrt.recording.formats.log import (
        NUMBERED_BY_FREQUENCY,
        WITHOUT_HEADINGS,
        LogKind,
        PulseLog,
        RotationMark,
    )
    from uavrt.recording.formats.positions_csv import (
        PositionRow,
        read_position_file,
        write_position_file,
    )
    from uavrt.recording.formats.pyradiotracking import read_pyradiotracking
    from uavrt.recording.formats.recognise import (
        ORIGINAL_POSES,
        pulse_logs_in,
        read_pulse_log,
        read_pulses,
        recognised,
    )
    from uavrt.recording.formats.tagtracker import read_tagtracker, write_tagtracker
    from uavrt.recording.formats.text import cells_of, read_lines, with_commas
    from uavrt.recording.formats.ucsd import (
        TargetEstimate,
        read_ucsd_estimates,
        read_ucsd_pings,
        tag_numbers,
    )
    from uavrt.recording.formats.whole_file import write_whole

__all__ = [
    "NUMBERED_BY_FREQUENCY",
    "ORIGINAL_POSES",
    "WITHOUT_HEADINGS",
    "BearingRow",
    "LogKind",
    "PositionRow",
    "PulseLog",
    "RotationMark",
    "TargetEstimate",
    "cells_of",
    "place_or_none",
    "pulse_logs_in",
    "read_bearing_file",
    "read_lines",
    "read_position_file",
    "read_pulse_log",
    "read_pulses",
    "read_pyradiotracking",
    "read_tagtracker",
    "read_ucsd_estimates",
    "read_ucsd_pings",
    "recognised",
    "tag_numbers",
    "with_commas",
    "write_bearing_file",
    "write_position_file",
    "write_tagtracker",
    "write_whole",
    "wrong_line",
]
__getattr__ = lazily(
    __name__,
    {
        "BearingRow": "bearings_csv",
        "LogKind": "log",
        "NUMBERED_BY_FREQUENCY": "log",
        "ORIGINAL_POSES": "recognise",
        "PositionRow": "positions_csv",
        "PulseLog": "log",
        "RotationMark": "log",
        "TargetEstimate": "ucsd",
        "WITHOUT_HEADINGS": "log",
        "cells_of": "text",
        "place_or_none": "text",
        "pulse_logs_in": "recognise",
        "read_bearing_file": "bearings_csv",
        "read_lines": "text",
        "with_commas": "text",
        "read_position_file": "positions_csv",
        "read_pulse_log": "recognise",
        "read_pulses": "recognise",
        "read_pyradiotracking": "pyradiotracking",
        "read_tagtracker": "tagtracker",
        "read_ucsd_estimates": "ucsd",
        "read_ucsd_pings": "ucsd",
        "recognised": "recognise",
        "tag_numbers": "ucsd",
        "write_bearing_file": "bearings_csv",
        "write_position_file": "positions_csv",
        "write_tagtracker": "tagtracker",
        "write_whole": "whole_file",
        "wrong_line": "text",
    },
)
