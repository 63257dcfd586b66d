"""Coded tags are measured whatever their burst interval, also where nothing beats."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command_line import uavrt
from depth import share
from gapped import GAP_S, KINDS, write_gapped

from uavrt.config.tags.tag_files import parse_tags

pytestmark = pytest.mark.slow

RATE_HZ = 8000.0
RADIO = ("--sample-rate", "8e3", "--center-frequency", "166.38e6")
GAPS_S = (0.022, 0.0488, 0.0366)


def _record(path: Path, length_s: float, starts_s: Sequence[float]) -> None:
    """Write noise with bursts of 30 dB a pulse, 1.2 kHz above the middle."""
    rng = np.random.default_rng(17)
    parts = rng.standard_normal((round(length_s * RATE_HZ), 2)).astype(np.float32)
    samples = (parts * np.float32(0.5**0.5)).view(np.complex64).ravel()
    amplitude = np.sqrt(10**3.0 / (0.0025 * RATE_HZ))
    for start_s in starts_s:
        for place in range(len(GAPS_S) + 1):
            first_s = start_s + sum(GAPS_S[:place])
            t = np.arange(round(first_s * RATE_HZ), round((first_s + 0.0025) * RATE_HZ))
            wave = amplitude * np.exp(2j * np.pi * 1200.0 * t / RATE_HZ)
            samples[t] += wave.astype(np.complex64)
    samples.tofile(path)


@pytest.mark.parametrize("where", [(), ("--frequency", "166.3812e6")])
@pytest.mark.parametrize("interval_s", [7.1, 20.0])
def test_bursts_more_than_six_seconds_apart_are_a_code(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    interval_s: float,
    where: tuple[str, ...],
) -> None:
    path = tmp_path / "a.cf32"
    _record(path, 90.0, np.arange(1.0, 89.0, interval_s).tolist())
    assert uavrt("tags", "measure", str(path), *RADIO, *where) == 0
    written, told = capsys.readouterr()
    (tag,) = parse_tags(written.encode(), name="tags.toml")
    assert tag.gaps_s == pytest.approx(GAPS_S, abs=3e-4)
    assert tag.pulse_intervals_s[0] == pytest.approx(interval_s, abs=1e-3)
    assert tag.frequency_hz == pytest.approx(166_381_200.0, abs=60.0)
    line = next(line for line in told.splitlines() if line.startswith("  bursts"))
    assert 0.0 < float(line.split("±")[1].split()[0]) < 1.0


def test_an_interval_is_told_where_no_two_bursts_in_a_row_were_heard(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.cf32"
    _record(path, 100.0, [1.0 + 7.1 * number for number in (0, 2, 5, 7, 9, 12)])
    assert uavrt("tags", "measure", str(path), *RADIO) == 0
    (tag,) = parse_tags(capsys.readouterr().out.encode(), name="tags.toml")
    assert tag.pulse_intervals_s[0] == pytest.approx(7.1, abs=1e-3)


@pytest.mark.parametrize("kind", share([*KINDS], 3))
def test_behind_a_gap_bursts_keep_their_true_times(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    path = tmp_path / "a.cf32"
    _record(path, 90.0, np.arange(1.0, 89.0, 7.1).tolist())
    gapped = write_gapped(
        tmp_path / "band",
        np.fromfile(path, np.complex64),
        rate_hz=RATE_HZ,
        center_hz=166.38e6,
        start_ns=1_714_543_200_000_000_000,
        gap_s=(40.0, 40.0 + GAP_S),
        kind=kind,
    )
    assert uavrt("tags", "measure", str(gapped)) == 0
    written, told = capsys.readouterr()
    (tag,) = parse_tags(written.encode(), name="tags.toml")
    assert tag.gaps_s == pytest.approx(GAPS_S, abs=3e-4)
    assert tag.pulse_intervals_s[0] == pytest.approx(7.1, abs=1e-3)
    line = next(line for line in told.splitlines() if line.startswith("  bursts"))
    assert 0.0 < float(line.split("±")[1].split()[0]) < 1.0


def test_bursts_that_keep_no_beat_are_no_tag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.cf32"
    _record(path, 60.0, [1.0, 8.3, 17.9, 24.2, 35.01, 44.77, 52.4])
    assert uavrt("tags", "measure", str(path), *RADIO) == 2
    assert "no regular pulses in 60 s" in capsys.readouterr().err


def test_a_code_in_a_recording_that_was_cut_off_is_measured_and_the_fault_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.cf32"
    _record(path, 60.0, np.arange(1.0, 59.0, 7.1).tolist())
    path.write_bytes(path.read_bytes()[:-3])
    assert uavrt("tags", "measure", str(path), *RADIO) == 2
    written, told = capsys.readouterr()
    assert len(parse_tags(written.encode(), name="tags.toml")) == 1
    assert "all complete samples were used" in told
