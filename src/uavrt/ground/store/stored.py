"""What the ground has stored: pulses as they arrived, or flights of its own."""

from pathlib import Path

from uavrt.messages import Pulse
from uavrt.recording import read_flight, read_pulse_file

PULSES_NAME = "pulses.jsonl"


def read_ground_pulses(directory: Path, since_ns: int = 0) -> list[Pulse]:
    """Read the pulses that a ground station has stored, with a page or without one.

    Parameters
    ----------
    directory : Path
        Its directory.
    since_ns : int
        Flights that began earlier are left out [ns, UTC].

    Raises
    ------
    FormatError
        The file cannot be read or is damaged.
    """
    flights = [read_flight(path.parent) for path in directory.glob("*/flight.sqlite")]
    if flights:
        return [
            item.pulse
            for flight in flights
            if flight.info.start_time_ns >= since_ns
            for item in flight.pulse_poses
        ]
    return [item.pulse for item in read_pulse_file(directory / PULSES_NAME)]
