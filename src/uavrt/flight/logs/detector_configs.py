"""Read and write ``detectorConfig.txt``, the original detector's description of a tag.

The file has a ``##`` line, then ``key:<TAB>value`` lines. A blank line would crash the original
detector. The last record in a file counts, and unknown keys are ignored. With this file, the
original detectors can use the UDP channels that uavrt optionally sends.
"""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from uavrt.config.tags.tag_rules import (
    MAX_FREQUENCY_HZ,
    MAX_INTERVAL_MS,
    MAX_K,
    MAX_PULSE_WIDTH_MS,
    MIN_FREQUENCY_HZ,
    MIN_PULSE_WIDTH_MS,
)
from uavrt.core.atomic_file import write_atomically
from uavrt.core.clock import iso_utc
from uavrt.core.errors import FormatError, RecordingError, os_errors_as
from uavrt.core.foreign import SETTINGS, read_file
from uavrt.core.messages import DEFAULT_FALSE_ALARM_PROBABILITY, Tag
from uavrt.core.units import hz_from_mhz, mhz_from_hz

CHANNELS = 100
CHANNEL_RATE_HZ = 3750.0
_DATA_PORT, _CONTROL_PORT = 20_000, 30_000
_MHZ = (MIN_FREQUENCY_HZ / 1e6, MAX_FREQUENCY_HZ / 1e6, "MHz")
_INTERVAL_S = (0.001, MAX_INTERVAL_MS / 1e3, "seconds")
_BOUNDS = {
    "channelCenterFreqMHz": _MHZ,
    "tagFreqMHz": _MHZ,
    "Fs": (1.0, 100e6, "samples a second"),
    "tp": (MIN_PULSE_WIDTH_MS / 1e3, MAX_PULSE_WIDTH_MS / 1e3, "seconds"),
    "tip": _INTERVAL_S,
    "tip2": _INTERVAL_S,
    "tipu": (0.0, MAX_INTERVAL_MS / 1e3, "seconds"),
    "tipj": (0.0, MAX_INTERVAL_MS / 1e3, "seconds"),
    "K": (1, MAX_K, "pulses"),
    "portData": (0, 65_535, "a port"),
}
"""Smallest value, largest value and unit of each numeric key in ``detectorConfig.txt``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectorConfig:
    """Values of a ``detectorConfig.txt`` that uavrt uses."""

    tag: Tag
    channel_center_frequency_hz: float
    sample_rate_hz: float
    data_port: int
    log_path: str = ""
    operating_mode: str = "freqSearchHardLock"
    """One of the original detector's search modes (`uavrt.detection.modes.OperatingMode`)."""
    excluded_hz: tuple[tuple[float, float], ...] = ()
    """Frequency ranges that are not searched, relative to the channel's centre [Hz]."""


def detector_config(
    tag: Tag,
    center_frequency_hz: float,
    log_path: str = "",
    *,
    ports: Literal["current", "thesis"] = "thesis",
    operating_mode: str = "freqSearchSoftLock",
) -> DetectorConfig:
    """Describe a tag for the original detectors, with 100 channels around the radio frequency.

    A tag that these channels do not cover (another radio, no channelizer) gets its own channel
    and port 0.
    """
    steps = round((tag.frequency_hz - center_frequency_hz) / CHANNEL_RATE_HZ)
    inside = -CHANNELS // 2 <= steps < CHANNELS // 2
    return DetectorConfig(
        tag=tag,
        channel_center_frequency_hz=(
            center_frequency_hz + steps * CHANNEL_RATE_HZ if inside else tag.frequency_hz
        ),
        sample_rate_hz=CHANNEL_RATE_HZ,
        data_port=_DATA_PORT + (1 + (ports == "current")) * (steps % CHANNELS) if inside else 0,
        log_path=log_path,
        operating_mode=operating_mode,
    )


def write_detector_config(path: Path, config: DetectorConfig, time_ns: int) -> None:
    """Write a detectorConfig.txt; raises `RecordingError` on failure.

    `time_ns`: time that is written into the file [ns, UTC].
    """
    tag = config.tag
    second = tag.pulse_intervals_s[1:2]
    pairs: list[tuple[str, object]] = [
        ("ID", tag.tag_id),
        ("channelCenterFreqMHz", f"{mhz_from_hz(config.channel_center_frequency_hz):.9f}"),
        ("timeStamp", iso_utc(time_ns)),
        ("ipData", "127.0.0.1"),
        ("portData", config.data_port),
        ("ipCntrl", "127.0.0.1"),
        ("portCntrl", config.data_port and config.data_port - _DATA_PORT + _CONTROL_PORT),
        ("Fs", config.sample_rate_hz),
        ("tagFreqMHz", f"{mhz_from_hz(tag.frequency_hz):.9f}"),
        ("tp", tag.pulse_width_s),
        ("tip", tag.pulse_intervals_s[0]),
        *(("tip2", interval_s) for interval_s in second),  # ours: a tag's other rate
        ("tipu", tag.interval_uncertainty_s),
        ("tipj", tag.interval_jitter_s),
        ("K", tag.k),
        ("opMode", config.operating_mode),
        ("excldFreqs", _stretches_text(config.excluded_hz)),
        ("falseAlarmProb", tag.false_alarm_probability),
        ("dataRecordPath", config.log_path),
        ("logPath", config.log_path),
        ("startIndex", 1),
        ("processedOuputPath", config.log_path),  # sic, the original's key
        ("ros2enable", "false"),
        ("startInRunState", "true"),
    ]
    if tag.name is not None:
        pairs.append(("name", " ".join(tag.name.split())))
    lines = ["##################################################"]
    lines += [f"{key}:\t{value}" for key, value in pairs]
    with os_errors_as(RecordingError, f"cannot write {path}", "Free space on the disk"):
        write_atomically(path, "\n".join(lines) + "\n")


