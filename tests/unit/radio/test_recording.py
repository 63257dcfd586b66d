import contextlib
import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from some import some

from uavrt.core.clock import parse_iso_utc
from uavrt.core.errors import FormatError
from uavrt.core.messages import IQBlock
from uavrt.radio.files.recording_source import RecordingSource
from uavrt.radio.opening import open_recording

RATE_HZ = 250_000.0
CENTER_HZ = 148.7e6
START = "2024-05-01T06:00:00Z"
START_NS = parse_iso_utc(START)


def ramp(count: int) -> np.ndarray:
    """Samples that all differ, within ± 0.9, on the 16-bit grid."""
    number = np.arange(count) % 29000
    return ((number + 1j * (number[::-1])) / 32768.0).astype(np.complex64)


def as_cs16(samples: np.ndarray) -> bytes:
    return (samples.view(np.float32) * 32768).round().astype("<i2").tobytes()


Recorded = Callable[..., RecordingSource]


@pytest.fixture
def recorded(tmp_path: Path) -> Iterator[Recorded]:
    """Write recordings and open them; they are closed at the end."""
    with contextlib.ExitStack() as stack:

        def record(name: str, data: bytes, **options: Any) -> RecordingSource:
            path = tmp_path / name
            path.write_bytes(data)
            told = {"center_frequency_hz": CENTER_HZ}
            told |= {} if name.endswith("wav") else {"sample_rate_hz": RATE_HZ}
            source = open_recording(path, **(told | options))
            return stack.enter_context(contextlib.closing(source))

        yield record


def everything(source: RecordingSource) -> tuple[np.ndarray, list[IQBlock]]:
    parts, blocks = [], []
    with contextlib.suppress(EOFError):
        while (block := source.read()) is not None:
            parts.append(block.samples.copy())
            blocks.append(block)
    with pytest.raises(EOFError):
        source.read()
    source.close()
    return np.concatenate(parts), blocks


def write_sigmf(base: Path, data: bytes, captures: list[dict[str, Any]], **about: Any) -> Path:
    meta = {
        "global": {
            "core:datatype": "ci16_le",
            "core:sample_rate": RATE_HZ,
            "core:version": "1.2.0",
            **about,
        },
        "captures": captures,
        "annotations": [],
    }
    base.with_name(base.name + ".sigmf-data").write_bytes(data)
    path = base.with_name(base.name + ".sigmf-meta")
    path.write_text(json.dumps(meta))
    return path


CAPTURE = {"core:sample_start": 0, "core:frequency": CENTER_HZ, "core:datetime": START}
SECOND = {"core:sample_start": 10_000, "core:frequency": CENTER_HZ}
LATER = SECOND | {"core:datetime": "2024-05-01T06:00:00.140000Z"}


def test_a_raw_file_is_read_whole_with_times_from_its_start(recorded: Recorded) -> None:
    samples = ramp(600_001)
    source = recorded("a.cf32", samples.tobytes(), start_time_ns=START_NS)
    assert source.total_samples == 600_001
    read, blocks = everything(source)
    np.testing.assert_array_equal(read, samples)
    for block in blocks:
        assert block.time_ns == START_NS + round(block.sample_index / RATE_HZ * 1e9)


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_sample_rate_that_cannot_be_is_refused(recorded: Recorded, rate: float) -> None:
    with pytest.raises(FormatError, match="--sample-rate"):
        recorded("a.cs16", as_cs16(ramp(100)), sample_rate_hz=rate)


