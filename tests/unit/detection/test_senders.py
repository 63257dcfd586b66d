"""Listed tags of one band: each train of pulses is one tag's, and what is uncertain is said."""

import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import made
import numpy as np
import pytest
from depth import share
from streams import start_s

from uavrt.core.messages import Pulse, Tag
from uavrt.detection.group import DetectorGroup
from uavrt.detection.track.transmitters.train_senders import interval_separation, small_ratio
from uavrt_experiments.detection.one_band import OneBand
from uavrt_experiments.detection.signals import THESIS_TAG, TruePulse, make_samples
from uavrt_experiments.detection.trials import RATE_HZ, blocks_of

pytestmark = pytest.mark.slow

Sent = tuple[float, float]
"""Interval [s] and ENR [dB]."""


def tag_of(
    tag_id: int, *intervals_s: float, uncertainty_s: float = 0.06, apart_hz: float = 0.0
) -> Tag:
    return replace(
        THESIS_TAG,
        tag_id=tag_id,
        pulse_intervals_s=intervals_s,
        interval_uncertainty_s=uncertainty_s,
        frequency_hz=THESIS_TAG.frequency_hz + apart_hz,
    )


TWO = (tag_of(2, 1.254), tag_of(4, 1.294))


def heard(
    tags: Sequence[Tag],
    sent: Sequence[Sent],
    *,
    seed: int = 1,
    duration_s: float = 45.0,
    ends_s: Sequence[float] = (),
    apart_hz: Sequence[float] = (),
) -> tuple[list[list[TruePulse]], list[Pulse]]:
    """What was sent, each train, and all pulses that were told."""
    rng = np.random.default_rng(seed)
    trains = [
        made.train(
            rng,
            duration_s,
            enr_db,
            interval_s=interval_s,
            offset_hz=20.0 + 3.0 * at + (apart_hz[at] if apart_hz else 0.0),
            jitter_s=0.002,
        )
        for at, (interval_s, enr_db) in enumerate(sent)
    ]
    for at, end_s in enumerate(ends_s):
        trains[at] = [p for p in trains[at] if p.start_s < end_s]
    samples = make_samples(rng, [p for t in trains for p in t], duration_s=duration_s)
    center_hz = THESIS_TAG.frequency_hz
    group = DetectorGroup()
    group.add(0, [made.detector(tag, RATE_HZ, center_frequency_hz=center_hz) for tag in tags])
    pulses: list[Pulse] = []
    for block, time_ns in blocks_of(samples):
        group.put(0, block, time_ns)
        pulses += group.collect()
    return trains, pulses + group.flush()


def kept(train: list[TruePulse], others: list[list[TruePulse]], pulses: list[Pulse]) -> float:
    """Share of a train's pulses, those hit by another's left out, that were confirmed."""
    free = [
        p
        for p in train
        if all(abs(p.start_s - q.start_s) > 0.04 for other in others for q in other)
    ]
    told = [start_s(pulse) for pulse in pulses if pulse.confirmed]
    return sum(any(abs(p.start_s - t) < 0.015 for t in told) for p in free) / len(free)


def of(tag: Tag, pulses: list[Pulse]) -> list[Pulse]:
    return [pulse for pulse in pulses if pulse.tag_id == tag.tag_id]


@pytest.mark.parametrize("at", [0, 1])
def test_a_tag_alone_is_not_told_twice_and_may_be_the_other(at: int) -> None:
    [train], pulses = heard(TWO, [(TWO[at].pulse_intervals_s[0], 16.0)])
    assert kept(train, [], of(TWO[at], pulses)) > 0.9
    assert not [p for p in of(TWO[1 - at], pulses) if p.confirmed]
    assert {p.also_possible_tag_ids for p in pulses if p.confirmed} == {(TWO[1 - at].tag_id,)}


LEVELS_DB = ((16.0, 16.0), (24.0, 14.0), (14.0, 24.0))


@pytest.mark.parametrize(
    ("levels_db", "order"), share([(one, order) for one in LEVELS_DB for order in (1, -1)], 3)
)
def test_two_tags_at_once_are_told_apart_also_when_one_is_10_db_stronger(
    levels_db: tuple[float, float], order: int
) -> None:
    sent = [(1.254, levels_db[0]), (1.294, levels_db[1])]
    trains, pulses = heard(TWO[::order], sent)
    for tag, own, other in zip(TWO, trains, trains[::-1], strict=True):
        assert kept(own, [other], of(tag, pulses)) >= 0.9
        assert kept(other, [own], of(tag, pulses)) < 0.05
        doubts = Counter(p.also_possible_tag_ids for p in of(tag, pulses) if p.confirmed)
        assert doubts[()] > 0.9 * doubts.total()


