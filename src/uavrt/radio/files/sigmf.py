"""Read SigMF recordings: a JSON description and a file of samples.

The fields are those of the SigMF specification 1.2 (core namespace). The description is read
with the standard library. The ``sigmf`` package is not used because it reads samples five times
slower than ``readv`` and needs a JSON-schema validator.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from uavrt.core.clock import parse_iso_utc
from uavrt.core.errors import FormatError
from uavrt.core.foreign import NOTES, read_file, read_json
from uavrt.core.units import NANOSECONDS_PER_SECOND, SIGMF_FULL_SCALE
from uavrt.radio.files.recording_source import (
    FILE_DATE,
    GIVEN_BY_USER,
    Layout,
    Segment,
    file_size,
    file_start_ns,
    reading,
)
from uavrt.radio.formats import sigmf_format
from uavrt.radio.live_source import check_rates
from uavrt.radio.timing.sample_times import NominalTimes


def sigmf_layout(
    path: Path, *, center_frequency_hz: float | None = None, start_time_ns: int | None = None
) -> Layout:
    """Describe a SigMF recording and the gaps between its captures.

    `path`: the file with the metadata, or the file with the samples.
    """
    meta_path, data_path = _paths(path)
    meta = _load(meta_path)
    about = _table(meta, "global", meta_path)
    if about.get("core:metadata_only") is True or "core:dataset" in about:
        raise _fault(
            meta_path,
            "the samples are in another file",
            "Use a .sigmf-meta file with a .sigmf-data file",
        )
    if about.get("core:num_channels", 1) != 1:
        raise _fault(
            meta_path,
            "the recording has several channels",
            "Split it into one file per channel",
        )
    sample_format = sigmf_format(_text(about, "core:datatype", meta_path))
    scale = _number(about, SIGMF_FULL_SCALE, meta_path)
    if scale is not None:
        if scale <= 0.0:
            raise _fault(
                meta_path, f"{SIGMF_FULL_SCALE} is {scale}", "Set it to a number above 0"
            )
        sample_format = replace(sample_format, full_scale=sample_format.full_scale / scale)
    rate_hz = _number(about, "core:sample_rate", meta_path)
    if rate_hz is None:
        raise _fault(
            meta_path, "core:sample_rate is missing", "Add it to the file's global part"
        )
    check_rates(rate_hz, 0.0)
    captures = _captures(meta, meta_path, center_frequency_hz)
    frequency_hz = captures[0].frequency_hz
    if frequency_hz is None:
        raise _fault(meta_path, "core:frequency is missing", "Give --center-frequency")
    trailing = _number(about, "core:trailing_bytes", meta_path) or 0.0
    size = file_size(data_path) - int(trailing) - captures[0].header_bytes
    count, rest = divmod(max(size, 0), sample_format.bytes_per_sample)
    fault = f"{data_path} ends in the middle of a sample" if rest else None
    if captures[-1].first > count:
        fault = (
            f"{data_path} holds {count} samples, but a capture starts at "
            f"{captures[-1].first}: truncated"
        )
    gap_s = max((_lost(*pair, rate_hz) for pair in pairwise(captures)), default=0) / rate_hz
    if gap_s > MOST_GAP_S:
        raise _fault(
            meta_path,
            f"{gap_s / 3600.0:.0f} hours of samples are missing between two captures",
            "Correct their core:global_index or core:datetime, or split the recording",
        )
    start_from = GIVEN_BY_USER
    if start_time_ns is None and captures[0].time_ns is None:
        start_time_ns, start_from = file_start_ns(data_path, count, rate_hz), FILE_DATE
    return Layout(
        path=data_path,
        sample_format=sample_format,
        sample_rate_hz=rate_hz,
        center_frequency_hz=frequency_hz,
        segments=tuple(_segments(captures, count, rate_hz, start_time_ns)),
        start_from=start_from,
        first_byte=captures[0].header_bytes,
        fault_at_end=fault,
    )


def sigmf_global(path: Path, key: str) -> object:
    """Value of a key in a recording's global metadata; None if the key is missing.

    Raises `FormatError` if the metadata cannot be read.
    """
    meta_path, _ = _paths(path)
    return _table(_load(meta_path), "global", meta_path).get(key)


MOST_GAP_S = 30 * 86_400.0
"""Longest accepted gap between captures [s]; a longer one shows a wrong index or time."""
LAST_NS = 2**62
"""Latest time accepted in a recording, in 2116 [ns since 1970]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Capture:
    first: int
    global_index: int | None
    time_ns: int | None
    frequency_hz: float | None
    header_bytes: int


def _segments(
    captures: list[_Capture], total: int, rate_hz: float, start_time_ns: int | None
) -> list[Segment]:
    segments: list[Segment] = []
    base_ns = start_time_ns if start_time_ns is not None else captures[0].time_ns or 0
    moved_ns = base_ns - (captures[0].time_ns if captures[0].time_ns is not None else base_ns)
    line = NominalTimes(base_ns, rate_hz)
    index = 0
    for number, capture in enumerate(captures):
        end = captures[number + 1].first if number + 1 < len(captures) else total
        first, end = min(capture.first, total), min(end, total)
        lost = 0
        time_ns = line.time_ns(index)
        if number > 0:
            previous = captures[number - 1]
            lost = _lost(previous, capture, rate_hz)
            index += lost
            time_ns = line.time_ns(index)
            if capture.time_ns is not None and captures[0].time_ns is not None:
                time_ns = capture.time_ns + moved_ns
        segments.append(
            Segment(
                first=first,
                count=end - first,
                sample_index=index,
                time_ns=time_ns,
                lost_before=lost,
            )
        )
        index += end - first
    return segments


