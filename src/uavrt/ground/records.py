"""What the ground has stored: pulses as they arrived, one JSON line each."""

from pathlib import Path

from uavrt.messages import Pulse
from uavrt.recording.pulse_files import read_pulse_file

PULSES_NAME = "pulses.jsonl"


def read_ground_pulses(directory: Path) -> list[Pulse]:
    """Read the pulses that a ground station has stored, in order of arrival.

    Raises
    ------
    FormatError
        The file cannot be read or is damaged.
    """
    return [item.pulse for item in read_pulse_file(directory / PULSES_NAME)]
