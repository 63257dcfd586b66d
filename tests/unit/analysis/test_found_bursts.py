"""Bursts of listed codes among pulses that another program found."""

from dataclasses import replace

import made
import numpy as np
import pytest

from uavrt.analysis.inputs.found_bursts import bursts_of_pulses
from uavrt.core.messages import PulsePose

TAG = made.tag(
    12,
    166_380_000.0,
    20.0,
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0196, 0.0244),
)
NEAR = replace(TAG, tag_id=13, gaps_s=(0.0216, 0.0194, 0.0243))
"""Its gaps are 0.7 ms away together, less than a burst is known to."""
FAR = replace(TAG, tag_id=13, gaps_s=(0.0415, 0.0196, 0.0244))
OTHER_INTERVAL = replace(TAG, tag_id=13, pulse_intervals_s=(13.1,))


def _pulse(at_s: float, snr_db: float) -> PulsePose:
    start_ns = 10**18 + round(at_s * 1e9)
    pulse = made.pulse(
        start_ns,
        tag_id=1,
        frequency_hz=166_380_000.0,
        end_time_ns=start_ns + 2_500_000,
        snr_db=snr_db,
        detection_status="detected",
        confirmed=False,
    )
    return PulsePose(pulse=pulse, pose=None)


def _heard(interval_s: float, antennas: int, first_s: float = 5.0) -> list[PulsePose]:
    """Thirty bursts of one tag, each pulse once for each antenna of the station."""
    rng = np.random.default_rng(antennas)
    return [
        _pulse(
            first_s + number * interval_s + after_s + rng.normal(0.0, 8e-5),
            30.0 - 6.0 * antenna + rng.normal(),
        )
        for number in range(30)
        for after_s in (0.0, 0.022, 0.0416, 0.066)
        for antenna in range(antennas)
    ]


@pytest.mark.parametrize("antennas", [1, 2, 4])
def test_antennas_of_one_station_make_one_animal_and_each_burst_once(antennas: int) -> None:
    """Two made a second animal of a near code, and four nearly twice as many bursts."""
    heard = _heard(20.0, antennas)
    far = [one.pulse for one in bursts_of_pulses(heard, [TAG, FAR])]
    assert [one.tag_id for one in far] == [12] * 30
    assert all(one.confirmed and not one.also_possible_tag_ids for one in far)
    assert all(one.snr_db > 27.0 for one in far)  # of the antenna that hears it best
    near = [one.pulse for one in bursts_of_pulses(heard, [TAG, NEAR])]
    assert len(near) == 30
    assert all({one.tag_id, *one.also_possible_tag_ids} == {12, 13} for one in near)
    assert not any(one.confirmed for one in near)


@pytest.mark.parametrize(("interval_s", "tag_id"), [(20.0, 12), (13.1, 13)])
def test_of_tags_with_one_code_the_interval_names_the_right_one(
    interval_s: float, tag_id: int
) -> None:
    bursts = bursts_of_pulses(_heard(interval_s, 1), [TAG, OTHER_INTERVAL])
    assert [one.pulse.tag_id for one in bursts] == [tag_id] * 30
    assert all(one.pulse.confirmed for one in bursts)


def test_both_tags_of_one_code_are_distinguished_when_both_are_on_air() -> None:
    heard = [*_heard(20.0, 1), *_heard(13.1, 1, first_s=9.3)]
    bursts = bursts_of_pulses(heard, [TAG, OTHER_INTERVAL])
    confirmed = [one.pulse.tag_id for one in bursts if one.pulse.confirmed]
    assert confirmed.count(12) >= 28
    assert confirmed.count(13) >= 28
    assert len(bursts) == 60
