"""A tag with two rates, the one twice the other: each pulse under its own rate."""

from dataclasses import replace

import made
import numpy as np
import pytest
from depth import seeds
from streams import start_s

from uavrt.core.messages import Pulse
from uavrt.detection.track.two_rates import log_evidence
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, make_samples
from uavrt_experiments.detection.trials import detect

RATES_S = (1.254, 2.508)
TAG = replace(THESIS_TAG, pulse_intervals_s=RATES_S)


def sent(rng: np.random.Generator, rates: list[int]) -> tuple[list[TruePulse], list[int]]:
    """A train that sends 25 s at each of some rates, and the rate of each pulse."""
    scale = 1.0 + rng.uniform(-0.03, 0.03)
    pulses: list[TruePulse] = []
    labels: list[int] = []
    for part, rate in enumerate(rates):
        interval_s = RATES_S[rate - 1] * scale
        first_s = pulses[-1].start_s + interval_s if pulses else rng.uniform(0.1, 1.2)
        train = made.train(
            rng,
            25.0 * (part + 1),
            14.0,
            interval_s=interval_s,
            offset_hz=100.0,
            jitter_s=0.005,
            first_s=first_s,
        )
        pulses += train
        labels += [rate] * len(train)
    return pulses, labels


def labelled(pulses: list[Pulse], truth: list[TruePulse]) -> dict[int, int]:
    """Index of each true pulse that was confirmed, and the rate that it was confirmed at."""
    starts_s = np.array([pulse.start_s for pulse in truth])
    rates = {}
    for pulse in pulses:
        away_s = np.abs(starts_s - start_s(pulse))
        if pulse.confirmed and away_s.min() < 0.015:
            rates[int(away_s.argmin())] = pulse.rate
    return rates


@pytest.mark.parametrize("rates", [[1], [2], [1, 2], [2, 1], [1, 2, 1]])
def test_no_pulse_is_confirmed_at_the_rate_it_was_not_sent_at(rates: list[int]) -> None:
    for seed in range(3):
        rng = np.random.default_rng((700 + seed, *rates))
        truth, labels = sent(rng, rates)
        samples = make_samples(rng, truth, duration_s=25.0 * len(rates))
        pulses, _ = detect(samples, TAG, frequency_window_hz=500.0)
        found = labelled(pulses, truth)
        assert all(labels[index] == rate for index, rate in found.items())
        # The first group is only detected; the last pulses wait for a label in vain.
        assert len(found) >= len(truth) - 5


@pytest.mark.parametrize("rates", [[1, 2], [2, 1]])
def test_noise_where_one_rate_has_a_place_is_not_confirmed_at_a_switch(
    rates: list[int],
) -> None:
    for seed in seeds(3, 6):
        rng = np.random.default_rng((720 + seed, *rates))
        truth, labels = sent(rng, rates)
        switch = labels.index(rates[1]) - 1
        # Between the two pulses of the longer interval next to the switch.
        pair = truth[switch : switch + 2] if rates[1] == 2 else truth[switch - 1 : switch + 1]
        between_s = 0.5 * (pair[0].start_s + pair[1].start_s) + 0.004
        peak = replace(truth[0], start_s=between_s, enr_db=7.0)
        samples = make_samples(rng, [*truth, peak], duration_s=50.0)
        pulses, _ = detect(samples, TAG, frequency_window_hz=500.0)
        assert not any(p.confirmed for p in pulses if abs(start_s(p) - between_s) < 0.02)
        found = labelled(pulses, truth)
        # The pulse of the switch itself is of both rates.
        assert all(labels[i] == rate for i, rate in found.items() if i != switch)
        assert len(found) >= len(truth) - 6


def test_a_pulse_that_waits_for_its_label_is_reported_when_the_stream_ends() -> None:
    rng = np.random.default_rng(710)
    truth, _ = sent(rng, [1])
    # Rate 2 begins: its first pulse is where rate 1, too, expects its second next.
    after = truth[-1].start_s + 2.0 * (truth[-1].start_s - truth[-2].start_s)
    truth.append(replace(truth[-1], start_s=after))
    samples = make_samples(rng, truth, duration_s=after + 0.1)
    pulses, _ = detect(samples, TAG, frequency_window_hz=500.0)
    last = [p for p in pulses if abs(start_s(p) - after) < 0.015]
    assert len(last) == 1
    assert not last[0].confirmed or last[0].rate == 2


def test_a_pulse_is_evidence_for_itself_and_silence_against_it() -> None:
    assert log_evidence(25.0, 25.0) > 10.0
    assert log_evidence(2.0, 25.0) < -8.0
    powers = [log_evidence(power, 12.0) for power in np.linspace(0.0, 60.0, 200)]
    assert np.all(np.diff(powers) > -0.05)
