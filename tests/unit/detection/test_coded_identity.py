"""Whose bursts they are: codes that are not listed, tags of one code, older tags."""

from dataclasses import replace

import numpy as np
import pytest
from foreign_bursts import Transmitter, send, white_noise
from numpy.typing import NDArray
from streams import start_s

from uavrt.core.messages import Tag
from uavrt.detection.coded.code_evidence import evidence, required_evidence
from uavrt_experiments.detection.coded import find
from uavrt_experiments.detection.coded_statistics import codes_and_strangers, confusions

RATE_HZ = 7500.0
TAG = Tag(
    tag_id=12,
    frequency_hz=166_380_000.0,
    pulse_width_s=0.0025,
    pulse_intervals_s=(5.3,),
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488, 0.0366),
)


def _energies(
    rng: np.random.Generator, count: int, enrs_db: tuple[float, ...]
) -> NDArray[np.float64]:
    pairs = rng.normal(0.0, 0.5**0.5, (count, len(enrs_db), 2))
    levels = 10.0 ** (np.array(enrs_db) / 20.0)
    energies: NDArray[np.float64] = (levels + pairs[..., 0]) ** 2 + pairs[..., 1] ** 2
    return energies


def _over_unlisted(
    energies: NDArray[np.float64], foreign_per_hour: float
) -> NDArray[np.float64]:
    usable = np.ones(energies.shape, np.bool_)
    return evidence(energies, usable, foreign_per_hour=foreign_per_hour).over_unlisted


@pytest.mark.parametrize("enr_db", [12.0, 14.0, 20.0, 30.0])
def test_two_pulses_and_noise_are_no_evidence_of_a_listed_code(enr_db: float) -> None:
    rng = np.random.default_rng(1)
    two = _energies(rng, 20_000, (enr_db, enr_db, -90.0, -90.0))
    for foreign_per_hour, most in ((0.02, 2e-3), (7000.0, 0.0)):
        required = required_evidence(foreign_per_hour, 1e-4)
        assert (_over_unlisted(two, foreign_per_hour) >= required).mean() <= most


def test_a_quiet_channel_needs_one_burst_and_a_busy_one_more() -> None:
    four = _energies(np.random.default_rng(2), 4000, (11.0,) * 4)
    assert (_over_unlisted(four, 0.02) >= required_evidence(0.02, 1e-4)).mean() > 0.9
    assert (_over_unlisted(four, 7000.0) >= required_evidence(7000.0, 1e-4)).mean() < 0.01


@pytest.mark.parametrize("enr_db", [11.0, 14.0])
def test_a_tag_that_is_not_listed_is_not_confirmed_as_listed_ones(enr_db: float) -> None:
    """At 14 dB 27 to 32 bursts in 200 s were: two of its pulses and two places of noise."""
    listed, (stranger, *_) = codes_and_strangers(np.random.default_rng(3))
    rng = np.random.default_rng(4)
    samples = white_noise(rng, 60.0, RATE_HZ)
    sent = Transmitter(gaps_s=stranger.tag.gaps_s, interval_s=5.0, offset_hz=80.0)
    send(samples, sent, rng, first_s=1.0, bursts=11, enr_db=enr_db, rate_hz=RATE_HZ)
    assert not [one for one in find(listed, samples) if one.confirmed]


def test_a_listed_tag_beside_ten_unlisted_ones_is_confirmed_and_none_else() -> None:
    listed, strangers = codes_and_strangers(np.random.default_rng(5))
    rng = np.random.default_rng(6)
    samples = white_noise(rng, 60.0, RATE_HZ)
    own = listed[7]
    for tag, offset_hz, first_s, enr_db in (
        *((one.tag, one.offset_hz, one.first_s, one.enr_db) for one in strangers),
        (own, 0.0, 1.7, 16.0),
    ):
        interval_s = tag.pulse_intervals_s[0]
        sent = Transmitter(gaps_s=tag.gaps_s, interval_s=interval_s, offset_hz=offset_hz)
        count = int(55.0 / interval_s)
        send(samples, sent, rng, first_s=first_s, bursts=count, enr_db=enr_db, rate_hz=RATE_HZ)
    confirmed = [one.tag_id for one in find(listed, samples) if one.confirmed]
    assert set(confirmed) == {own.tag_id}
    assert len(confirmed) >= count // 2