def _lost(previous: _Capture, capture: _Capture, rate_hz: float) -> int:
    """Number of samples lost between two captures of a recording.

    It follows from the captures' global indices, or from their times if there are no indices. A
    smaller index than before means that the radio was opened again.
    """
    kept = capture.first - previous.first
    if previous.global_index is not None and capture.global_index is not None:
        passed = capture.global_index - previous.global_index
        if passed >= 0:
            return max(passed - kept, 0)
    if previous.time_ns is not None and capture.time_ns is not None:
        passed_s = (capture.time_ns - previous.time_ns) / NANOSECONDS_PER_SECOND
        missing = round(passed_s * rate_hz) - kept
        # Times are written to the microsecond and rates are nominal: a millisecond is noise.
        return missing if missing > 0.001 * rate_hz else 0
    return 0


def _captures(
    meta: Mapping[str, Any], path: Path, center_frequency_hz: float | None
) -> list[_Capture]:
    listed = meta.get("captures") or [{"core:sample_start": 0}]
    if not isinstance(listed, list) or not all(isinstance(item, dict) for item in listed):
        raise _fault(path, "the captures are not a list of tables", "Correct the captures")
    captures = []
    for item in listed:
        time_text = item.get("core:datetime")
        try:
            time_ns = None if time_text is None else parse_iso_utc(_ns_text(time_text))
            if not 0 <= (time_ns or 0) < LAST_NS:
                raise ValueError("the time is before 1970 or after 2116")
        except (ValueError, TypeError, OverflowError) as error:
            raise _fault(
                path, f"core:datetime {time_text!r} is not a valid time", "Write it in ISO 8601"
            ) from error
        frequency_hz = _number(item, "core:frequency", path)
        captures.append(
            _Capture(
                first=_index(item, "core:sample_start", path) or 0,
                global_index=_index(item, "core:global_index", path),
                time_ns=time_ns,
                frequency_hz=center_frequency_hz or frequency_hz,
                header_bytes=_index(item, "core:header_bytes", path) or 0,
            )
        )
    if [c.first for c in captures] != sorted(c.first for c in captures):
        raise _fault(path, "the captures are not in order", "Sort them by core:sample_start")
    if any(c.header_bytes for c in captures[1:]):
        raise _fault(
            path,
            "there are headers between the captures",
            "Write the recording without these headers",
        )
    frequencies = {c.frequency_hz for c in captures if c.frequency_hz is not None}
    if len(frequencies) > 1:
        hertz = ", ".join(f"{one:.0f}" for one in sorted(frequencies))
        raise _fault(
            path,
            f"the frequency changes within the recording: {hertz} Hz",
            "Split it into one recording for each frequency",
        )
    return captures


def _ns_text(text: object) -> str:
    if not isinstance(text, str):
        raise TypeError("the value is not text")
    head, dot, tail = text.partition(".")
    if not dot:
        return text
    digits = tail.rstrip("Zz")
    return f"{head}.{digits[:6]}Z" if digits.isdigit() else text


def _paths(path: Path) -> tuple[Path, Path]:
    if path.suffix == ".sigmf":
        raise FormatError(f"{path} is a SigMF archive", remedy=f"Unpack it: tar -xf {path}")
    base = path.with_suffix("") if path.suffix in (".sigmf-meta", ".sigmf-data") else path
    return (
        base.with_name(base.name + ".sigmf-meta"),
        base.with_name(base.name + ".sigmf-data"),
    )


def _load(path: Path) -> Mapping[str, Any]:
    try:
        with reading(path):
            loaded = read_json(read_file(path, NOTES), NOTES)
    except (ValueError, RecursionError) as error:
        raise _fault(
            path,
            f"the file cannot be read: {error}; it is damaged, or not a SigMF file",
            "Copy it again, or give --format, --sample-rate and --center-frequency for the "
            "samples alone",
        ) from error
    if not isinstance(loaded, dict):
        raise _fault(path, "the file is not a SigMF description", "Name the .sigmf-meta file")
    return loaded


def _fault(path: Path, what: str, remedy: str) -> FormatError:
    return FormatError(f"{path}: {what}", remedy=remedy)


def _table(of: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    found = of.get(key)
    if not isinstance(found, dict):
        raise _fault(path, f"the part {key!r} is missing", "Name a SigMF .sigmf-meta file")
    return found


def _text(of: Mapping[str, Any], key: str, path: Path) -> str:
    found = of.get(key)
    if not isinstance(found, str):
        raise _fault(path, f"{key} is missing", "Add it to the file")
    return found


def _number(of: Mapping[str, Any], key: str, path: Path) -> float | None:
    found = of.get(key)
    if found is None:
        return None
    if (
        isinstance(found, bool)
        or not isinstance(found, int | float)
        or not abs(found) <= sys.float_info.max
    ):
        raise _fault(path, f"{key} is {found!r}", "Set it to a number")
    return float(found)


def _index(of: Mapping[str, Any], key: str, path: Path) -> int | None:
    found = of.get(key)
    if found is None:
        return None
    if isinstance(found, bool) or not isinstance(found, int) or not 0 <= found < 2**63:
        raise _fault(path, f"{key} is {found!r}", "Set it to a whole number, 0 or more")
    return found