def test_three_tags_at_once_one_of_them_with_two_rates() -> None:
    tags = (tag_of(2, 1.254, 1.881), tag_of(4, 1.294), tag_of(6, 1.334))
    trains, pulses = heard(tags, [(1.881, 16.0), (1.294, 14.0), (1.334, 18.0)])
    for tag, own in zip(tags, trains, strict=True):
        others = [train for train in trains if train is not own]
        assert kept(own, others, of(tag, pulses)) >= 0.9


def test_the_order_of_the_tags_changes_nothing() -> None:
    sent = [(1.254, 15.0), (1.294, 18.0)]

    def told(tags: Sequence[Tag]) -> list[Pulse]:
        pulses = heard(tags, sent, duration_s=30.0)[1]
        return sorted(pulses, key=lambda p: (p.tag_id, p.start_time_ns))

    assert told(TWO) == told(TWO[::-1])


def test_what_was_learnt_while_both_were_heard_tells_one_that_is_left() -> None:
    # Alone at 1.27 s it could be either by what was declared.
    sent = [(1.262, 16.0), (1.294, 16.0)]
    _, pulses = heard(TWO, sent, duration_s=100.0, ends_s=(100.0, 40.0))
    late = [p for p in pulses if p.confirmed and start_s(p) > 70.0]
    assert len(late) > 20
    assert {p.tag_id for p in late} == {2}
    assert {p.also_possible_tag_ids for p in late} == {()}


def test_of_many_tags_in_a_chain_of_overlapping_bands_all_are_told() -> None:
    apart_hz = [350.0 * (n - 4.0) for n in range(9)]
    tags = [tag_of(2 * n + 2, 1.254, apart_hz=apart) for n, apart in enumerate(apart_hz)]
    sent = [(1.214 + 0.01 * n, 18.0) for n in range(len(tags))]
    trains, pulses = heard(tags, sent, duration_s=25.0, apart_hz=apart_hz)
    for tag, own in zip(tags, trains, strict=True):
        others = [train for train in trains if train is not own]
        assert kept(own, others, of(tag, pulses)) >= 0.8


MULTIPLES = share(
    [
        (*one, slow_first)
        for one in ((1.5, 0.75), (1.5, 0.5), (2.508, 1.254), (1.254, 0.836))
        for slow_first in (False, True)
    ],
    3,
)
"""Intervals as 2 to 1, 3 to 1 and 3 to 2, and whether the slow one has the lower number."""


@pytest.mark.parametrize(("slow_s", "fast_s", "slow_first"), MULTIPLES)
@pytest.mark.parametrize("on_air", ["fast", "slow", "both"])
def test_of_two_tags_at_a_ratio_of_intervals_those_that_send_are_told(
    on_air: str, slow_s: float, fast_s: float, slow_first: bool
) -> None:
    slow, fast = tag_of(2 if slow_first else 6, slow_s), tag_of(4, fast_s)
    sending = {"fast": [fast], "slow": [slow], "both": [slow, fast]}[on_air]
    trains, pulses = heard((slow, fast), [(tag.pulse_intervals_s[0], 20.0) for tag in sending])
    for tag, own in zip(sending, trains, strict=True):
        others = [train for train in trains if train is not own]
        assert kept(own, others, of(tag, pulses)) >= 0.9
        assert all(kept(other, [own], of(tag, pulses)) < 0.1 for other in others)
    sure = [pulse for pulse in pulses if pulse.confirmed]
    assert {pulse.tag_id for pulse in sure} == {tag.tag_id for tag in sending}
    assert on_air != "fast" or {pulse.also_possible_tag_ids for pulse in sure} == {()}


def test_two_tags_of_one_interval_go_by_frequency() -> None:
    tags = (tag_of(2, 1.254, apart_hz=20.0), tag_of(4, 1.254, apart_hz=440.0))
    [train], pulses = heard(tags, [(1.254, 16.0)])
    assert kept(train, [], of(tags[0], pulses)) > 0.9
    assert not [p for p in of(tags[1], pulses) if p.confirmed]


