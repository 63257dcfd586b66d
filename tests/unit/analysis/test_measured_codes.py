"""Coded tags whose pulses are not all 2.5 ms long are measured as coded tags."""

from pathlib import Path

import numpy as np
import pytest
from command_line import uavrt

from uavrt.config.tags.tag_files import parse_tags

RATE_HZ = 48_000
CENTER_HZ = 166_380_000


def recording(
    path: Path,
    widths_s: tuple[float, ...],
    gaps_s: tuple[float, ...],
    *,
    interval_s: float,
    offset_hz: float,
    enr_db: float,
    seed: int,
    beep_s: float | None = None,
) -> Path:
    """Record 60 s of a coded tag, and of a tag that beeps 300 Hz beside it."""
    rng = np.random.default_rng(seed)
    count = 60 * RATE_HZ
    samples = rng.standard_normal((count, 2)).astype(np.float32).view(np.complex64)[:, 0]
    amplitude = np.sqrt(2.0 * 10 ** (enr_db / 10.0) / (RATE_HZ * 0.0025))
    bursts_s = np.arange(0.7, 59.0, interval_s)
    starts_s = np.concatenate(([0.0], np.cumsum(gaps_s)))
    pulses = [
        (burst_s + start_s, width_s, offset_hz)
        for burst_s in bursts_s
        for start_s, width_s in zip(starts_s, widths_s, strict=True)
    ]
    if beep_s is not None:
        pulses += [(at_s, 0.015, offset_hz + 300.0) for at_s in np.arange(0.4, 59.0, beep_s)]
    for start_s, width_s, frequency_hz in pulses:
        first = round(start_s * RATE_HZ)
        at = np.arange(first, first + round(width_s * RATE_HZ))
        wave = amplitude * np.exp(2j * np.pi * frequency_hz / RATE_HZ * at)
        samples[at] += wave.astype(np.complex64)
    samples.tofile(path)
    return path


def measured(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    radio = ("--sample-rate", str(RATE_HZ), "--center-frequency", str(CENTER_HZ))
    assert uavrt("tags", "measure", str(path), *radio) == 0
    return capsys.readouterr()


@pytest.mark.parametrize(
    ("widths_s", "gaps_s", "interval_s", "offset_hz", "enr_db"),
    [
        ((0.0075, 0.005, 0.005, 0.005), (0.031, 0.027, 0.052), 4.1, -9100.0, 24.0),
        ((0.006, 0.004, 0.004, 0.004, 0.004), (0.019, 0.04, 0.025, 0.06), 6.3, 3000.0, 30.0),
        ((0.003, 0.003, 0.003), (0.031, 0.047), 3.3, 7700.0, 18.0),
    ],
)
def test_pulses_of_any_length_make_one_coded_tag(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    widths_s: tuple[float, ...],
    gaps_s: tuple[float, ...],
    interval_s: float,
    offset_hz: float,
    enr_db: float,
) -> None:
    path = recording(
        tmp_path / "old.cf32",
        widths_s,
        gaps_s,
        interval_s=interval_s,
        offset_hz=offset_hz,
        enr_db=enr_db,
        seed=len(widths_s),
    )
    written, reported = measured(path, capsys)
    (tag,) = parse_tags(written.encode(), name="tags.toml")
    assert tag.gaps_s == pytest.approx(gaps_s, abs=1.5e-4)
    assert list(tag.pulse_intervals_s) == pytest.approx([interval_s], abs=2e-4)
    assert tag.pulse_width_s == pytest.approx(widths_s[-1])
    assert "doubtful" not in reported


def test_a_tag_that_beeps_beside_a_coded_tag_is_measured_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = recording(
        tmp_path / "both.cf32",
        (0.0075, 0.005, 0.005, 0.005),
        (0.031, 0.027, 0.052),
        interval_s=4.1,
        offset_hz=1000.0,
        enr_db=26.0,
        seed=7,
        beep_s=1.3,
    )
    written, _ = measured(path, capsys)
    coded, beeps = sorted(
        parse_tags(written.encode(), name="tags.toml"), key=lambda tag: not tag.coded
    )
    assert coded.gaps_s == pytest.approx((0.031, 0.027, 0.052), abs=2e-4)
    assert list(beeps.pulse_intervals_s) == pytest.approx([1.3], abs=1e-3)
