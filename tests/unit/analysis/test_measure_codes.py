"""Coded tags are measured whatever their burst interval and pulse lengths, also in gaps."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command_line import Printed, Ran
from depth import share
from gapped import GAP_S, KINDS, write_gapped

from uavrt.config.tags.tag_files import parse_tags
from uavrt.core.messages import Tag

pytestmark = pytest.mark.slow

CENTER_HZ = 166.38e6
RATE_HZ = 8000.0
GAPS_S = (0.022, 0.0488, 0.0366)
WIDTHS_S = (0.0025,) * 4


def record(
    path: Path,
    length_s: float,
    starts_s: Sequence[float],
    *,
    rate_hz: float = RATE_HZ,
    widths_s: Sequence[float] = WIDTHS_S,
    gaps_s: Sequence[float] = GAPS_S,
    offset_hz: float = 1200.0,
    enr_db: float = 30.0,
    beeps_s: Sequence[float] = (),
) -> tuple[object, ...]:
    """Write noise with bursts, and with beeps 300 Hz above them; the recording as arguments."""
    rng = np.random.default_rng(17)
    parts = rng.standard_normal((round(length_s * rate_hz), 2)).astype(np.float32)
    samples = (parts * np.float32(0.5**0.5)).view(np.complex64).ravel()
    amplitude = np.sqrt(10 ** (enr_db / 10.0) / (0.0025 * rate_hz))
    within_s = np.concatenate(([0.0], np.cumsum(gaps_s)))
    pulses = [
        (burst_s + start_s, width_s, offset_hz)
        for burst_s in starts_s
        for start_s, width_s in zip(within_s, widths_s, strict=True)
    ]
    pulses += [(start_s, 0.015, offset_hz + 300.0) for start_s in beeps_s]
    for start_s, width_s, frequency_hz in pulses:
        t = np.arange(round(start_s * rate_hz), round((start_s + width_s) * rate_hz))
        wave = amplitude * np.exp(2j * np.pi * frequency_hz * t / rate_hz)
        samples[t] += wave.astype(np.complex64)
    samples.tofile(path)
    return path, "--sample-rate", rate_hz, "--center-frequency", CENTER_HZ


def tags_in(printed: Printed) -> tuple[Tag, ...]:
    return parse_tags(printed.out.encode(), name="tags.toml")


def sigma_ms(printed: Printed) -> float:
    """What is said of the burst interval's deviation."""
    line = next(line for line in printed.err.splitlines() if line.startswith("  bursts"))
    return float(line.split("±")[1].split()[0])


@pytest.mark.parametrize(
    ("interval_s", "where"), [(7.1, ("--frequency", "166.3812e6")), (20.0, ())]
)
def test_bursts_more_than_six_seconds_apart_are_a_code(
    tmp_path: Path, ran: Ran, interval_s: float, where: tuple[str, ...]
) -> None:
    samples = record(tmp_path / "a.cf32", 85.0, np.arange(1.0, 84.0, interval_s).tolist())
    measured = ran("tags", "measure", *samples, *where)
    (tag,) = tags_in(measured)
    assert tag.gaps_s == pytest.approx(GAPS_S, abs=3e-4)
    assert tag.pulse_intervals_s[0] == pytest.approx(interval_s, abs=1e-3)
    assert tag.frequency_hz == pytest.approx(166_381_200.0, abs=60.0)
    assert 0.0 < sigma_ms(measured) < 1.0


def test_an_interval_is_told_where_no_two_bursts_in_a_row_were_heard(
    tmp_path: Path, ran: Ran
) -> None:
    starts_s = [1.0 + 7.1 * number for number in (0, 2, 5, 7, 9)]
    (tag,) = tags_in(ran("tags", "measure", *record(tmp_path / "a.cf32", 66.0, starts_s)))
    assert tag.pulse_intervals_s[0] == pytest.approx(7.1, abs=1e-3)