@pytest.mark.parametrize(
    ("name", "given_options", "remedy"),
    [
        ("a.cs16", {"center_frequency_hz": CENTER_HZ}, "--sample-rate"),
        ("a.cs16", {"sample_rate_hz": RATE_HZ}, "--center-frequency"),
        ("a.bin", {"sample_rate_hz": RATE_HZ}, "--format"),
        ("missing.cs16", {"sample_rate_hz": 1.0, "center_frequency_hz": 1.0}, "path"),
        ("missing", {}, "path"),
        ("missing.wav", {}, "path"),
        ("missing.sigmf-meta", {}, "path"),
        ("archive.sigmf", {}, "tar -xf"),
        ("empty.cu8", {"sample_rate_hz": 1.0, "center_frequency_hz": 1.0}, "no samples"),
        ("empty.wav", {}, "not a WAV"),
        (".", {"sample_rate_hz": 1.0}, "directory"),
        ("/", {}, "directory"),
    ],
)
def test_what_cannot_be_opened_is_refused_with_the_remedy(
    tmp_path: Path, name: str, given_options: dict[str, float], remedy: str
) -> None:
    for there in ("a.cs16", "a.bin"):
        (tmp_path / there).write_bytes(bytes(400))
    for there in ("empty.cu8", "empty.wav"):
        (tmp_path / there).write_bytes(b"")
    with pytest.raises(FormatError, match=remedy):
        open_recording(tmp_path / name, **given_options)  # type: ignore[arg-type]


@pytest.mark.parametrize("said", ["cs16", "cu8", "ci8"])
@given(level=st.floats(1e-6, 0.5), seed=st.integers(0, 1000))
def test_floats_that_are_said_to_be_integers_are_refused_and_integers_never(
    tmp_path_factory: pytest.TempPathFactory, said: str, level: float, seed: int
) -> None:
    noise = np.random.default_rng(seed).standard_normal(20_000)
    path = tmp_path_factory.mktemp("noise") / "noise.iq"
    path.write_bytes((level * noise).astype("<f4").tobytes())
    with pytest.raises(FormatError, match="--format cf32"):
        open_recording(path, said, sample_rate_hz=RATE_HZ, center_frequency_hz=CENTER_HZ)
    full, dtype = {"cs16": (32768, "<i2"), "cu8": (128, "u1"), "ci8": (128, "i1")}[said]
    limits = np.iinfo(dtype)
    stored = np.clip(
        level * full * noise + (128 if said == "cu8" else 0), limits.min, limits.max
    )
    path.write_bytes(stored.round().astype(dtype).tobytes())
    open_recording(path, said, sample_rate_hz=RATE_HZ, center_frequency_hz=CENTER_HZ).close()


def test_a_sigmf_recording_tells_everything_itself(tmp_path: Path) -> None:
    samples = ramp(30_000)
    meta = write_sigmf(tmp_path / "rec", as_cs16(samples), [CAPTURE])
    for name in (meta, meta.with_suffix(".sigmf-data"), tmp_path / "rec"):
        source = open_recording(name)
        assert source.sample_rate_hz == RATE_HZ
        assert source.center_frequency_hz == CENTER_HZ
        assert source.start_time_ns == START_NS
        read, _ = everything(source)
        np.testing.assert_array_equal(read, samples)


@pytest.mark.parametrize(
    ("counted", "second"),
    [
        ({"core:global_index": 5_000}, SECOND | {"core:global_index": 5_000 + 10_000 + 25_000}),
        ({}, LATER),
        ({"core:global_index": 5_000}, LATER | {"core:global_index": 0}),
    ],
    ids=["counted", "by the times", "opened again, counts anew"],
)
def test_a_gap_between_sigmf_captures_is_a_fact_in_the_stream(
    tmp_path: Path, counted: dict[str, Any], second: dict[str, Any]
) -> None:
    meta = write_sigmf(tmp_path / "rec", as_cs16(ramp(30_000)), [CAPTURE | counted, second])
    read, blocks = everything(open_recording(meta))
    assert len(read) == 30_000
    assert [(b.sample_index, b.lost_before, len(b.samples)) for b in blocks] == [
        (0, 0, 10_000),
        (35_000, 25_000, 20_000),
    ]
    assert blocks[1].time_ns - blocks[0].time_ns == 140_000_000


