"""Read the pulses of the ground station's flights, and write them as lines for scripts."""

import json
from contextlib import suppress
from pathlib import Path

from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.messages import BurstInside, Pulse, PulsePose
from uavrt.flight.logs.pulse_files import inside_record, pulse_record, read_pulse_file
from uavrt.flight.reading.flight_reader import read_flight

PULSES_NAME = "pulses.jsonl"


class PulseLines:
    """The file ``pulses.jsonl``, with a line for each pulse and for each burst's pulse times.

    Lines are written at once. An existing file is continued, and an incomplete last line is
    removed.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._keys: set[tuple[int, int]] = set()
        try:
            self._file = path.open("a+b", buffering=0)
            self._file.seek(0)
            self._file.truncate(self._file.read().rfind(b"\n") + 1)
        except OSError as error:
            raise self._unwritten(error) from error
        with suppress(FormatError):
            self._keys.update(item.pulse.key for item in read_pulse_file(path))

    def write(self, event: PulsePose | BurstInside) -> bool:
        """Write a line; False if the file already has this pulse. Raises `RecordingError`."""
        if isinstance(event, BurstInside):
            self._append(inside_record(event))
        elif event.pulse.key in self._keys:
            return False
        else:
            self._append(pulse_record(event))
            self._keys.add(event.pulse.key)
        return True

    def close(self) -> None:
        """Close the file of pulses."""
        self._file.close()

    def _append(self, record: dict[str, object]) -> None:
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        size = self._file.seek(0, 2)
        try:
            if self._file.write(line) != len(line):
                raise OSError(None, "no space left on the disk")
        except OSError as error:
            self._file.truncate(size)
            raise self._unwritten(error) from error

    def _unwritten(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"cannot write {self._path}: {error.strerror}",
            remedy="Free space on the disk, or give a writable directory with -o",
        )


def read_ground_pulses(directory: Path, since_ns: int = 0) -> list[Pulse]:
    """Read stored pulses of all flights that began at or after `since_ns` [ns, UTC]."""
    flights = [read_flight(path.parent) for path in directory.glob("*/flight.sqlite")]
    if flights:
        return [
            item.pulse
            for flight in flights
            if flight.info.start_time_ns >= since_ns
            for item in flight.pulse_poses
        ]
    return [item.pulse for item in read_pulse_file(directory / PULSES_NAME)]