def read_detector_config(path: str | os.PathLike[str]) -> DetectorConfig:
    """Read the last record of a detectorConfig.txt; raises `FormatError` for invalid values."""
    name = os.fspath(path)
    with os_errors_as(FormatError, f"cannot read {name}", "Check the name"):
        text = read_file(path, SETTINGS).decode("utf-8", "replace")
    records: list[dict[str, str]] = [{}]
    for line in text.splitlines():
        if line.startswith("#"):
            records.append({})
        elif ":" in line:
            key, _, value = line.partition(":")
            records[-1][key.strip()] = value.strip()
    values = next((record for record in reversed(records) if record), {})
    try:
        intervals = [float(values[key]) for key in ("tip", "tip2") if key in values]
        if "tip" not in values:
            raise KeyError("tip")
        _check(values)
        tag = Tag(
            tag_id=int(values["ID"]),
            frequency_hz=hz_from_mhz(float(values["tagFreqMHz"])),
            pulse_width_s=float(values["tp"]),
            pulse_intervals_s=tuple(intervals),
            interval_uncertainty_s=float(values.get("tipu", "0")),
            interval_jitter_s=float(values.get("tipj", "0")),
            k=int(values.get("K", "1")),
            false_alarm_probability=float(
                values.get("falseAlarmProb", DEFAULT_FALSE_ALARM_PROBABILITY)
            ),
            name=values.get("name"),
        )
        return DetectorConfig(
            tag=tag,
            channel_center_frequency_hz=hz_from_mhz(float(values["channelCenterFreqMHz"])),
            sample_rate_hz=float(values["Fs"]),
            data_port=int(values.get("portData", "0")),
            log_path=values.get("logPath", ""),
            operating_mode=values.get("opMode", "freqSearchHardLock"),
            excluded_hz=_stretches(values.get("excldFreqs", "")),
        )
    except KeyError as error:
        raise FormatError(
            f"{name} lacks the key {error.args[0]}", remedy="Add this key with its value"
        ) from None
    except (ValueError, OverflowError) as error:
        raise FormatError(
            f"{name} is not a detectorConfig.txt: {error}", remedy="Correct this line"
        ) from None


def _check(values: dict[str, str]) -> None:
    """Raise `ValueError` with the key's name for a value that a detector cannot use."""
    for key, (low, high, unit) in _BOUNDS.items():
        if key in values and not low <= float(values[key]) <= high:
            raise ValueError(
                f"{key} is {values[key]}, but must be {low:.10g} to {high:.10g} ({unit})"
            )
    share = values.get("falseAlarmProb", DEFAULT_FALSE_ALARM_PROBABILITY)
    if not 0.0 < float(share) < 1.0:
        raise ValueError(f"falseAlarmProb is {share}, but must lie between 0 and 1")
    shortest = min(
        (key for key in ("tip", "tip2") if key in values), key=lambda k: float(values[k])
    )
    for key, part, least in (
        ("tp", 1.0, "shorter than"),
        ("tipu", 0.5, "under half of"),
        ("tipj", 0.5, "under half of"),
    ):
        if float(values.get(key, "0")) >= part * float(values[shortest]):
            raise ValueError(
                f"{key} is {values[key]}, but must be {least} {shortest} ({values[shortest]})"
            )


def _stretches(text: str) -> tuple[tuple[float, float], ...]:
    """Parse frequency ranges in MATLAB's form ``[lo, hi; …]`` [Hz]; ``[Inf, -Inf]`` means none.

    Raises `ValueError` for any other text.
    """
    found = []
    for row in text.strip().removeprefix("[").removesuffix("]").split(";"):
        cells = row.replace(",", " ").split()
        if not cells:
            continue
        try:
            low, high = map(float, cells)
        except ValueError:
            low = high = math.nan
        if low <= high:
            found.append((low, high))
        elif (low, high) != (math.inf, -math.inf):
            raise ValueError(
                f"excldFreqs is {text}, but must be pairs of hertz, the lower first, as in "
                "[-1300, -700; 200, 300], or [Inf, -Inf] for none"
            )
    return tuple(found)


def _stretches_text(stretches: tuple[tuple[float, float], ...]) -> str:
    rows = "; ".join(f"{low!r}, {high!r}" for low, high in stretches)
    return f"[{rows or 'Inf, -Inf'}]"
