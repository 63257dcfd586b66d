"""Read WAV recordings with I and Q as left and right channel, as SDR programs write them.

Chunks are read according to Microsoft's "Multiple Channel Audio Data and WAVE Files"; RF64 and
BW64 (files over 4 GiB) according to EBU Tech 3306. WAV files over 4 GiB whose size field has
overflowed are read as well. The ``auxi`` chunk (start time, radio frequency) is read in the
binary form of SDR#, HDSDR and ``airspy_rx -w``, and in the XML form of SDR Console. Python's
``wave`` module is not used because it refuses float samples, RF64, and files whose writer was
killed before it wrote the size.
"""

import re
import struct
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import FormatError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.radio.files.file_names import NameFacts, read_name
from uavrt.radio.files.recording_source import (
    FILE_DATE,
    GIVEN_BY_USER,
    HEADER,
    Layout,
    Segment,
    file_size,
    file_start_ns,
    name_note,
    reading,
)
from uavrt.radio.formats import CF32, CS16, CU8, SampleFormat
from uavrt.radio.live_source import check_rates

_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_UNKNOWN_SIZE = (0, 0xFFFFFFFF, 0x7FFFFFFF)
"""Sizes in the data chunk of a WAV file that mean "unknown": the program streamed the file or
was killed."""

_MOST_READ = 1 << 16
"""Maximum number of bytes that are read from a chunk of a WAV file; the longest chunk that is
used, XML text, has a few thousand bytes."""
_MOST_CHUNKS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class _Packed24(SampleFormat):
    """Sample format with 24-bit integers in three bytes each; numpy has no such type."""

    @property
    def bytes_per_sample(self) -> int:
        """Size of one complex sample [bytes]: three for I and three for Q."""
        return 6

    def convert(self, raw: NDArray[np.uint8], samples: NDArray[np.complex64]) -> None:
        """Convert stored bytes `raw` (n * 6,) into complex `samples` (n,)."""
        wide = np.zeros((2 * len(samples), 4), np.uint8)
        wide[:, 1:] = raw.reshape(-1, 3)
        values: NDArray[Any] = wide.view("<i4")[:, 0]
        np.multiply(values, np.float32(2.0**-31), out=samples.view(np.float32))


_FORMATS: dict[tuple[int, int], SampleFormat] = {
    (_PCM, 8): CU8,
    (_PCM, 16): CS16,
    (_PCM, 24): _Packed24(name="cs24", dtype=np.dtype("<i4"), zero=0.0, full_scale=2.0**31),
    (_PCM, 32): SampleFormat(name="cs32", dtype=np.dtype("<i4"), zero=0.0, full_scale=2.0**31),
    (_FLOAT, 32): CF32,
    (_FLOAT, 64): SampleFormat(name="cf64", dtype=np.dtype("<f8"), zero=0.0, full_scale=1.0),
}


@dataclass(slots=True)
class _Header:
    kind: int = 0
    channels: int = 0
    rate_hz: int = 0
    bits: int = 0
    data_start: int = 0
    data_size: int = 0
    long_data_size: int | None = None
    start_ns: int | None = None
    frequency_hz: float | None = None


def wav_layout(
    path: Path, *, center_frequency_hz: float | None = None, start_time_ns: int | None = None
) -> Layout:
    """Describe a two-channel WAV file.

    A frequency or start time that is not given is read from the ``auxi`` chunk or from the
    file's name; the start time can also follow from the file's date.
    """
    size = file_size(path)
    with reading(path), path.open("rb") as file:
        header = _read_chunks(file, path, size)
    if header.channels != 2:
        raise FormatError(
            f"{path} has {header.channels} audio channels, but an I/Q recording has 2",
            remedy="Record I/Q, not demodulated audio",
        )
    sample_format = _FORMATS.get((header.kind, header.bits))
    if sample_format is None:
        raise FormatError(
            f"{path} has the unsupported WAV encoding {header.kind} with {header.bits} bits",
            remedy="Record as 8, 16, 24 or 32-bit PCM or 32-bit float",
        )
    named = read_name(path) or NameFacts(program="")
    frequency_hz, frequency_from = center_frequency_hz or None, GIVEN_BY_USER
    if frequency_hz is None:
        frequency_hz, frequency_from = header.frequency_hz, HEADER
    if frequency_hz is None:
        frequency_hz, frequency_from = named.center_frequency_hz, name_note(named, "frequency")
    if frequency_hz is None:
        raise FormatError(
            f"{path} does not state its radio frequency", remedy="Give --center-frequency"
        )
    check_rates(float(header.rate_hz), frequency_hz)
    there = size - header.data_start
    said, fault = header.data_size, None
    if said > there:
        fault = f"{path} should hold {said} bytes of samples, but has {there}: truncated"
        said = there
    count, rest = divmod(said, sample_format.bytes_per_sample)
    if rest and fault is None:
        fault = f"{path} ends in the middle of a sample"
    start_ns, start_from = start_time_ns, GIVEN_BY_USER
    if start_ns is None:
        start_ns, start_from = header.start_ns, HEADER
    if start_ns is None:
        start_ns, start_from = named.start_time_ns, name_note(named, "time")
    if start_ns is None:
        start_ns, start_from = file_start_ns(path, count, float(header.rate_hz)), FILE_DATE
    return Layout(
        path=path,
        sample_format=sample_format,
        sample_rate_hz=float(header.rate_hz),
        center_frequency_hz=frequency_hz,
        segments=(Segment(first=0, count=count, sample_index=0, time_ns=start_ns),),
        frequency_from=frequency_from,
        rate_from=HEADER,
        start_from=start_from,
        first_byte=header.data_start,
        fault_at_end=fault,
    )