@pytest.mark.parametrize("kind", share([*KINDS], 3))
def test_behind_a_gap_bursts_keep_their_true_times(tmp_path: Path, ran: Ran, kind: str) -> None:
    path = tmp_path / "a.cf32"
    record(path, 60.0, np.arange(1.0, 59.0, 7.1).tolist())
    gapped = write_gapped(
        tmp_path / "band",
        np.fromfile(path, np.complex64),
        rate_hz=RATE_HZ,
        center_hz=CENTER_HZ,
        start_ns=1_714_543_200_000_000_000,
        gap_s=(33.0, 33.0 + GAP_S),
        kind=kind,
    )
    measured = ran("tags", "measure", gapped)
    (tag,) = tags_in(measured)
    assert tag.gaps_s == pytest.approx(GAPS_S, abs=3e-4)
    assert tag.pulse_intervals_s[0] == pytest.approx(7.1, abs=1e-3)
    assert 0.0 < sigma_ms(measured) < 1.0


def test_bursts_that_keep_no_beat_are_no_tag(tmp_path: Path, ran: Ran) -> None:
    starts_s = [1.0, 8.3, 17.9, 24.2, 35.01, 44.77, 52.4]
    samples = record(tmp_path / "a.cf32", 60.0, starts_s)
    assert "no regular pulses in 60 s" in ran("tags", "measure", *samples, ends=2).err


def test_a_code_in_a_recording_that_was_cut_off_is_measured_and_the_fault_told(
    tmp_path: Path, ran: Ran
) -> None:
    path = tmp_path / "a.cf32"
    samples = record(path, 45.0, np.arange(1.0, 44.0, 7.1).tolist())
    path.write_bytes(path.read_bytes()[:-3])
    measured = ran("tags", "measure", *samples, ends=2)
    assert len(tags_in(measured)) == 1
    assert "all complete samples were used" in measured.err


@pytest.mark.parametrize(
    ("widths_s", "gaps_s", "interval_s", "offset_hz", "enr_db"),
    [
        ((0.0075, 0.005, 0.005, 0.005), (0.031, 0.027, 0.052), 4.1, -5100.0, 24.0),
        ((0.006, 0.004, 0.004, 0.004, 0.004), (0.019, 0.04, 0.025, 0.06), 6.3, 3000.0, 30.0),
        ((0.003, 0.003, 0.003), (0.031, 0.047), 3.3, 4700.0, 18.0),
    ],
)
def test_pulses_of_any_length_make_one_coded_tag(
    tmp_path: Path,
    ran: Ran,
    widths_s: tuple[float, ...],
    gaps_s: tuple[float, ...],
    interval_s: float,
    offset_hz: float,
    enr_db: float,
) -> None:
    samples = record(
        tmp_path / "old.cf32",
        45.0,
        np.arange(0.7, 44.0, interval_s).tolist(),
        rate_hz=16e3,
        widths_s=widths_s,
        gaps_s=gaps_s,
        offset_hz=offset_hz,
        enr_db=enr_db,
    )
    measured = ran("tags", "measure", *samples)
    (tag,) = tags_in(measured)
    assert tag.gaps_s == pytest.approx(gaps_s, abs=1.5e-4)
    assert list(tag.pulse_intervals_s) == pytest.approx([interval_s], abs=2e-4)
    assert tag.pulse_width_s == pytest.approx(widths_s[-1])
    assert "doubtful" not in measured.err


def test_a_tag_that_beeps_beside_a_coded_tag_is_measured_too(tmp_path: Path, ran: Ran) -> None:
    samples = record(
        tmp_path / "both.cf32",
        45.0,
        np.arange(0.7, 44.0, 4.1).tolist(),
        rate_hz=16e3,
        widths_s=(0.0075, 0.005, 0.005, 0.005),
        gaps_s=(0.031, 0.027, 0.052),
        enr_db=26.0,
        beeps_s=np.arange(0.4, 44.0, 1.3).tolist(),
    )
    both = tags_in(ran("tags", "measure", *samples))
    coded, beeps = sorted(both, key=lambda tag: not tag.coded)
    assert coded.gaps_s == pytest.approx((0.031, 0.027, 0.052), abs=2e-4)
    assert list(beeps.pulse_intervals_s) == pytest.approx([1.3], abs=1e-3)
