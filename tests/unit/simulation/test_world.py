from dataclasses import replace
from typing import Any

import made
import numpy as np
import pytest

from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.propagation import SPEED_OF_LIGHT_M_S, Propagation
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.world import TruePulse, World

SECOND_NS = 10**9


def truth(scenario: Scenario, duration_s: float = 60.0) -> list[TruePulse]:
    start_ns = scenario.start_time_ns
    return World(scenario).truth(start_ns, start_ns + round(duration_s * SECOND_NS))


def sent(duration_s: float, **tag: Any) -> list[TruePulse]:
    """Pulses of the tag at rest, with some changes."""
    return truth(made.still_scenario(tag=(replace(made.STILL_TAG, **tag),)), duration_s)


def test_pulses_come_at_the_interval_and_arrive_by_the_speed_of_light() -> None:
    scenario = made.still_scenario()
    pulses = truth(scenario, 10.0)
    assert [pulse.pulse_index for pulse in pulses] == list(range(10))
    first_ns, way_ns = scenario.start_time_ns + SECOND_NS // 2, 100e9 / SPEED_OF_LIGHT_M_S
    for pulse in pulses:
        assert pulse.transmit_time_ns == first_ns + pulse.pulse_index * SECOND_NS
        assert pulse.start_time_ns - pulse.transmit_time_ns == round(way_ns)
        assert pulse.end_time_ns - pulse.start_time_ns == 20_000_000


def test_the_level_is_the_link_budget() -> None:
    pulse = truth(made.still_scenario(), 1.0)[0]
    # -80 dBm - 20 log10(4π·100·f/c) = -135.97 dBm; the noise is -173.975 + 8 dBm/Hz; 20 ms.
    assert pulse.received_power_dbm == pytest.approx(-135.966, abs=0.01)
    assert pulse.enr_db == pytest.approx(-135.966 + 165.975 - 16.990, abs=0.01)


def test_interval_error_accumulates_and_jitter_does_not() -> None:
    pulses = sent(600.0, interval_error_s=0.03, jitter_s=0.02)
    starts_s = np.array([p.transmit_time_ns - pulses[0].transmit_time_ns for p in pulses]) / 1e9
    off_s = starts_s - 1.03 * np.arange(len(pulses))
    off_s -= off_s.mean()
    assert np.abs(off_s).max() < 0.021
    assert off_s.std() == pytest.approx(0.02 / np.sqrt(3.0), rel=0.1)


def test_a_tag_goes_over_to_its_other_rate_and_back() -> None:
    pulses = sent(
        9.5, pulse_intervals_s=(1.0, 2.0), first_pulse_s=0.0, rate_switches_s=(3.0, 7.0)
    )
    assert [p.rate for p in pulses] == [1, 1, 1, 2, 2, 1, 1, 1]
    seconds = [(p.transmit_time_ns - pulses[0].transmit_time_ns) / 1e9 for p in pulses]
    assert seconds == pytest.approx([0, 1, 2, 3, 5, 7, 8, 9])


def test_a_tag_repeats_its_pattern_of_rates() -> None:
    pulses = sent(12.0, pulse_intervals_s=(1.0, 1.5), rate_pattern=(1, 1, 2))
    gaps = np.diff([p.transmit_time_ns for p in pulses]) / 1e9
    assert list(gaps[:7]) == pytest.approx([1.0, 1.0, 1.5, 1.0, 1.0, 1.5, 1.0])


def test_the_crystal_is_off_and_drifts() -> None:
    first, *_, last = sent(
        60.0, frequency_offset_hz=100.0, frequency_offset_ppm=2.0, frequency_drift_hz_s=0.5
    )
    expected_hz = made.STILL_TAG.frequency_hz * (1 + 2e-6) + 100.0 + 0.5 * 0.5
    assert first.frequency_hz == pytest.approx(expected_hz, abs=1e-3)
    assert last.frequency_hz - first.frequency_hz == pytest.approx(0.5 * 59.0, abs=1e-3)