def _read_chunks(file: BinaryIO, path: Path, size: int) -> _Header:
    start = file.read(12)
    if len(start) < 12 or start[:4] not in (b"RIFF", b"RF64", b"BW64") or start[8:] != b"WAVE":
        raise FormatError(f"{path} is not a WAV file", remedy="Give its --format")
    header = _Header()
    at = 12
    for _ in range(_MOST_CHUNKS):
        name, length = _chunk_at(file, at)
        if not name or (name == b"data" and header.data_start):
            break
        if name == b"data":
            header.data_start = at + 8
            header.data_size = length = _data_size(file, at + 8, length, header, size)
        elif name in (b"fmt ", b"auxi", b"ds64"):
            _read_chunk(name, file.read(min(length, _MOST_READ)), header, path)
        # A chunk of odd length is followed by a byte that it does not count.
        at += 8 + length + (length & 1)
        if at > size:
            break
    if header.data_start == 0 or header.channels == 0:
        raise FormatError(
            f"{path} has no {'samples' if header.channels else 'format'} in it",
            remedy="Record again; the file was truncated within its header",
        )
    return header


def _chunk_at(file: BinaryIO, at: int) -> tuple[bytes, int]:
    file.seek(at)
    head = file.read(8)
    if len(head) < 8 or not all(0x20 <= letter < 0x7F for letter in head[:4]):
        return b"", 0
    return head[:4], struct.unpack("<I", head[4:])[0]


def _data_size(file: BinaryIO, first: int, length: int, header: _Header, size: int) -> int:
    """Size of the samples in a WAV file [bytes].

    The size in the header can be wrong: programs without RF64 let it overflow at 4 GiB, and
    some programs write it only at the start. So it is used only if the file ends there, or if
    complete chunks fill the rest of the file. Otherwise the samples extend to the end of the
    file.
    """
    if length == _UNKNOWN_SIZE[1] and header.long_data_size is not None:
        length = header.long_data_size
    if length in _UNKNOWN_SIZE:
        return size - first
    if length > size - first:
        return length
    for end in range(first + length, size + 1, 1 << 32):
        if _chunks_fill(file, end + (length & 1), size):
            return end - first
    return size - first


def _chunks_fill(file: BinaryIO, at: int, size: int) -> bool:
    """True if complete WAV chunks follow from a position to the end of the file."""
    for _ in range(_MOST_CHUNKS):
        if size - at < 8:
            return at <= size + 1
        name, length = _chunk_at(file, at)
        if not name:
            return False
        at += 8 + length + (length & 1)
    return False


def _read_chunk(name: bytes, body: bytes, header: _Header, path: Path) -> None:
    if name == b"fmt ":
        if len(body) < 16:
            raise FormatError(f"{path} has a damaged format chunk", remedy="Record again")
        header.kind, header.channels, header.rate_hz = struct.unpack("<HHI", body[:8])
        header.bits = struct.unpack("<H", body[14:16])[0]
        if header.kind == _EXTENSIBLE and len(body) >= 26:
            # The first two bytes of the sub-format GUID are the plain format number.
            header.kind = struct.unpack("<H", body[24:26])[0]
    elif name == b"ds64" and len(body) >= 16:
        header.long_data_size = struct.unpack("<Q", body[8:16])[0]
    elif name == b"auxi" and (text := _xml(body)) is not None:
        header.start_ns = _number(text, "UTCSeconds", NANOSECONDS_PER_SECOND)
        header.frequency_hz = _number(text, "RadioCenterFreq", 1)
    elif name == b"auxi" and len(body) >= 36:
        header.start_ns = _system_time_ns(struct.unpack("<8H", body[:16]))
        frequency_hz = struct.unpack("<I", body[32:36])[0]
        header.frequency_hz = float(frequency_hz) if frequency_hz else None


def _xml(body: bytes) -> str | None:
    """Text of a WAV file's ``auxi`` chunk if it is XML (SDR Console); None otherwise."""
    body = body.removeprefix(b"\xff\xfe").removeprefix(b"\xef\xbb\xbf")
    if body[:1] != b"<":
        return None
    encoding = "utf-16-le" if body[1:2] == b"\0" else "utf-8"
    return body.decode(encoding, errors="replace")


def _number(text: str, name: str, unit: int) -> int | None:
    found = re.search(rf'\b{name}\s*=\s*"(\d{{1,12}})"', text)
    return int(found[1]) * unit or None if found else None


def _system_time_ns(fields: tuple[int, ...]) -> int | None:
    """Convert a Windows SYSTEMTIME (year to ms) to UTC [ns]; None if it is not a valid date."""
    year, month, _, day, hour, minute, second, millisecond = fields
    try:
        stamp = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return None
    return int(stamp.timestamp()) * NANOSECONDS_PER_SECOND + millisecond * 1_000_000
