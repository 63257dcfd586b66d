"""The rate at which samples arrive, and the frequency to which a radio really tunes."""

import random

import pytest

from uavrt.config.parameters import tuned_frequency
from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings
from uavrt.core.errors import ConfigError
from uavrt.radio.timing.arrival_rate import ArrivalRate
from uavrt.radio.timing.sample_placing import Placer

RATE_HZ = 250e3
TRANSFER = 4096


def watched(share: float, *, seconds: float, seed: int, stall_s: float = 0.0) -> list[float]:
    """Times at which the rate by arrival was reported as wrong, with jitter and stalls."""
    random_ = random.Random(seed)
    watch, reported, held_until_s = ArrivalRate(RATE_HZ), [], 0.0
    for number in range(1, round(seconds * RATE_HZ * share / TRANSFER)):
        sampled_s = number * TRANSFER / (RATE_HZ * share)
        if stall_s and random_.random() < 0.01:
            held_until_s = sampled_s + random_.uniform(0.2, 1.0) * stall_s
        held_until_s = max(sampled_s + random_.expovariate(1 / 0.004), held_until_s)
        arrived_s = held_until_s
        watch.arrived(number * TRANSFER, round(arrived_s * 1e9))
        if watch.wrong_hz is not None:
            reported.append(arrived_s)
    return reported


@pytest.mark.parametrize("share", [0.5, 0.9, 0.97, 1.03, 2.0, 4.1])
def test_a_rate_that_is_off_shows_within_five_seconds(share: float) -> None:
    for seed in range(20):
        reported = watched(share, seconds=8.0, seed=seed)
        assert reported
        assert reported[0] < 5.0
        assert reported[-1] > 7.5, "it stays reported"


@pytest.mark.parametrize("share", [1 - 200e-6, 1.0, 1 + 200e-6])
def test_the_rate_asked_for_is_never_reported_however_the_computer_stalls(share: float) -> None:
    for seed in range(10):
        assert not watched(share, seconds=60.0, seed=seed, stall_s=1.5)


def test_single_losses_are_not_taken_for_another_rate() -> None:
    watch = ArrivalRate(RATE_HZ)
    for number in range(1, 5000):
        lost_s = 0.3 * (number // 600)
        watch.arrived(number * TRANSFER, round((number * TRANSFER / RATE_HZ + lost_s) * 1e9))
        assert watch.wrong_hz is None


def fault(share: float, *, may_be_slow: bool) -> str | None:
    placer = Placer(RATE_HZ, may_be_slow=may_be_slow, rate_remedy="Do this")
    for number in range(1, round(4.0 * RATE_HZ * share / TRANSFER)):
        placer.arrived(number * TRANSFER, round(number * TRANSFER / (RATE_HZ * share) * 1e9))
    return placer.rate_fault


def test_the_sentence_names_both_rates_and_leaves_out_a_recording_in_a_pipe() -> None:
    words = "225000 samples a second arrive, not 250000. Do this"
    assert fault(0.9, may_be_slow=False) == fault(0.9, may_be_slow=True) == words
    assert fault(8.0, may_be_slow=False) is not None
    assert fault(8.0, may_be_slow=True) is None
    assert fault(1.0, may_be_slow=False) is None


@pytest.mark.parametrize("ppm", [0.0, 12.5, -40.0])
def test_a_frequency_that_the_program_rounds_is_the_one_that_the_flight_uses(
    ppm: float,
) -> None:
    """airspyhf_rx 1.6.8 reads its megahertz as float32: 148.705123 becomes 148705120 Hz."""
    settings = RadioSettings(kind="airspyhf", frequency_correction_ppm=ppm)
    assert RADIOS["airspyhf"].tuned_hz(148_705_123.0) == 148_705_120.0
    for step in range(300):
        asked_hz = 148e6 + 7_919.0 * step
        tuned_hz = tuned_frequency(settings, asked_hz)
        assert abs(tuned_hz - asked_hz) < 17.0
        assert tuned_frequency(settings, tuned_hz) == pytest.approx(tuned_hz, abs=0.01)
    assert tuned_frequency(RadioSettings(), 148_705_123.0) == 148_705_123.0
    with pytest.raises(ConfigError, match=r"40 MHz.*60 to 260 MHz"):
        tuned_frequency(settings, 40e6)


@pytest.mark.parametrize("speed", [1.026, 1.05, 1.15, 1.5])
@pytest.mark.parametrize("pauses_s", [(10.0,), (10.0, 14.0), (10.0, 13.0, 16.0, 30.0)])
def test_a_sender_that_catches_up_after_pauses_is_at_its_rate(
    speed: float, pauses_s: tuple[float, ...]
) -> None:
    """A pause of the computer of 2.3 s; the link then takes a little more than its rate."""
    random_ = random.Random(round(1000 * speed))
    watch, sent_s = ArrivalRate(RATE_HZ), 0.0
    for number in range(1, round(150.0 * RATE_HZ / TRANSFER)):
        sent_s = max(number * TRANSFER / RATE_HZ, sent_s + TRANSFER / RATE_HZ / speed)
        for begun_s in pauses_s:
            if begun_s <= sent_s < begun_s + 2.3:
                sent_s = begun_s + 2.3
        arrived_s = sent_s + random_.expovariate(1 / 0.002)
        watch.arrived(number * TRANSFER, round(arrived_s * 1e9))
        assert watch.wrong_hz is None, arrived_s


def test_a_wrong_rate_shows_also_after_a_pause() -> None:
    watch = ArrivalRate(RATE_HZ)
    reported_s = []
    for number in range(1, round(20.0 * RATE_HZ / TRANSFER)):
        arrived_s = number * TRANSFER / (1.1 * RATE_HZ)
        if arrived_s > 1.0:
            arrived_s = max(arrived_s, 3.0)
        watch.arrived(number * TRANSFER, round(arrived_s * 1e9))
        if watch.wrong_hz is not None:
            reported_s.append(arrived_s)
    assert min(reported_s) < 12.0
