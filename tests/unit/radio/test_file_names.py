"""Names of recordings as other programs give them."""

import os
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.core.clock import parse_iso_utc
from uavrt.core.errors import FormatError
from uavrt.radio.files.file_names import read_name
from uavrt.radio.files.recording_source import RecordingSource
from uavrt.radio.opening import open_recording


@pytest.fixture
def arizona(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A computer seven hours behind UTC."""
    monkeypatch.setenv("TZ", "MST7")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


NAMES = [
    ("SDRSharp_20150804_204121Z_145000000Hz_IQ.wav", 145e6, None, "2015-08-04T20:41:21Z"),
    ("HDSDR_20130105_123456Z_14100kHz_RF.wav", 14.1e6, None, "2013-01-05T12:34:56Z"),
    ("HDSDR_20130105_123456_14100kHz_RF.wav", 14.1e6, None, "2013-01-05T19:34:56Z"),
    ("AirSpy_20240501_060000Z_148700kHz_IQ.wav", 148.7e6, None, "2024-05-01T13:00:00Z"),
    ("baseband_145000000Hz_12-34-56_01-02-2023.wav", 145e6, None, "2023-02-01T19:34:56Z"),
    ("gqrx_20200101_123456_145000000_1800000_fc.raw", 145e6, 1.8e6, "2020-01-01T12:34:56Z"),
    ("g001_433.92M_250k.cu8", 433.92e6, 250e3, None),
]


@pytest.mark.usefixtures("arizona")
@pytest.mark.parametrize(("name", "frequency_hz", "rate_hz", "start"), NAMES)
def test_a_name_tells_frequency_rate_and_start(
    name: str, frequency_hz: float, rate_hz: float | None, start: str | None
) -> None:
    facts = some(read_name(Path("/data") / name))
    assert facts.center_frequency_hz == frequency_hz
    assert facts.sample_rate_hz == rate_hz
    assert facts.start_time_ns == (None if start is None else parse_iso_utc(start))


@given(text=st.text(max_size=80))
def test_any_other_name_tells_nothing_and_breaks_nothing(text: str) -> None:
    for prefix in ("", "SDRSharp_", "gqrx_", "baseband_", "g001_"):
        facts = read_name(prefix + text)
        assert facts is None or facts.program


STAMPS = st.integers(0, 10**14 - 1).map("{:014d}".format)


@given(STAMPS.filter(lambda stamp: stamp[4:6] > "12" or stamp[8:10] > "23"))
def test_a_date_that_does_not_exist_is_no_time(stamp: str) -> None:
    facts = some(read_name(f"gqrx_{stamp[:8]}_{stamp[8:]}_145000000_1800000_fc.raw"))
    assert facts.start_time_ns is None


def raw(path: Path, samples: int = 4000) -> Path:
    np.zeros(samples, np.complex64).tofile(path)
    return path


def described(path: Path, **options: float) -> RecordingSource:
    """Open a recording only to see what it tells of itself."""
    source = open_recording(path, **options)  # type: ignore[arg-type]
    source.close()
    return source


def wav(path: Path, auxi: bytes = b"") -> Path:
    data = bytes(4 * 2000)
    chunks = b"fmt " + struct.pack("<IHHIIHH", 16, 1, 2, 250_000, 1_000_000, 4, 16)
    if auxi:
        chunks += b"auxi" + struct.pack("<I", len(auxi)) + auxi + bytes(len(auxi) % 2)
    chunks += b"data" + struct.pack("<I", len(data)) + data
    path.write_bytes(b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks)
    return path


HDSDR_AUXI = struct.pack(
    "<8H8H9I96s", 2013, 1, 6, 5, 12, 34, 57, 250, *(8 * [0]), 14_150_000, *(8 * [0]), bytes(96)
)
"""Start, stop, centre, A/D rate and so on: 164 bytes, as HDSDR writes it."""


def test_a_gqrx_recording_opens_by_its_name_alone(tmp_path: Path) -> None:
    source = described(raw(tmp_path / "gqrx_20200101_123456_145000000_1800000_fc.raw"))
    assert (source.center_frequency_hz, source.sample_rate_hz) == (145e6, 1.8e6)
    assert source.start_time_ns == parse_iso_utc("2020-01-01T12:34:56Z")
    assert source.origin.count("the file's name (as gqrx gives)") == 3


HDSDR = "HDSDR_20130105_123456Z_14100kHz_RF.wav"


def test_what_is_said_wins_over_the_header_and_the_header_over_the_name(tmp_path: Path) -> None:
    plain = described(wav(tmp_path / HDSDR))
    assert plain.center_frequency_hz == 14.1e6
    assert plain.start_time_ns == parse_iso_utc("2013-01-05T12:34:56Z")
    told = described(wav(tmp_path / HDSDR, HDSDR_AUXI))
    assert told.center_frequency_hz == 14.15e6
    assert told.start_time_ns == parse_iso_utc("2013-01-05T12:34:57.25Z")
    assert "begun 2013-01-05T12:34:57.250000Z by the file's header" in told.origin
    said = described(tmp_path / HDSDR, center_frequency_hz=14.2e6, start_time_ns=1_000_000_000)
    assert (said.center_frequency_hz, said.start_time_ns) == (14.2e6, 1_000_000_000)
    assert "MHz" not in said.origin
    assert "begun" not in said.origin


SDR_CONSOLE = (
    '<?xml version="1.0"?><SDR-XML-Root Description="Saved recording data">'
    '<Definition CurrentTimeUTC="26-09-2014 22:47:52" RadioModel="Airspy" ADFrequency="0" '
    'BitsPerSample="16" RadioCenterFreq="148650000" SampleRate="250000" '
    'UTCSeconds="1411771664"/></SDR-XML-Root>'
)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-8"])
def test_a_header_in_xml_is_read_as_xml(encoding: str, tmp_path: Path) -> None:
    told = described(wav(tmp_path / "field.wav", SDR_CONSOLE.encode(encoding)))
    assert told.center_frequency_hz == 148.65e6
    assert told.start_time_ns == parse_iso_utc("2014-09-26T22:47:44Z")


def test_a_header_in_xml_without_figures_leaves_the_name_its_word(tmp_path: Path) -> None:
    named = described(wav(tmp_path / HDSDR, ("<Nothing/>" + 40 * " ").encode("utf-16")))
    assert named.center_frequency_hz == 14.1e6
    assert named.start_time_ns == parse_iso_utc("2013-01-05T12:34:56Z")


def test_local_time_in_a_name_says_so(tmp_path: Path) -> None:
    path = wav(tmp_path / "baseband_145000000Hz_12-34-56_01-02-2023.wav")
    assert "local time" in described(path).origin


@pytest.mark.parametrize("length", [1, 37, 165])
def test_a_chunk_of_odd_length_does_not_hide_the_samples(length: int, tmp_path: Path) -> None:
    assert described(wav(tmp_path / HDSDR, bytes(length))).total_samples == 2000


def test_the_date_of_the_file_is_the_last_resort_and_says_so(tmp_path: Path) -> None:
    path = raw(tmp_path / "night.cf32", 250_000)
    os.utime(path, ns=(10**18, 10**18))
    source = described(path, sample_rate_hz=250e3, center_frequency_hz=148e6)
    assert source.start_time_ns == 10**18 - 10**9
    assert "the date of the file" in source.origin
    assert "--start-time" in source.origin


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("HDSDR_20130105_123456Z_148527kHz_RF.wav", "to 1 kHz: give --center-frequency"),
        ("g001_148.5M_250k.cu8", "to 1 kHz: give --center-frequency"),
        ("g001_48.527M_250k.cu8", "to 0.1 kHz: give --center-frequency"),
        ("SDRSharp_20150804_204121Z_148527000Hz_IQ.wav", ""),
    ],
)
def test_a_name_that_rounds_the_frequency_says_so(name: str, said: str, tmp_path: Path) -> None:
    path = (wav if name.endswith(".wav") else raw)(tmp_path / name)
    source = described(path, start_time_ns=1_000_000_000)
    assert said in source.origin
    assert ("rounded" in source.origin) == ("kHz" in said)


def test_a_frequency_in_megahertz_is_known_by_its_error(tmp_path: Path) -> None:
    path = raw(tmp_path / "night.cf32")
    with pytest.raises(FormatError, match=r"megahertz.*--center-frequency 148\.7e6"):
        open_recording(path, sample_rate_hz=250e3, center_frequency_hz=148.7)
