"""Everything that beeps is found and named, and nothing else is."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from some import some

from uavrt.config.ghost_places import Receiver
from uavrt.config.tags.tag_corrections import correction_of, shared_offset_ppm, words_of_beeps
from uavrt.core.messages import Beep, BeepKind, IQBlock, Tag, keep_beep
from uavrt.detection.beeps.beats import FoundBeat, find_beats
from uavrt.detection.beeps.beep_points import Points, PointSearch
from uavrt.detection.beeps.beep_search import BeepSearch
from uavrt.detection.beeps.beep_trains import Searched, Train, find_trains
from uavrt.detection.beeps.interval_fit import fit_beat
from uavrt.detection.beeps.naming import name_trains
from uavrt_experiments.detection.beeping import (
    Beeper,
    Scene,
    blocks_of,
    named,
    regular,
    trains_of,
)
from uavrt_experiments.detection.signals import THESIS_TAG

RATE_HZ = 24_000.0
CENTER_HZ = 148_700_000.0
RADIO = Receiver(0.0, RATE_HZ)
TAG = replace(THESIS_TAG, frequency_hz=CENTER_HZ)


def scene(*beepers: Beeper, duration_s: float = 30.0, **disturbed: Any) -> Scene:
    return Scene(duration_s=duration_s, sample_rate_hz=RATE_HZ, beepers=beepers, **disturbed)


def beeper(
    offset_hz: float, interval_s: float, *, enr_db: float = 20.0, first_s: float = 0.3
) -> Beeper:
    starts_s = regular(600.0, interval_s, first_s)
    return Beeper(offset_hz=offset_hz, enr_db=enr_db, width_s=0.02, starts_s=starts_s)


def points_of(samples: NDArray[np.complex64]) -> Points:
    search = PointSearch(sample_rate_hz=RATE_HZ, low_hz=-12_000.0, high_hz=12_000.0)
    for first in range(0, len(samples), 7000):
        search.process(samples[first : first + 7000])
    return search.finish()


def samples_of(one: Scene) -> NDArray[np.complex64]:
    return np.concatenate([block.samples for block in blocks_of(one)])


@pytest.mark.parametrize("width_s", [0.0025, 0.008, 0.02, 0.05])
def test_each_strong_pulse_is_one_point_at_its_time_and_frequency(width_s: float) -> None:
    starts_s = regular(20.0, 0.7, 0.3) + np.random.default_rng(2).uniform(0.0, 0.02, 29)[:28]
    one = Beeper(offset_hz=3210.0, enr_db=30.0, width_s=width_s, starts_s=starts_s)
    points = points_of(samples_of(scene(one, duration_s=20.0)))
    near = points.take(np.abs(points.frequencies_hz - 3210.0) < 150.0)
    near = near.take(near.levels_db > 14.0)
    assert len(near) == starts_s.size
    assert np.abs(near.times_s - starts_s - width_s / 2.0).max() < 0.005
    assert abs(np.median(near.frequencies_hz) - 3210.0) < 15.0
    assert len(points) - len(near) < 3 * 20.0 * 2


def test_carriers_impulses_and_loud_stretches_are_no_points() -> None:
    rng = np.random.default_rng(3)
    samples = samples_of(scene(duration_s=20.0, impulses_per_s=5.0, mains_db=15.0))
    at = np.arange(samples.size)
    samples += (3.0 * np.exp(2j * np.pi * 0.1 * at)).astype(np.complex64)
    begun = at > 7.3 * RATE_HZ  # a carrier that begins is no pulse
    samples += np.where(begun, np.exp(-2j * np.pi * 0.2 * at), 0.0).astype(np.complex64)
    for first_s in rng.uniform(0.0, 19.0, 20):
        first = round(first_s * RATE_HZ)
        samples[first : first + 400] *= np.float32(6.0)
    assert len(points_of(samples)) < 3 * 20.0 * 2


def test_a_tag_off_its_label_is_named_with_its_offset_and_a_remedy() -> None:
    (one,) = named(scene(beeper(1640.0, 1.26)), [TAG], 500.0)
    assert one.kind is BeepKind.OFF_LABEL
    assert one.away_hz == pytest.approx(1640.0, abs=10.0)
    (line,) = words_of_beeps([one])
    assert "tag 2, 1.6 kHz above its label? List it at this frequency" in line


def test_samples_lost_in_each_second_hide_no_tag() -> None:
    made = samples_of(scene(beeper(1500.0, 1.26)))
    search = PointSearch(sample_rate_hz=RATE_HZ, low_hz=-12_000.0, high_hz=12_000.0)
    kept_s = []
    for first in range(0, len(made), 2000):
        if first // 2000 % 12 >= 3:
            search.process(made[first : first + 2000])
            kept_s.append(first / RATE_HZ)
    points = search.finish()
    place = np.minimum((points.times_s * RATE_HZ / 2000.0).astype(int), len(kept_s) - 1)
    true_s = np.array(kept_s)[place] + points.times_s - place * 2000.0 / RATE_HZ
    (train,) = find_trains(points.moved(true_s), 30.0, RADIO)[0]
    assert train.interval_s == pytest.approx(1.26, abs=2e-3)


@pytest.mark.parametrize("enr_db", [48.0, 54.0])
def test_the_edges_of_a_strong_tags_pulses_are_no_other_tags(enr_db: float) -> None:
    (train,) = trains_of(scene(beeper(2000.0, 1.0, enr_db=enr_db)))
    assert train.frequency_hz == pytest.approx(2000.0, abs=5.0)


def test_tags_that_always_beep_together_are_two_and_an_image_is_none() -> None:
    pair = beeper(3000.0, 1.1), beeper(-5000.0, 2.2, enr_db=25.0)
    assert all(one.image_of_hz is None for one in trains_of(scene(*pair)))
    mirrored = beeper(-10_500.0, 1.1, enr_db=17.0), beeper(10_500.0, 1.1, enr_db=30.0)
    found = named(scene(*mirrored), [listed(2, 10_500.0)], 500.0)
    image = next(one for one in found if one.frequency_hz < CENTER_HZ)
    assert image.kind is BeepKind.IMAGE
    assert image.image_of_hz == pytest.approx(CENTER_HZ + 10_500.0, abs=10.0)


def train(offset_hz: float, interval_s: float = 1.254, *, first_s: float = 0.5) -> Train:
    """Make a train of one minute and 20 dB without errors."""
    times_s = np.arange(first_s, 60.0, interval_s)
    values = np.ones(times_s.size)
    points = Points(times_s, (CENTER_HZ + offset_hz) * values, 0.02 * values, 20.0 * values)
    beat = FoundBeat(fit_beat(times_s, interval_s), np.arange(times_s.size))
    return Train(points, (beat,), CENTER_HZ + offset_hz, 20.0)


def listed(tag_id: int, offset_hz: float, interval_s: float = 1.254) -> Tag:
    frequency_hz = CENTER_HZ + offset_hz
    return replace(
        TAG, tag_id=tag_id, frequency_hz=frequency_hz, pulse_intervals_s=(interval_s,)
    )


OTHER = listed(4, 4000.0)


def names(*trains: Train, tags: Sequence[Tag], center_hz: float | None = None) -> list[Beep]:
    return name_trains(trains, tags, 500.0, center_hz=center_hz)


def mirror_names(*trains: Train, tags: Sequence[Tag]) -> list[Beep]:
    return names(*trains, tags=tags, center_hz=CENTER_HZ)


def test_where_two_listed_tags_could_be_meant_both_are_named_the_nearer_first() -> None:
    (one,) = names(train(2500.0), tags=(TAG, OTHER))
    assert one.tag_ids == (4, 2)
    assert "tag 4, 1.5 kHz below its label or tag 2, 2.5 kHz above its label?" in str(one)
    # A tag that beeps at its own place is not meant.
    found = names(train(2500.0), train(4000.0), tags=(TAG, OTHER))
    assert found[0].tag_ids == (2,)


@pytest.mark.parametrize("interval_s", [0.31, 0.627, 0.75, 2.4])
def test_another_rate_at_a_listed_frequency_is_named_and_twice_the_rate_explained(
    interval_s: float,
) -> None:
    (one,) = names(train(300.0, interval_s), tags=(TAG,))
    assert one.kind is BeepKind.OTHER_RATE
    assert one.interval_s == pytest.approx(interval_s)
    assert ("(mortality)" in str(one)) is (interval_s == 0.627)


def test_of_two_tags_within_reach_that_with_twice_or_half_the_rate_is_meant_else_both() -> None:
    near = listed(6, 400.0, 0.9)
    for interval_s in (0.627, 2.508):
        (one,) = names(train(350.0, interval_s), tags=(TAG, near))
        assert (one.kind, one.tag_ids) == (BeepKind.OTHER_RATE, (2,))
    (one,) = names(train(350.0, 0.75), tags=(TAG, near))
    assert one.tag_ids == (6, 2)
    assert {some(correction_of(tag, one, 0)).what for tag in (TAG, near)} == {"interval"}


@pytest.mark.parametrize("beyond_s", [-0.003, 0.0005, 0.002, 0.004])
def test_a_tag_named_at_another_rate_is_corrected_as_it_is_named(beyond_s: float) -> None:
    tag = replace(TAG, interval_uncertainty_s=0.01)
    far = replace(OTHER, interval_uncertainty_s=0.01)
    interval_s = 1.01 * tag.pulse_intervals_s[0] + beyond_s
    for near in (tag, replace(tag, pulse_intervals_s=(0.9,))):
        (one,) = names(train(200.0, interval_s), tags=(near, far))
        for each in (near, far):
            if one.kind is BeepKind.OTHER_RATE and each.tag_id in one.tag_ids:
                what = some(correction_of(each, one, 0)).what
                assert what == ("interval" if each is near else "frequency")
    assert one.tag_ids == ((2, 4) if beyond_s < 0.0 else (2,))


def test_the_same_error_of_all_tags_is_the_receivers() -> None:
    shift = 50e-6 * CENTER_HZ
    two = train(shift), train(4000.0 + shift, 1.27, first_s=0.9)
    found = names(*two, tags=(TAG, OTHER))
    assert shared_offset_ppm(found) is None  # 4 kHz apart, either tag may be meant
    # Each may be one of two tags: that one pair agrees is chance.
    pairs = [listed(n, hz) for n, hz in enumerate((0.0, 9_000.0, 40_000.0, 49_000.0), 2)]
    found = names(train(4_000.0), train(44_000.0, 1.27), tags=pairs)
    assert [one.tag_ids for one in found] == [(2, 3), (4, 5)]
    assert shared_offset_ppm(found) is None
    two = train(shift), train(40_000.0 + shift, 1.27, first_s=0.9)
    found = names(*two, tags=(TAG, listed(4, 40_000.0)))
    assert shared_offset_ppm(found) == pytest.approx(50.0, abs=0.1)
    assert "+50.0 ppm off their labels: the receiver's own error" in words_of_beeps(found)[-1]


def test_i_and_q_are_not_swapped_if_a_tag_is_at_its_label_or_all_share_an_error() -> None:
    far = listed(4, 40_000.0)
    here = train(40_000.0, 1.27, first_s=0.9)
    for at_hz, kind in ((3000.0, BeepKind.OFF_LABEL), (9000.0, BeepKind.UNLISTED)):
        one, _ = mirror_names(train(-at_hz), here, tags=(listed(2, at_hz), far))
        assert (one.kind, one.reason) == (kind, "")
    # Both 6 kHz below their labels: the receiver is off, though one is where its mirror is.
    both = train(-3000.0), train(34_000.0, 1.27)
    found = mirror_names(*both, tags=(listed(2, 3000.0), far))
    assert [(one.kind, one.reason) for one in found] == [(BeepKind.OFF_LABEL, "")] * 2


def test_some_mirror_frequencies_fit_by_chance_in_a_list_of_one_interval() -> None:
    places_hz = (-8000.0, 5800.0, 0.0, -3000.0)
    # All are 2.2 kHz above their labels, which may also be another's label.
    found = mirror_names(
        *(train(hz + 2200.0, first_s=0.5 + 0.2 * n) for n, hz in enumerate(places_hz)),
        tags=[listed(2 + n, hz) for n, hz in enumerate(places_hz)],
    )
    assert {(one.kind, one.reason) for one in found} == {(BeepKind.OFF_LABEL, "")}


def test_two_tags_side_by_side_may_be_mirrored_or_the_receiver_off() -> None:
    tags = listed(2, 3000.0), listed(4, 3050.0, 0.9)
    found = mirror_names(train(-3000.0), train(-3050.0, 0.9), tags=tags)
    assert [one.kind for one in found] == [BeepKind.OFF_LABEL] * 2
    assert all("mirrored (I and Q swapped)" in str(one) for one in found)
    assert shared_offset_ppm(found) is not None


def test_one_tag_at_anothers_frequency_has_another_rate_or_is_mirrored() -> None:
    tags = listed(2, 8000.0), listed(4, -8000.0, 0.9)
    (one,) = mirror_names(train(-8000.0), tags=tags)
    assert one.kind is BeepKind.OTHER_RATE
    assert one.meaning == "tag 4 with another pulse rate or tag 2 mirrored (I and Q swapped)"


def test_a_sender_of_data_bursts_is_no_animal() -> None:
    rng = np.random.default_rng(8)
    samples = samples_of(scene(duration_s=30.0))
    length = round(0.0267 * RATE_HZ)
    for start_s in np.arange(0.5, 29.0, 1.2):
        tones_hz = np.repeat(rng.choice([-600.0, 600.0], 40), 20)[:length]
        cycles = np.cumsum(4000.0 + tones_hz) / RATE_HZ
        first = round(start_s * RATE_HZ)
        samples[first : first + length] += (5.0 * np.exp(2j * np.pi * cycles)).astype(
            np.complex64
        )
    trains, _ = find_trains(points_of(samples), 30.0, RADIO)
    assert [one.together for one in trains] == [2, 2]
    assert {one.kind for one in names(*trains, tags=(TAG,))} == {BeepKind.NOT_ANIMAL}


@pytest.mark.parametrize(("amplitude", "width_s"), [(300.0, 4e-5), (30.0, 3e-4), (20.0, 2e-3)])
def test_an_electric_fence_is_no_beeper(amplitude: float, width_s: float) -> None:
    rng = np.random.default_rng(9)
    samples = samples_of(scene(duration_s=30.0))
    length = max(1, round(width_s * RATE_HZ))
    spark = rng.standard_normal((length, 2), dtype=np.float32).view(np.complex64).ravel()
    for start_s in np.arange(0.5, 29.0, 1.2):
        first = round(start_s * RATE_HZ)
        samples[first : first + length] += np.float32(amplitude) * spark
    assert find_trains(points_of(samples), 30.0, RADIO)[0] == []


def test_a_listed_tag_is_not_mentioned_and_an_unlisted_one_is() -> None:
    own, stranger = names(train(-460.0, 1.26), train(235_200.0, 1.102), tags=(TAG,))
    assert (own.kind, stranger.kind) == (BeepKind.LISTED, BeepKind.UNLISTED)
    (line,) = words_of_beeps([own, stranger])
    assert line == "20 dB at 148.935200 MHz, 54 pulses every 1102 ms (54 a minute): unlisted"


def test_pulses_without_a_steady_interval_at_a_tags_frequency_are_doubtful() -> None:
    rng = np.random.default_rng(5)
    steady = beeper(2000.0, 1.254).starts_s[:9]
    other = np.sort(rng.uniform(12.0, 59.0, 40))
    one = replace(beeper(2000.0, 1.0, enr_db=25.0), starts_s=np.concatenate((steady, other)))
    found = named(scene(one, duration_s=60.0), [listed(2, 2000.0)], 500.0)
    assert all(each.kind in (BeepKind.DOUBTFUL, BeepKind.LISTED) for each in found)


def test_an_interval_that_changes_with_the_temperature_is_one_train_of_ten_minutes() -> None:
    rng = np.random.default_rng(7)
    number = np.arange(500)
    times_s = 0.5 + np.cumsum(1.2 * (1.0 + 0.002 * number / 500.0))
    times_s += rng.uniform(-0.005, 0.005, 500)
    times_s = np.sort(np.concatenate((times_s[rng.random(500) > 0.1], rng.uniform(0, 600, 20))))
    (one,) = find_beats(times_s, 600.0)
    assert one.members.size >= 440
    assert one.beat.interval_s == pytest.approx(1.2012, abs=1e-3)


@pytest.mark.parametrize(("rate_hz", "pause"), [(375e3, 0), (1e6, 60)])
def test_a_live_search_of_the_tags_band_pauses_only_if_the_band_is_wide(
    rate_hz: float, pause: int
) -> None:
    search = BeepSearch([TAG], 500.0, Receiver(CENTER_HZ, 3e6), live=True)
    band = IQBlock(np.zeros(round(rate_hz), np.complex64), 0, 0, rate_hz)
    due = "".join("x" if search.due(band, band)[1] else " " for _ in range(600))
    assert due.startswith("x" * 60)
    assert max(map(len, due.split("x"))) == pause


def test_a_live_search_of_the_rest_begins_with_twenty_intervals_of_2_s() -> None:
    search = BeepSearch([TAG], 500.0, Receiver(CENTER_HZ, 3e6), live=True)
    block, band = (IQBlock(np.zeros(hz, np.complex64), 0, 0, float(hz)) for hz in (8, 4))
    due = "".join("x" if search.due(block, band)[0] else " " for _ in range(540))
    assert due == "x" * 40 + " " * 480 + "x" * 20


def test_a_live_stream_names_each_beeper_once_while_it_runs() -> None:
    search = BeepSearch([TAG], 500.0, Receiver(CENTER_HZ, RATE_HZ), live=True)
    source = scene(beeper(1640.0, 1.26), beeper(-5000.0, 0.8, first_s=31.0), duration_s=100.0)
    said: list[tuple[float, BeepKind]] = []
    known: list[Beep] = []
    for block in blocks_of(source):
        search.add(block, block)
        at_s = block.sample_index / RATE_HZ
        news = search.news(block.time_ns)
        said += [(at_s, one.kind) for one in news if keep_beep(known, one)]
    assert [kind for _, kind in said] == [BeepKind.OFF_LABEL, BeepKind.UNLISTED]
    assert said[0][0] < 25.0
    assert said[1][0] < 75.0
    assert known[0].pulses >= 20
    assert search.finish() == []


def test_a_live_stream_names_a_known_tag_anew_once_its_rate_changes() -> None:
    slow = regular(60.0, 1.26, 0.3)
    fast = slow[-1] + 1.26 + regular(60.0, 0.63, 0.0)
    changing = replace(beeper(300.0, 1.26), starts_s=np.concatenate((slow, fast)))
    search = BeepSearch([TAG], 500.0, Receiver(CENTER_HZ, RATE_HZ), live=True)
    said: list[tuple[float, Beep]] = []
    for block in blocks_of(scene(changing, duration_s=90.0)):
        search.add(block, block)
        at_s = block.sample_index / RATE_HZ
        said += [(at_s, one) for one in search.news(block.time_ns)]
    assert said[0][0] < 13.0
    assert 60.0 < next(at_s for at_s, one in said if one.kind is BeepKind.OTHER_RATE) < 75.0


def test_pulses_that_continue_a_train_are_no_reason_to_search_again_others_are() -> None:
    rng = np.random.default_rng(3)
    times_s = np.arange(0.5, 300.0, 1.26)
    times_s += rng.uniform(0.0, 0.01, times_s.size)
    ones = np.ones(times_s.size)
    points = Points(times_s, rng.normal(1000.0, 5.0, times_s.size), 0.02 * ones, 20.0 * ones)
    searched: list[Searched] = []
    assert len(find_trains(points.take(times_s < 60.0), 60.0, RADIO, searched)[0]) == 1
    (known,) = searched
    later_s = times_s[times_s > 30.0]
    assert known.holds(later_s[later_s < 230.0])
    assert not known.holds(later_s[later_s < 250.0])  # four times as many
    assert not known.holds(np.sort(np.concatenate((later_s[:40], rng.uniform(65.0, 80.0, 12)))))