@pytest.mark.parametrize("on_air", [(7.9,), (5.3,), (5.3, 7.9)])
def test_of_tags_with_one_code_the_burst_interval_names_the_right_one(
    on_air: tuple[float, ...],
) -> None:
    """The first of the list was named, for all of 23 bursts of the other."""
    tags = [TAG, replace(TAG, tag_id=13, pulse_intervals_s=(7.9,))]
    rng = np.random.default_rng(7)
    samples = white_noise(rng, 75.0, RATE_HZ)
    sent: dict[int, list[float]] = {12: [], 13: []}
    for interval_s in on_air:
        one = Transmitter(gaps_s=TAG.gaps_s, interval_s=interval_s, offset_hz=100.0)
        tag_id, first_s = (12, 1.0) if interval_s == 5.3 else (13, 2.7)
        count = int(70.0 / interval_s)
        sent[tag_id] = send(
            samples, one, rng, first_s=first_s, bursts=count, enr_db=18.0, rate_hz=RATE_HZ
        )
    found = find(tags, samples)
    for tag in tags:
        heard_s = [start_s(one) for one in found if one.tag_id == tag.tag_id and one.confirmed]
        assert len(heard_s) >= len(sent[tag.tag_id]) - 1
        for at_s in heard_s:
            assert min(abs(at_s - true_s) for true_s in sent[tag.tag_id]) < 2e-3
    assert sum(not one.confirmed for one in found) <= 1


def test_an_ambiguous_burst_names_all_tags_that_may_have_sent_it() -> None:
    tags = [TAG, replace(TAG, tag_id=13, pulse_intervals_s=(7.9,))]
    rng = np.random.default_rng(8)
    samples = white_noise(rng, 25.0, RATE_HZ)
    one = Transmitter(gaps_s=TAG.gaps_s, interval_s=5.3)
    send(samples, one, rng, first_s=2.0, bursts=1, enr_db=20.0, rate_hz=RATE_HZ)
    (alone,) = find(tags, samples)
    assert not alone.confirmed
    assert {alone.tag_id, *alone.also_possible_tag_ids} == {12, 13}


@pytest.mark.parametrize("enr_db", [16.0, 24.0])
def test_older_tags_with_longer_pulses_arefind(enr_db: float) -> None:
    rng = np.random.default_rng(9)
    samples = white_noise(rng, 60.0, RATE_HZ)
    one = Transmitter(
        gaps_s=TAG.gaps_s, interval_s=5.3, keys_s=(0.0075, 0.005, 0.005, 0.005), offset_hz=-60.0
    )
    # Their energy is that of two and three usual pulses.
    sent = send(samples, one, rng, first_s=1.0, bursts=11, enr_db=enr_db, rate_hz=RATE_HZ)
    found = find([TAG], samples)
    assert len(found) >= len(sent) - 1
    assert all(one.confirmed for one in found)


@pytest.mark.slow
def test_in_hours_beside_unlisted_tags_no_listed_one_is_confirmed() -> None:
    some = [confusions(np.random.default_rng([5, hour])) for hour in (0, 11)]
    assert sum(one.claims for one in some) > 200  # the world holds what could be mistaken
    assert sum(one.wrong + one.wrong_by_sums for one in some) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("bursts", "enr_db"), [(1, 10.7), (10, 3.7)])
def test_half_of_foreign_bursts_a_decibel_above_the_limit_are_confirmed(
    bursts: int, enr_db: float
) -> None:
    heard = 0
    for seed in range(4 if bursts > 1 else 8):
        rng = np.random.default_rng([11, bursts, seed])
        samples = white_noise(rng, 4.0 + 5.3 * (bursts - 1), RATE_HZ)
        one = Transmitter(
            gaps_s=TAG.gaps_s,
            interval_s=5.3,
            offset_hz=rng.uniform(-450.0, 450.0),
            timer_error=rng.uniform(-3e-4, 3e-4),
        )
        first_s = rng.uniform(1.0, 2.0)
        send(samples, one, rng, first_s=first_s, bursts=bursts, enr_db=enr_db, rate_hz=RATE_HZ)
        heard += any(pulse.confirmed for pulse in find([TAG], samples))
    assert heard >= (2 if bursts > 1 else 4)
