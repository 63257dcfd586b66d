"""Read the signal CSV of pyradiotracking: one row per signal, semicolons between the cells.

Times are ISO 8601 or seconds since 1970; durations are seconds, or ``0:00:00.020``. Stations do
not move and report no position, so the pulses have no pose. The SNR in the file is average
power over noise power in an FFT bin of pyradiotracking; it is not converted. Tags are numbered
by frequency.
"""

import os
from collections.abc import Sequence
from dataclasses import replace

from uavrt.core.messages import Pulse, PulsePose
from uavrt.core.units import ns_from_s
from uavrt.formats.pulses.pulse_log import PulseLog, ungrouped_pulse
from uavrt.formats.pulses.ucsd import tag_numbers
from uavrt.formats.text import any_time_ns, cells_of, finite, number_or_nan, parsed_rows

NAMES = ("device", "time", "frequency", "duration", "max", "avg", "std", "noise", "snr")
_OTHER_NAMES = {"ts": "time", "timestamp": "time", "freq": "frequency"}
SAME_TAG_HZ = 2_000.0
"""Maximum difference between the frequencies of one tag [Hz]: two FFT bins of 300 kHz / 256."""
_REMEDY = "Its heading is Device;Time;Frequency;Duration;max;avg;std;noise;snr"


def read_pyradiotracking(path: str | os.PathLike[str]) -> PulseLog:
    """Read a signal CSV; raises `FormatError` with the number of the first bad row."""
    heard = parsed_rows(
        path,
        NAMES,
        lambda row: (row[0], _pulse(row)),
        _REMEDY,
        cells=lambda line: cells_of(line, ";"),
        names=column_names,
    )
    pulses, devices = [pulse for _, pulse in heard], {device for device, _ in heard}
    tags = tag_numbers([pulse.frequency_hz for pulse in pulses], SAME_TAG_HZ)
    warnings = ["Pulses of this log have no positions. Tags are numbered by frequency."]
    if len(devices) > 1:
        warnings.append(
            f"It holds the signals of {len(devices)} receivers; one pulse may be in it "
            "several times."
        )
    return PulseLog(
        kind="pyradiotracking",
        pulse_poses=tuple(
            PulsePose(pulse=replace(pulse, tag_id=tag_id), pose=None)
            for pulse, tag_id in zip(pulses, tags, strict=True)
        ),
        warnings=tuple(warnings) if pulses else (),
    )


def column_names(cells: Sequence[str]) -> list[str]:
    """Column names in a heading without their units: ``"max (dBW)"`` becomes ``"max"``."""
    plain = [cell.lower().split("(")[0].strip(' "') for cell in cells]
    return [_OTHER_NAMES.get(name, name) for name in plain]


def _pulse(cells: Sequence[str]) -> Pulse:
    start_ns = any_time_ns(cells[1])
    noise_dbw = number_or_nan(cells[7])
    snr_db = number_or_nan(cells[8])
    if abs(noise_dbw) > 1000.0:
        raise ValueError(f"{cells[7]} is not a level in dBW")
    end_ns = start_ns + ns_from_s(_duration_s(cells[3]))
    return ungrouped_pulse(1, finite(cells[2]), start_ns, end_ns, snr_db, noise_db=noise_dbw)


def _duration_s(cell: str) -> float:
    """Parse a duration [s], given in seconds or as hours:minutes:seconds."""
    total = 0.0
    for part in cell.split(":"):
        total = 60.0 * total + finite(part)
    if not 0.0 <= total < 86_400.0:
        raise ValueError(f"{cell} is not a duration")
    return total
