"""What a detector reports of the time that it has searched: usable share and weakest tag."""

from dataclasses import replace
from pathlib import Path

import made
import numbered
import numpy as np
import pytest
from numpy.typing import NDArray
from streams import fed, sent

from uavrt.core.messages import SearchReport
from uavrt.detection.track.search_band import SearchBand
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_search_reports
from uavrt_experiments.detection.neighbours import MainsSparks, Neighbour, Noise
from uavrt_experiments.detection.signals import THESIS_TAG, noise
from uavrt_experiments.detection.trials import Decision

RATE_HZ = 3750.0


def reports_of(samples: NDArray[np.complex64]) -> list[SearchReport]:
    """Search reports of a detector over samples, without its first five seconds."""
    detector = made.detector(THESIS_TAG, RATE_HZ)
    fed(detector, samples)
    return detector.search_reports()[5:]


def usable(reports: list[SearchReport]) -> float:
    """Mean usable share."""
    return float(np.mean([r.usable_share for r in reports if r.usable_share is not None]))


@pytest.mark.parametrize(
    ("on_s", "off_s"),
    [(0.5, 0.5), (2.0, 1.0), (0.3, 0.9)],
    ids=["half", "two thirds", "quarter"],
)
def test_the_usable_share_leaves_out_what_another_transmitter_takes(
    on_s: float, off_s: float
) -> None:
    rng = np.random.default_rng(70)
    samples = noise(rng, round(40.0 * RATE_HZ))
    sending = np.arange(len(samples)) / RATE_HZ % (on_s + off_s) < on_s
    samples += np.where(sending, 56.0 * noise(rng, len(samples)), 0.0).astype(np.complex64)
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
    _, samples = sent(71, 30.0, 25.0, interval_s=1.25)
    if make is not None:
        samples += make(np.random.default_rng(72), len(samples))
    assert usable(reports_of(samples)) > 0.95


@pytest.mark.slow
def test_eight_to_ten_of_ten_groups_are_found_at_the_weakest_level() -> None:
    reports = reports_of(noise(np.random.default_rng(72), round(20.0 * RATE_HZ)))
    weakest_db = float(np.mean([r.weakest_enr_db for r in reports if r.weakest_enr_db]))
    decision = Decision(frequency_window_hz=500.0, band_hz=400.0)

    def found(below_db: float, count: int) -> float:
        level_db = weakest_db - below_db
        rngs = (np.random.default_rng([73, n]) for n in range(count))
        return float(np.mean([decision.found(rng, level_db) for rng in rngs]))

    assert 0.8 <= found(0.0, 60) <= 1.0
    assert found(2.0, 30) < 0.8


def test_the_weakest_level_follows_the_threshold_in_force() -> None:
    detector = made.detector(THESIS_TAG, RATE_HZ)
    band: SearchBand = detector.band
    usual_db = band.weakest_enr_db()
    for search in band.anchor_searches:
        search.own_margin *= 1.3
    assert 0.8 < band.weakest_enr_db() - usual_db < 1.6


def test_the_flight_directory_keeps_the_report(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight")
    plain = made.search_report(2, 1)
    full = replace(plain, time_ns=2, usable_share=0.5, weakest_enr_db=10.5)
    recorder = FlightRecorder.create(info)
    recorder.write(plain, full)
    recorder.close()
    assert read_search_reports(info.directory) == (plain, full)