def test_two_of_the_very_same_interval_are_each_told_once() -> None:
    tags = (tag_of(2, 1.254), tag_of(4, 1.254))
    trains, pulses = heard(tags, [(1.254, 14.0), (1.266, 24.0)], duration_s=60.0)
    for own, other in zip(trains, trains[::-1], strict=True):
        assert kept(own, [other], pulses) >= 0.9
    told = sorted(start_s(p) for p in pulses if p.confirmed)
    assert min(b - a for a, b in pairwise(told)) > 0.005
    assert all(p.also_possible_tag_ids for p in pulses if p.confirmed)


def test_the_figures_at_which_two_tags_part() -> None:
    near = interval_separation(*TWO)
    assert not near.certain
    assert near.gap_s == pytest.approx(0.040)
    assert near.uncertainty_s == pytest.approx(0.0196, abs=2e-4)
    assert near.pulses == 3
    narrow = interval_separation(
        tag_of(2, 1.254, uncertainty_s=0.019), tag_of(4, 1.294, uncertainty_s=0.019)
    )
    assert narrow.certain
    assert interval_separation(tag_of(2, 1.254), tag_of(4, 1.255)).pulses is None
    fine = interval_separation(tag_of(2, 1.254), tag_of(4, 1.264))
    assert fine.pulses is not None
    assert fine.pulses > 3
    assert fine.seconds == pytest.approx(fine.pulses * 1.264)


@pytest.mark.parametrize(
    ("slow_s", "fast_s", "uncertainty_s", "ratio"),
    [
        (1.5, 0.75, 0.005, (2, 1)),
        (1.5, 0.5, 0.005, (3, 1)),
        (1.254, 0.836, 0.005, (3, 2)),
        (1.5, 0.77, 0.005, None),
        (1.5, 0.77, 0.02, (2, 1)),
        (1.254, 1.294, 0.06, None),
    ],
)
def test_intervals_at_a_small_ratio_are_known_from_their_bounds(
    slow_s: float, fast_s: float, uncertainty_s: float, ratio: tuple[int, int] | None
) -> None:
    slow = tag_of(2, slow_s, uncertainty_s=uncertainty_s)
    fast = tag_of(4, fast_s, uncertainty_s=uncertainty_s)
    assert small_ratio(slow, fast) == small_ratio(fast, slow) == ratio


@pytest.mark.parametrize(
    ("seed", "index", "wrong"),
    [
        # What was learnt of each holds when a track goes over to the other's pulses.
        ((21, 6), 6, 6),
        # Where a track of two tags' pulses, 1386 ms apart, once had one tag take another's.
        ((1, zlib.crc32(b"E21 three tags, one of two rates"), 3), 3, 2),
    ],
)
def test_tags_do_not_change_places_where_their_trains_cross(
    seed: tuple[int, ...], index: int, wrong: int
) -> None:
    scene = OneBand(
        intervals_s=((1.254, 1.881), (1.294,), (1.334,)), levels_db=(16.0, 14.0, 18.0)
    )
    flight = scene.fly(np.random.default_rng(seed), index)
    assert flight.confirmed >= 0.9 * flight.true
    assert flight.wrong <= wrong


@pytest.mark.parametrize(
    ("interval_s", "apart_hz", "enr_db"),
    share([(1.5, 200.0, 30.0), (1.0, 200.0, 20.0), (1.7, 0.0, 40.0), (2.0, 400.0, 20.0)], 2),
)
def test_pulses_of_one_tag_and_noise_beside_them_are_not_another_silent_one(
    interval_s: float, apart_hz: float, enr_db: float
) -> None:
    silent = tag_of(4, interval_s, apart_hz=apart_hz)
    [train], pulses = heard((TWO[0], silent), [(1.254, enr_db)], duration_s=120.0, seed=5)
    assert kept(train, [], of(TWO[0], pulses)) > 0.95
    assert not [p for p in of(silent, pulses) if p.confirmed]
    for other in of(silent, pulses):
        assert min(abs(start_s(other) - p.start_s) for p in train) >= 0.01


def test_a_weak_tag_beside_a_strong_one_of_another_interval_keeps_its_pulses() -> None:
    weak = tag_of(4, 1.5, apart_hz=200.0)
    sent = [(1.254, 30.0), (1.51, 14.0)]
    trains, pulses = heard((TWO[0], weak), sent, duration_s=60.0, apart_hz=(0.0, 200.0))
    assert kept(trains[0], trains[1:], of(TWO[0], pulses)) > 0.95
    assert kept(trains[1], trains[:1], of(weak, pulses)) > 0.9
