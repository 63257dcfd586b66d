"""What a detector reports of the time that it has searched: usable share and weakest tag."""

from dataclasses import replace
from pathlib import Path

import made
import numbered
import numpy as np
import pytest
from numpy.typing import NDArray

from uavrt.core.messages import SearchReport, Tag
from uavrt.detection.track.search_band import SearchBand
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_search_reports
from uavrt_experiments.detection.neighbours import MainsSparks, Neighbour, Noise
from uavrt_experiments.detection.signals import THESIS_TAG, add_pulse, noise, pulse_train
from uavrt_experiments.detection.trials import Decision, blocks_of

RATE_HZ = 3750.0


def reports_of(samples: NDArray[np.complex64], tag: Tag = THESIS_TAG) -> list[SearchReport]:
    """Search reports of a detector over samples, without its first five seconds."""
    detector = made.detector(tag, RATE_HZ)
    for block, time_ns in blocks_of(samples):
        detector.process(block, time_ns)
    return detector.search_reports()[5:]


def usable(reports: list[SearchReport]) -> float:
    """Mean usable share."""
    return float(np.mean([r.usable_share for r in reports if r.usable_share is not None]))


def slots(on_s: float, off_s: float, seconds: float) -> tuple[NDArray[np.bool_], int]:
    """Which samples lie in the slots of a frame."""
    count = round(seconds * RATE_HZ)
    return (np.arange(count) / RATE_HZ) % (on_s + off_s) < on_s, count


@pytest.mark.parametrize(
    ("on_s", "off_s"),
    [(0.5, 0.5), (2.0, 1.0), (0.3, 0.9)],
    ids=["half", "two thirds", "quarter"],
)
def test_the_usable_share_leaves_out_what_another_transmitter_takes(
    on_s: float, off_s: float
) -> None:
    rng = np.random.default_rng(70)
    sending, count = slots(on_s, off_s, 40.0)
    samples = noise(rng, count)
    samples += np.where(sending, 56.0 * noise(rng, count), 0.0).astype(np.complex64)
    share = usable(reports_of(samples))
    assert share == pytest.approx(off_s / (on_s + off_s), abs=0.05)


@pytest.mark.parametrize(
    "make",
    [
        None,
        Neighbour(edge_hz=800.0, level_db=30.0),
        MainsSparks(per_s=100.0, duty=0.15, level_db=6.0),
    ],
    ids=["white", "neighbour", "sparks"],
)
def test_a_frequency_with_noise_and_a_tag_is_usable(make: Noise | None) -> None:
    rng = np.random.default_rng(71)
    samples = noise(rng, round(30.0 * RATE_HZ))
    if make is not None:
        samples += make(rng, len(samples))
    for pulse in pulse_train(
        rng,
        duration_s=30.0,
        interval_s=1.25,
        offset_hz=0.0,
        enr_db=25.0,
        jitter_s=0.0,
        width_s=0.02,
    ):
        add_pulse(samples, pulse, sample_rate_hz=RATE_HZ, width_s=0.02, phase=0.0)
    assert usable(reports_of(samples)) > 0.95


@pytest.mark.slow
def test_eight_to_ten_of_ten_groups_are_found_at_the_weakest_level() -> None:
    reports = reports_of(noise(np.random.default_rng(72), round(20.0 * RATE_HZ)))
    weakest_db = np.mean([r.weakest_enr_db for r in reports if r.weakest_enr_db is not None])
    decision = Decision(frequency_window_hz=500.0, band_hz=400.0)
    found = [
        decision.found(np.random.default_rng([73, i]), float(weakest_db)) for i in range(90)
    ]
    assert 0.8 <= np.mean(found) <= 1.0
    weaker = [
        decision.found(np.random.default_rng([74, i]), float(weakest_db) - 2.0)
        for i in range(40)
    ]
    assert np.mean(weaker) < 0.8


def test_the_weakest_level_follows_the_threshold_in_force() -> None:
    detector = made.detector(THESIS_TAG, RATE_HZ)
    band: SearchBand = detector.band
    usual_db = band.weakest_enr_db()
    for search in band.anchor_searches:
        search.own_margin *= 1.3
    assert 0.8 < band.weakest_enr_db() - usual_db < 1.6


def test_the_flight_directory_keeps_the_report(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight")
    plain = SearchReport(
        tag_id=2, time_ns=1, frequency_hz=148e6, noise_psd=1e-9, best_score=0.5
    )
    full = replace(plain, time_ns=2, usable_share=0.5, weakest_enr_db=10.5)
    recorder = FlightRecorder.create(info)
    recorder.write(plain)
    recorder.write(full)
    recorder.close()
    assert read_search_reports(info.directory) == (plain, full)