def test_an_approaching_drone_hears_the_carrier_higher() -> None:
    flight = Flight(
        height_m=30.0,
        north_m=-500.0,
        wobble_deg=0.0,
        leg=(Leg(duration_s=50.0, north_m=-100.0),),
    )
    scenario = made.still_scenario(flight=flight)
    still = made.still_scenario(flight=flight, propagation=Propagation(doppler=False))
    middle, quiet = truth(scenario)[25], truth(still)[25]
    # 8 m/s in the mean, 12.3 m/s in the middle: 150 MHz · 12.3 / c = 6.16 Hz.
    assert middle.frequency_hz - made.STILL_TAG.frequency_hz == pytest.approx(6.16, abs=0.01)
    assert quiet.frequency_hz == made.STILL_TAG.frequency_hz


def test_an_animal_walks_straight_on() -> None:
    scenario = made.still_scenario(
        tag=(replace(made.STILL_TAG, speed_m_s=2.0, heading_deg=90.0),)
    )
    time_ns = scenario.start_time_ns + 50 * SECOND_NS
    place = scenario.plane.to_local(*scenario.tag_position(1, time_ns))
    assert place == pytest.approx((100.0, 100.0), abs=1e-3)
    assert truth(scenario, 51.0)[-1].bearing_deg == pytest.approx(45.0, abs=0.5)


def test_a_neighbour_tag_is_heard_but_not_listed() -> None:
    neighbour = replace(made.STILL_TAG, tag_id=9, listed=False, first_pulse_s=0.7)
    scenario = made.still_scenario(tag=(made.STILL_TAG, neighbour))
    assert [tag.tag_id for tag in scenario.tags] == [1]
    assert {(p.tag_id, p.listed) for p in truth(scenario)} == {(1, True), (9, False)}


def test_the_demo_is_clearly_heard_once_in_the_air() -> None:
    scenario = demo_scenario(60.0, seed=3)
    up_ns = scenario.start_time_ns + 7 * SECOND_NS
    flying = [pulse for pulse in truth(scenario) if pulse.start_time_ns > up_ns]
    levels = np.array([pulse.enr_db for pulse in flying])
    assert 30.0 < np.percentile(levels, 97) < 37.0
    assert np.mean(levels >= 14.0) > 0.85
    assert {pulse.rate for pulse in flying if pulse.tag_id == 4} == {1, 2}


def test_the_demo_fits_into_the_usable_span_of_the_decimator() -> None:
    tags = demo_scenario().tags
    frequencies = [tag.frequency_hz for tag in tags]
    assert len(tags) == 3
    assert max(frequencies) - min(frequencies) < 126e3
    assert all(tag.k == 3 for tag in tags)
    assert sorted(len(tag.pulse_intervals_s) for tag in tags) == [1, 1, 2]


@pytest.mark.parametrize("error_ppm", [40.0, -25.0])
def test_a_crystals_error_stretches_gaps_and_burst_intervals_alike(error_ppm: float) -> None:
    tag = made.simulated_tag(
        12,
        166_370_000.0,
        2.3,
        pulse_width_s=0.0025,
        gaps_s=(0.022, 0.0488, 0.0366),
        crystal_error_ppm=error_ppm,
        north_m=100.0,
    )
    sent_ns = [one.transmit_time_ns for one in truth(Scenario(tag=(tag,)), 60.0)]
    longer = 1.0 + 1e-6 * error_ppm
    steps_s = np.diff(sent_ns[:4]) / SECOND_NS
    assert steps_s == pytest.approx(longer * np.array(tag.gaps_s), abs=3e-9)
    bursts_s = np.diff(sent_ns[::4]) / SECOND_NS
    assert bursts_s == pytest.approx(np.full(len(bursts_s), 2.3 * longer), abs=3e-9)
    assert abs(bursts_s[0] - 2.3) > 5e-5
