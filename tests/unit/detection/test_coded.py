"""Bursts of coded tags: who it is, how weak, and beside whom."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from some import some
from streams import start_s

from uavrt.core.messages import Pulse, Tag
from uavrt.core.runtime import native
from uavrt.detection.coded.coded_detector import CodedDetector
from uavrt_experiments.detection.coded import add_burst, find, some_codes
from uavrt_experiments.detection.signals import START_NS, noise

RATE_HZ = 7500.0
CODES = some_codes(np.random.default_rng(1), 50)


def _noise(seconds: float, seed: int = 3) -> NDArray[np.complex64]:
    return noise(np.random.default_rng(seed), round(seconds * RATE_HZ))


def _train(
    samples: NDArray[np.complex64],
    tag: Tag,
    *,
    enr_db: float,
    first_s: float,
    stretch: float = 0.0,
    offset_hz: float = 130.0,
    count: int = 100,
) -> list[float]:
    rng = np.random.default_rng(tag.tag_id)
    at_s = first_s
    starts: list[float] = []
    while at_s + tag.length_s < len(samples) / RATE_HZ and len(starts) < count:
        add_burst(
            *(samples, tag),
            start_s=at_s,
            offset_hz=offset_hz,
            enr_db=enr_db,
            stretch=stretch,
            rng=rng,
            sample_rate_hz=RATE_HZ,
        )
        starts.append(at_s)
        at_s += tag.pulse_intervals_s[0] * (1.0 + stretch)
    return starts


def test_each_burst_is_one_record_with_its_pulses_inside() -> None:
    tag = CODES[0]
    samples = _noise(30.0)
    starts = _train(samples, tag, enr_db=16.0, first_s=1.0, stretch=3e-4)
    found = find(CODES, samples, RATE_HZ)
    assert [one.tag_id for one in found] == [tag.tag_id] * len(starts)
    assert all(one.confirmed for one in found)
    assert np.abs(np.array([start_s(one) for one in found]) - starts).max() < 5e-4
    gaps_s = np.diff([one.burst_starts_ns for one in found], axis=1) / 1e9
    assert np.abs(gaps_s - tag.gaps_s).max() < 1e-3
    assert np.mean([one.snr_db for one in found]) == pytest.approx(16.0, abs=1.0)
    away_hz = np.mean([one.frequency_hz for one in found]) - tag.frequency_hz
    assert away_hz == pytest.approx(130.0, abs=20.0)
    assert some(found[1].predicted_next_start_ns) < found[2].start_time_ns
    assert len({one.group_sequence for one in found}) == len(found)


def test_a_weak_tag_is_known_beside_one_20_db_stronger_and_nobody_else_is() -> None:
    weak, strong = CODES[3], CODES[7]
    samples = _noise(60.0)
    _train(samples, strong, enr_db=32.0, first_s=1.5)
    starts = _train(samples, weak, enr_db=12.0, first_s=2.0, offset_hz=-200.0)
    found = [one for one in find(CODES, samples, RATE_HZ) if one.confirmed]
    assert {one.tag_id for one in found} == {weak.tag_id, strong.tag_id}
    heard = sum(one.tag_id == weak.tag_id for one in found)
    assert heard >= len(starts) - 2


def test_two_bursts_that_collide_are_told_apart_or_named() -> None:
    one, two = CODES[4], CODES[9]
    samples = _noise(24.0)
    # The second's first pulse lies on the last of the first's; the other three tell it. And
    # 10 s later two of the second's lie on the first's: nothing tells who it is.
    for first_s, later_s in ((3.0, sum(one.gaps_s)), (13.0, one.gaps_s[0])):
        _train(samples, one, enr_db=18.0, first_s=first_s, count=1)
        _train(samples, two, enr_db=18.0, first_s=first_s + later_s, offset_hz=90.0, count=1)
    detector = CodedDetector(
        CODES, sample_rate_hz=RATE_HZ, center_frequency_hz=CODES[0].frequency_hz
    )
    found = detector.process(samples, START_NS) + detector.flush()
    assert detector.counters.rejected == {"collision with other bursts": 1}
    apart, named = found[:2], found[2:]
    assert {pulse.tag_id for pulse in apart if pulse.confirmed} == {one.tag_id, two.tag_id}
    assert [pulse.tag_id for pulse in named if pulse.confirmed] == [one.tag_id]
    (doubtful,) = (pulse for pulse in named if not pulse.confirmed)
    assert doubtful.tag_id == two.tag_id
    assert one.tag_id in doubtful.also_possible_tag_ids
    assert doubtful.detection_status == "detected"


def test_what_no_burst_shows_ten_do() -> None:
    tag = CODES[11]
    seconds = 12.0 * tag.pulse_intervals_s[0]
    samples = _noise(seconds, seed=5)
    starts = _train(samples, tag, enr_db=4.5, first_s=2.0, count=10)
    found = find([tag], samples, RATE_HZ)
    assert len(found) >= 8
    near = [np.abs(np.array(starts) - start_s(one)).min() for one in found]
    assert max(near) < 2e-3


def test_of_a_code_of_which_one_pulse_is_missing_nothing_is_told() -> None:
    tag = CODES[0]
    samples = _noise(12.0)
    other = replace(tag, gaps_s=(tag.gaps_s[0], tag.gaps_s[1] + 0.02, 0.07))
    _train(samples, other, enr_db=25.0, first_s=3.0, offset_hz=0.0, count=1)
    assert not find(CODES, samples, RATE_HZ)


def test_noise_and_a_beeping_tag_have_no_identity() -> None:
    samples = _noise(60.0, seed=8)
    beep = np.zeros(150, np.complex64) + 6.0
    for first in range(3000, len(samples) - 200, 9405):
        samples[first : first + 150] += beep
    assert not find(CODES, samples, RATE_HZ)


@pytest.mark.skipif(native.kernels() is None, reason=native.description())
def test_numpy_finds_what_the_kernels_find() -> None:
    codes = CODES[:3]
    samples = _noise(25.0, seed=6)
    _train(samples, codes[0], enr_db=6.5, first_s=1.0)
    _train(samples, codes[1], enr_db=14.0, first_s=2.2)
    by_kernels = find(codes, samples, RATE_HZ)
    with native.numpy_only():
        by_numpy = find(codes, samples, RATE_HZ)
    assert {one.tag_id for one in by_kernels} == {code.tag_id for code in codes[:2]}
    assert by_kernels == by_numpy


def test_lost_samples_and_a_restart_cost_only_their_bursts() -> None:
    tag = CODES[2]
    samples = _noise(30.0)
    starts = _train(samples, tag, enr_db=18.0, first_s=1.0)
    detector = CodedDetector(
        [tag], sample_rate_hz=RATE_HZ, center_frequency_hz=tag.frequency_hz
    )
    found: list[Pulse] = []
    for first in range(0, len(samples), 655):
        at_s = first / RATE_HZ
        if not (12.0 < at_s < 12.3 or 20.0 < at_s < 25.5):
            found += detector.process(
                samples[first : first + 655], START_NS + round(at_s * 1e9)
            )
    found += detector.flush()
    heard = [at for at in starts if not (11.8 < at < 12.4 or 19.8 < at < 25.6)]
    assert len(found) >= len(heard)
    for at in heard:
        assert min(abs(start_s(one) - at) for one in found) < 1e-3


@pytest.mark.parametrize("enr_db", [20.0, 30.0])
@pytest.mark.parametrize(
    ("listed_s", "sent_s"),
    [
        ((0.0239, 0.0218, 0.0315), (0.0254, 0.0218, 0.0345)),
        ((0.0651, 0.0552, 0.0686), (0.0654, 0.0524, 0.0711)),
    ],
)
def test_a_code_that_is_not_listed_is_not_taken_for_one_4_ms_beside_it(
    listed_s: tuple[float, ...], sent_s: tuple[float, ...], enr_db: float
) -> None:
    """The flanks of its pulses were: nine in ten of its bursts at 20 dB were another tag's."""
    listed = replace(CODES[2], gaps_s=listed_s)
    sent = replace(CODES[2], gaps_s=sent_s, pulse_intervals_s=(1.1,))
    wrong = bursts = 0
    for offset_hz in (-450.0, -250.0, 0.0, 130.0, 400.0):
        samples = _noise(12.0)
        bursts += len(_train(samples, sent, enr_db=enr_db, first_s=0.5, offset_hz=offset_hz))
        wrong += sum(one.confirmed for one in find([listed], samples, RATE_HZ))
    assert bursts > 40
    assert wrong <= 1