def test_a_start_time_given_moves_all_captures_alike(tmp_path: Path) -> None:
    meta = write_sigmf(tmp_path / "rec", as_cs16(ramp(20_000)), [CAPTURE, LATER])
    _, blocks = everything(open_recording(meta, start_time_ns=7_000_000_000))
    assert [b.time_ns for b in blocks] == [7_000_000_000, 7_140_000_000]


@pytest.mark.parametrize(
    ("about", "captures", "remedy"),
    [
        ({"core:datatype": "ri16_le"}, [CAPTURE], "real"),
        ({"core:datatype": "cx9"}, [CAPTURE], "Choose from"),
        ({"core:datatype": 7}, [CAPTURE], "core:datatype"),
        ({"core:sample_rate": None}, [CAPTURE], "core:sample_rate"),
        ({"core:sample_rate": "fast"}, [CAPTURE], "number"),
        ({"core:sample_rate": -5}, [CAPTURE], "not possible"),
        ({"core:num_channels": 2}, [CAPTURE], "Split"),
        ({"core:metadata_only": True}, [CAPTURE], "with a .sigmf-data"),
        ({}, [{"core:sample_start": 0}], "--center-frequency"),
        ({}, [CAPTURE, {**CAPTURE, "core:frequency": 1e8}], "Split"),
        ({}, [{**CAPTURE, "core:sample_start": -1}], "whole number"),
        ({}, [{**CAPTURE, "core:datetime": "yesterday"}], "ISO 8601"),
        ({}, [{**CAPTURE, "core:datetime": 20240501}], "ISO 8601"),
        ({"core:sample_rate": 10**400}, [CAPTURE], "number"),
        ({}, [{**CAPTURE, "core:sample_start": 9}, CAPTURE], "Sort"),
        ({}, ["capture"], "list of tables"),
    ],
)
def test_sigmf_that_cannot_be_used_is_refused_with_the_remedy(
    tmp_path: Path, about: dict[str, Any], captures: list[Any], remedy: str
) -> None:
    meta = write_sigmf(tmp_path / "rec", bytes(4000), captures, **about)
    with pytest.raises(FormatError, match=remedy):
        open_recording(meta)


def test_a_sigmf_recording_whose_data_are_truncated_says_so_at_the_end(tmp_path: Path) -> None:
    meta = write_sigmf(tmp_path / "rec", bytes(4000), [CAPTURE, LATER])
    with contextlib.closing(open_recording(meta)) as source:
        assert source.total_samples == 1000
        source.read()
        with pytest.raises(FormatError, match="truncated"):
            source.read()


@settings(max_examples=60)
@given(text=st.binary(max_size=200))
def test_any_bytes_as_sigmf_description_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, text: bytes
) -> None:
    base = tmp_path_factory.mktemp("sigmf")
    (base / "r.sigmf-data").write_bytes(bytes(64))
    (base / "r.sigmf-meta").write_bytes(text)
    with pytest.raises(FormatError):
        open_recording(base / "r.sigmf-meta")


def chunk(name: bytes, body: bytes) -> bytes:
    return name + struct.pack("<I", len(body)) + body + bytes(len(body) & 1)


def wav(
    data: bytes, *, kind: int = 1, bits: int = 16, channels: int = 2, extensible: bool = False
) -> bytes:
    frame = channels * bits // 8
    head = struct.pack(
        "<HHIIHH",
        0xFFFE if extensible else kind,
        channels,
        int(RATE_HZ),
        int(RATE_HZ) * frame,
        frame,
        bits,
    )
    if extensible:
        guid = struct.pack("<H", kind) + bytes.fromhex("000000001000800000aa00389b71")
        head += struct.pack("<HHI", 22, bits, 3) + guid
    return (
        b"RIFF" + struct.pack("<I", 0) + b"WAVE" + chunk(b"fmt ", head) + chunk(b"data", data)
    )


AUXI = chunk(
    b"auxi",
    struct.pack("<16H", 2024, 5, 3, 1, 6, 0, 0, 250, *([0] * 8))
    + struct.pack("<I", int(CENTER_HZ))
    + bytes(28),
)


