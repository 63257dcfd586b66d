"""One weak pulse among many, or one that something covers, speaks for itself, not its group."""

from collections.abc import Callable
from dataclasses import replace

import made
import numpy as np
import pytest
from depth import share
from numpy.typing import NDArray
from streams import add_pulses

from uavrt.core.messages import Tag
from uavrt_experiments.detection.integration import long_decision, long_tag
from uavrt_experiments.detection.signals import (
    THESIS_TAG,
    TruePulse,
    make_samples,
    noise,
)
from uavrt_experiments.detection.trials import RATE_HZ, Decision, compare, detect, group_found

pytestmark = pytest.mark.slow


def in_a_part(tag: Tag) -> Decision:
    """Search a part of the channel."""
    return Decision(tag=tag, frequency_window_hz=500.0, band_hz=400.0)


Extra = Callable[[np.random.Generator, NDArray[np.complex64], list[TruePulse]], None]


def found(decision: Decision, enr_db: float, count: int, extra: Extra | None = None) -> int:
    """In how many of `count` stretches the group is found."""
    hits = 0
    for number in range(count):
        rng = np.random.default_rng((6, number))
        samples, truth = decision.stretch(rng, enr_db)
        if extra is not None:
            extra(rng, samples, truth)
        window_hz = decision.frequency_window_hz
        pulses, _ = detect(samples, decision.tag, frequency_window_hz=window_hz)
        hits += group_found(pulses, truth, decision.tag)
    return hits


@pytest.mark.parametrize(
    ("decision", "enr_db"),
    [
        # In every group of many there is a pulse beside which the noise is twice as strong.
        (long_decision(20, 0.002), 4.0),
        (long_decision(40, 0.002), 3.0),
        (in_a_part(replace(THESIS_TAG, k=8)), 8.0),
    ],
    ids=["K = 20", "K = 40", "K = 8, part of the channel"],
)
def test_a_group_of_many_weak_pulses_is_found(decision: Decision, enr_db: float) -> None:
    assert found(decision, enr_db, 6) >= 5


def _impulse(
    rng: np.random.Generator, samples: NDArray[np.complex64], truth: list[TruePulse]
) -> None:
    at = round((truth[len(truth) // 2].start_s + 0.01) * RATE_HZ)
    samples[at : at + 6] += (40.0 * np.exp(2j * np.pi * rng.random(6))).astype(np.complex64)


def _other_pulse(
    rng: np.random.Generator, samples: NDArray[np.complex64], truth: list[TruePulse]
) -> None:
    of = truth[len(truth) // 2]
    add_pulses(samples, [replace(of, offset_hz=of.offset_hz + 220.0, enr_db=25.0)], rng=rng)


@pytest.mark.parametrize("extra", [_impulse, _other_pulse])
def test_what_covers_one_pulse_of_twenty_does_not_hide_the_group(extra: Extra) -> None:
    assert found(long_decision(20, 0.002), 6.0, 6, extra) >= 5


def _noisy_above(
    rng: np.random.Generator, samples: NDArray[np.complex64], truth: list[TruePulse]
) -> None:
    spectrum = np.fft.fft(noise(rng, len(samples)))
    at_hz = np.fft.fftfreq(len(samples), 1.0 / RATE_HZ)
    spectrum[(at_hz < 900.0) | (at_hz > 1700.0)] = 0.0
    samples += (3.0 * np.fft.ifft(spectrum)).astype(np.complex64)


@pytest.mark.parametrize(
    ("decision", "enr_db"),
    [(in_a_part(THESIS_TAG), 13.0), (long_decision(20, 0.002), 5.0)],
    ids=["K = 3", "K = 20"],
)
def test_noise_outside_the_frequencies_searched_hides_no_group(
    decision: Decision, enr_db: float
) -> None:
    assert found(decision, enr_db, 6, _noisy_above) >= 5


@pytest.mark.parametrize(("k", "enr_db"), [(5, 9.0), (8, 8.0)])
def test_a_weak_pulse_of_a_tag_with_two_rates_is_not_a_missing_one(
    k: int, enr_db: float
) -> None:
    tag = replace(THESIS_TAG, k=k, pulse_intervals_s=(1.254, 1.9), interval_uncertainty_s=0.03)
    assert found(in_a_part(tag), enr_db, 7) >= 6


def beside_another(
    k: int, *, apart_s: float, enr_db: float, seed: int, own_db: float | None = None
) -> tuple[int, int]:
    """Pulses of a tag, and of them those confirmed, beside one with nearly its interval."""
    rng = np.random.default_rng(seed)
    own_s = THESIS_TAG.pulse_intervals_s[0]
    truth = [
        made.train(
            rng,
            100.0,
            level_db,
            interval_s=every_s,
            offset_hz=20.0,
            jitter_s=0.002,
            first_s=first_s,
        )
        for every_s, level_db, first_s in ((own_s + apart_s, enr_db, 0.5), (own_s, own_db, 1.1))
        if level_db is not None
    ]
    samples = make_samples(rng, [pulse for train in truth for pulse in train], duration_s=100.0)
    tag = long_tag(k, 0.002)
    pulses, _ = detect(samples, tag, frequency_window_hz=100.0)
    own = compare(pulses, truth[1] if own_db is not None else [], tag)
    return own.true, own.confirmed if own_db is not None else own.false_confirmed


@pytest.mark.parametrize(
    ("k", "apart_s", "enr_db"),
    share(
        [
            (k, *other)
            for other in ((0.005, 25.0), (0.01, 25.0), (0.002, 10.0), (0.003, 10.0))
            for k in (20, 40)
        ],
        3,
    ),
)
def test_a_silent_tag_of_many_pulses_is_not_confirmed_by_another(
    k: int, apart_s: float, enr_db: float
) -> None:
    _, confirmed = beside_another(k, apart_s=apart_s, enr_db=enr_db, seed=4)
    assert confirmed == 0


def test_a_tag_of_many_pulses_is_confirmed_beside_one_with_nearly_its_interval() -> None:
    true, confirmed = beside_another(20, apart_s=0.005, enr_db=12.0, own_db=10.0, seed=4)
    assert confirmed > 0.9 * true


def test_a_group_heard_from_its_middle_on_waits_until_its_interval_is_known() -> None:
    # Of twenty pulses the stream has the last eight: these alone pass for the tag's.
    _, confirmed = beside_another(20, apart_s=0.002, enr_db=14.0, seed=5)
    assert confirmed == 0
