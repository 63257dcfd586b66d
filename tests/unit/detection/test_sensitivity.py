"""What the search needs, from its thresholds, is what the experiments measure."""

from itertools import pairwise

import made
import pytest

from uavrt.core.messages import Tag
from uavrt.detection.sensitivity import detection_probability, enr_needed_db
from uavrt.guidance.search.pulse_evidence import threshold_db


def tag(k: int, uncertainty_s: float = 0.060, jitter_s: float = 0.010) -> Tag:
    return made.tag(interval_uncertainty_s=uncertainty_s, interval_jitter_s=jitter_s, k=k)


@pytest.mark.parametrize(
    ("k", "probability", "window_hz", "measured_db"),
    [
        (3, 0.5, 500.0, 8.67),
        (3, 0.9, 500.0, 10.33),
        (1, 0.5, 1e9, 11.78),
        (2, 0.5, 1e9, 9.89),
        (5, 0.5, 1e9, 7.34),
        (8, 0.5, 1e9, 6.10),
        (12, 0.5, 1e9, 5.05),
    ],
)
def test_the_level_needed_is_the_one_that_was_measured(
    k: int, probability: float, window_hz: float, measured_db: float
) -> None:
    found = enr_needed_db(tag(k), probability, frequency_window_hz=window_hz)
    assert found == pytest.approx(measured_db, abs=0.3)


def test_a_long_group_of_a_well_known_interval_needs_less() -> None:
    levels = [
        enr_needed_db(tag(k, 0.000125, 0.002), 0.5, frequency_window_hz=100.0) for k in (20, 40)
    ]
    assert levels == pytest.approx([1.76, 0.55], abs=0.3)


@pytest.mark.parametrize("k", [1, 3, 12, 40])
def test_stronger_pulses_are_found_more_often(k: int) -> None:
    found = [detection_probability(tag(k), enr_db) for enr_db in range(-5, 25, 2)]
    assert all(more > less - 1e-9 for less, more in pairwise(found))
    assert found[0] < 0.1
    assert found[-1] > 0.99


@pytest.mark.parametrize(("bursts", "measured_db"), [(1, 9.69), (3, 5.98), (10, 2.68)])
def test_the_level_that_coded_bursts_need_is_the_one_that_was_measured(
    bursts: int, measured_db: float
) -> None:
    coded = made.tag(
        12,
        166.38e6,
        5.3,
        pulse_width_s=0.0025,
        interval_uncertainty_s=0.004,
        k=bursts,
        gaps_s=(0.022, 0.0488, 0.0366),
    )
    assert enr_needed_db(coded, 0.5) == pytest.approx(measured_db, abs=0.3)
    assert threshold_db(bursts, coded=True) == pytest.approx(measured_db, abs=0.7)
    assert enr_needed_db(coded, 0.9) > enr_needed_db(coded, 0.5)