@pytest.mark.parametrize("extensible", [False, True])
@pytest.mark.parametrize(
    ("kind", "bits"), [(1, 8), (1, 16), (1, 24), (1, 32), (3, 32), (3, 64)]
)
def test_every_wav_encoding_gives_the_same_samples(
    recorded: Recorded, kind: int, bits: int, extensible: bool
) -> None:
    samples = ramp(5000)
    values = samples.view(np.float32).astype(np.float64)
    if kind == 3:
        data = values.astype(f"<f{bits // 8}").tobytes()
    elif bits == 8:
        data = np.round(values * 128 + 127.5).astype("u1").tobytes()
    else:
        whole = (values * 2.0 ** (bits - 1)).astype("<i4").view("u1").reshape(-1, 4)
        data = whole[:, : bits // 8].tobytes()
    source = recorded("a.wav", wav(data, kind=kind, bits=bits, extensible=extensible))
    assert source.sample_rate_hz == RATE_HZ
    read, _ = everything(source)
    np.testing.assert_allclose(read, samples, atol=0.006 if bits == 8 else 1e-7)


@pytest.mark.parametrize("before", [True, False])
def test_a_wav_file_of_an_sdr_program_tells_its_start_and_frequency(
    recorded: Recorded, before: bool
) -> None:
    plain = wav(as_cs16(ramp(100)))
    at = plain.index(b"data")
    told = plain[:at] + AUXI + plain[at:] if before else plain + AUXI
    source = recorded("a.wav", told, center_frequency_hz=None)
    assert source.center_frequency_hz == CENTER_HZ
    assert source.start_time_ns == START_NS + 250_000_000
    assert source.total_samples == 100


@pytest.mark.parametrize(
    ("data", "remedy"),
    [
        (wav(bytes(40), channels=1), "an I/Q recording has 2"),
        (wav(bytes(40), kind=2), "encoding"),
        (wav(bytes(40))[:30], "format chunk"),
        (wav(b"")[:-8], "no samples"),
        (wav(bytes(40)), "--center-frequency"),
        (b"RIFF0000AVI ", "not a WAV"),
    ],
)
def test_wav_that_cannot_be_used_is_refused_with_the_remedy(
    recorded: Recorded, data: bytes, remedy: str
) -> None:
    with pytest.raises(FormatError, match=remedy):
        recorded("a.wav", data, center_frequency_hz=None)


@pytest.mark.parametrize(
    ("name", "data", "whole", "fault"),
    [
        ("a.cs16", as_cs16(ramp(1000))[:-1], 999, r"middle of a sample .*truncated"),
        ("a.wav", wav(as_cs16(ramp(1000)))[:-400], 900, "truncated"),
    ],
)
def test_a_truncated_file_gives_its_whole_samples_and_then_the_fault(
    recorded: Recorded, name: str, data: bytes, whole: int, fault: str
) -> None:
    source = recorded(name, data)
    assert len(some(source.read()).samples) == whole
    with pytest.raises(FormatError, match=fault):
        source.read()


@settings(max_examples=100)
@given(cut=st.integers(0, 200), noise=st.binary(min_size=0, max_size=30), at=st.integers(0, 60))
def test_any_damage_to_a_wav_header_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, cut: int, noise: bytes, at: int
) -> None:
    whole = wav(bytes(100))
    damaged = (whole[:at] + noise + whole[at + len(noise) :])[: len(whole) - cut]
    path = tmp_path_factory.mktemp("wav") / "a.wav"
    path.write_bytes(whole)
    open_recording(path, center_frequency_hz=CENTER_HZ).close()
    path.write_bytes(damaged)
    with contextlib.suppress(FormatError):
        open_recording(path, center_frequency_hz=CENTER_HZ).close()


def test_a_rate_that_contradicts_the_file_is_refused(recorded: Recorded) -> None:
    with pytest.raises(FormatError, match="Omit --sample-rate"):
        recorded("a.wav", wav(bytes(400)), sample_rate_hz=3e6)
