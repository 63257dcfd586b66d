"""The flight directory: written so that nothing is lost, read whatever happened to it.

The recorder of samples, `uavrt.recording.iq_recorder`, needs NumPy and is not loaded here.
"""

from uavrt.recording.detector_config import (
    DetectorConfig,
    detector_config,
    read_detector_config,
    write_detector_config,
)
from uavrt.recording.flight_reader import Flight, read_flight, read_health, read_search_reports
from uavrt.recording.flight_recorder import FlightRecorder
from uavrt.recording.layout import FlightLayout, new_flight_directory, require_writable
from uavrt.recording.process_log import ProcessLog
from uavrt.recording.pulse_files import (
    PulseFormat,
    PulseWriter,
    pulse_format,
    pulse_from_record,
    pulse_record,
    read_pulse_file,
)
from uavrt.recording.pulse_pose_log import read_pulse_pose_log

__all__ = [
    "DetectorConfig",
    "Flight",
    "FlightLayout",
    "FlightRecorder",
    "ProcessLog",
    "PulseFormat",
    "PulseWriter",
    "detector_config",
    "new_flight_directory",
    "pulse_format",
    "pulse_from_record",
    "pulse_record",
    "read_detector_config",
    "read_flight",
    "read_health",
    "read_pulse_file",
    "read_pulse_pose_log",
    "read_search_reports",
    "require_writable",
    "write_detector_config",
]
