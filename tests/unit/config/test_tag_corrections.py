"""What a measurement corrects: an interval, a frequency, the receiver, or nothing."""

from dataclasses import replace
from typing import Any

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.config.tags.tag_corrections import (
    MEASURED,
    TagCorrection,
    correction_of,
    shared_offset_in_words,
    shared_offset_ppm,
    standing_corrections,
    still_holds,
)
from uavrt.core.messages import Beep, BeepKind, Command, Tag
from uavrt.ground.link.requests.command_payloads import CommandEncoder
from uavrt.link.tunnel.drone_exchange import Exchange

TAG = made.tag(2, 148_710_000.0, interval_uncertainty_s=0.06, interval_jitter_s=0.01)


def test_a_frequency_off_its_label_is_listed_to_1_hz_with_the_interval_as_it_was() -> None:
    beep = made.beep(frequency_hz=148_710_640.4, tag_ids=(2,), offsets_hz=(640.4,))
    one = some(correction_of(TAG, beep, 7))
    assert one.after == replace(TAG, frequency_hz=148_710_640.0)
    assert (one.before, one.time_ns) == (TAG, 7)
    assert str(one) == "tag 2: 148.710640 MHz, was 148.710000 MHz"


def test_the_interval_of_a_listed_tag_replaces_the_nearest_with_a_narrow_uncertainty() -> None:
    tag = replace(TAG, pulse_intervals_s=(1.3,))
    beep = made.beep(BeepKind.LISTED, interval_s=1.3321, jitter_s=0.0015, tag_ids=(2,))
    one = some(correction_of(tag, beep, 0))
    assert one.after.pulse_intervals_s == (1.3321,)
    assert one.after.interval_uncertainty_s == pytest.approx(0.0067)
    assert one.after.interval_jitter_s == pytest.approx(0.0045)
    # It is corrected once, not for each new measurement.
    assert correction_of(one.after, replace(beep, interval_s=1.3324), 0) is None
    assert correction_of(one.after, replace(beep, interval_s=1.337), 0) is not None


def test_another_rate_becomes_the_second_interval_and_the_bounds_of_the_first_stay() -> None:
    beep = made.beep(BeepKind.OTHER_RATE, interval_s=0.75, tag_ids=(2,), offsets_hz=(3.0,))
    one = some(correction_of(TAG, beep, 0))
    assert one.after.pulse_intervals_s == (TAG.pulse_intervals_s[0], 0.75)
    assert one.after.interval_uncertainty_s == TAG.interval_uncertainty_s
    assert one.after.interval_jitter_s >= TAG.interval_jitter_s


def test_a_neighbour_that_may_be_meant_at_another_rate_is_corrected_in_frequency() -> None:
    other = replace(
        TAG,
        tag_id=4,
        frequency_hz=148_712_000.0,
        pulse_intervals_s=(TAG.pulse_intervals_s[0], 0.75),
    )
    beep = made.beep(
        BeepKind.OTHER_RATE, interval_s=0.75, tag_ids=(2, 4), offsets_hz=(0.0, -2000.0)
    )
    one = some(correction_of(other, beep, 0))
    assert one.what == "frequency"


@pytest.mark.parametrize("kind", [BeepKind.UNLISTED, BeepKind.IMAGE, BeepKind.DOUBTFUL])
def test_what_is_no_listed_tag_corrects_nothing(kind: BeepKind) -> None:
    assert correction_of(TAG, made.beep(kind, tag_ids=(2,), offsets_hz=(0.0,)), 0) is None


@pytest.mark.parametrize("generation", ["G0", "G1", "G2"])
def test_a_correction_is_one_message_that_needs_no_open_upload(generation: Any) -> None:
    exchange = Exchange(generation, experimental=True)
    tag = replace(TAG, frequency_hz=148_710_640.0)
    command = exchange.receive(CommandEncoder(generation).correction(tag), (255, 190))
    assert isinstance(command, Command)
    assert command.name == "add_tag"
    assert (some(command.tag).tag_id, some(command.tag).frequency_hz) == (2, 148_710_640.0)


def test_a_tag_that_drifts_away_from_its_label_is_listed_there_before_the_search_loses_it() -> (
    None
):
    def after(drift_hz: float, *others: int) -> TagCorrection | None:
        beep = made.beep(
            BeepKind.LISTED,
            frequency_hz=TAG.frequency_hz + drift_hz,
            tag_ids=(2, *others),
            offsets_hz=(drift_hz, *(0.0 for _ in others)),
        )
        return correction_of(replace(TAG, interval_uncertainty_s=0.01), beep, 0)

    for drift_hz in (-180.0, 130.0, 420.0):
        one = some(after(drift_hz))
        assert (one.what, one.after.frequency_hz) == ("frequency", TAG.frequency_hz + drift_hz)
        assert after(drift_hz, 4) is None, "of which of two tags?"
    assert after(60.0) is None


def test_a_measurement_holds_until_the_entry_that_it_was_made_with_is_corrected() -> None:
    other = replace(TAG, tag_id=4, frequency_hz=148_760_000.0)
    off = made.beep(frequency_hz=148_710_640.0, tag_ids=(2,), offsets_hz=(640.0,))
    rate = made.beep(BeepKind.OTHER_RATE, interval_s=0.75, tag_ids=(2,))
    image = replace(off, kind=BeepKind.IMAGE, frequency_hz=1.4e8, image_of_hz=148_710_640.0)
    others = image, made.beep(BeepKind.UNLISTED), replace(off, tag_ids=(9,))
    for beep in (off, rate, *others):
        assert still_holds(beep, (TAG, other))
    for beep in (off, rate):
        corrected = some(correction_of(TAG, beep, 0)).after
        assert not still_holds(beep, (corrected, other))
        assert still_holds(beep, (other,)), "of a tag that another station has listed"


NARROW = made.tag(2, 148_710_000.0, interval_uncertainty_s=0.01)
NEAR = made.tag(6, 148_710_400.0, 0.9, interval_uncertainty_s=0.01)
INTERVAL_S = NARROW.pulse_intervals_s[0]


def at_other_rate(interval_s: float, away_hz: float = 3.0, *, of: tuple[Tag, ...] = ()) -> Beep:
    at_hz = NARROW.frequency_hz + away_hz
    return made.beep(
        BeepKind.OTHER_RATE,
        frequency_hz=at_hz,
        interval_s=interval_s,
        tag_ids=tuple(tag.tag_id for tag in of or (NARROW,)),
        offsets_hz=tuple(at_hz - tag.frequency_hz for tag in of or (NARROW,)),
    )


def found_at(tag: Tag, away_hz: float) -> Beep:
    searched = abs(away_hz) < 500.0
    return made.beep(
        BeepKind.LISTED if searched else BeepKind.OFF_LABEL,
        frequency_hz=tag.frequency_hz + away_hz,
        interval_s=tag.pulse_intervals_s[0],
        tag_ids=(tag.tag_id,),
        offsets_hz=(away_hz,),
    )


@pytest.mark.parametrize("beyond_s", [0.0011, 0.002, 0.0029, 0.0031, 0.2])
def test_another_rate_at_a_tags_own_label_corrects_its_interval_however_little_it_differs(
    beyond_s: float,
) -> None:
    allowed_s = 0.01 * INTERVAL_S
    for of in ((NARROW,), (NEAR, NARROW)):
        beep = at_other_rate(INTERVAL_S + allowed_s + beyond_s, 210.0, of=of)
        one = some(correction_of(NARROW, beep, 0))
        assert one.what == "interval"
        assert beep.interval_s == pytest.approx(one.after.pulse_intervals_s[-1], abs=1e-4)


def test_a_corrected_interval_of_the_second_of_two_tags_outdates_what_was_measured() -> None:
    beep = at_other_rate(0.75, 350.0, of=(NEAR, NARROW))
    assert still_holds(beep, (NEAR, NARROW))
    for tag in (NEAR, NARROW):
        one = some(correction_of(tag, beep, 0))
        assert not still_holds(beep, (one.after,))


def test_a_tag_at_another_rate_that_has_drifted_gets_its_interval_and_then_its_frequency() -> (
    None
):
    beep = at_other_rate(0.75, 220.0)
    interval = some(correction_of(NARROW, beep, 0))
    assert interval.what == "interval"
    frequency = some(correction_of(interval.after, beep, 0))
    assert frequency.after.frequency_hz == NARROW.frequency_hz + 220.0
    assert correction_of(frequency.after, beep, 0) is None
    near = correction_of(interval.after, at_other_rate(0.75, 80.0), 0)
    assert near is None


@given(
    kind=st.sampled_from(MEASURED),
    interval_s=st.floats(0.3, 3.0),
    away_hz=st.floats(-9000.0, 9000.0),
    uncertainty_s=st.floats(0.0, 0.2),
    second=st.none() | st.floats(0.3, 3.0),
)
def test_a_measurement_corrects_frequency_and_interval_at_most_once_each(
    kind: BeepKind,
    interval_s: float,
    away_hz: float,
    uncertainty_s: float,
    second: float | None,
) -> None:
    tag = replace(NARROW, interval_uncertainty_s=uncertainty_s)
    if second is not None:
        tag = replace(tag, pulse_intervals_s=(INTERVAL_S, second))
    beep = replace(at_other_rate(interval_s, away_hz), kind=kind)
    what = []
    while (one := correction_of(tag, beep, 0)) is not None:
        tag = one.after
        what.append(one.what)
    assert len(what) == len(set(what))


OTHERS = tuple(made.tag(8 + n, 148_800_000.0 + 40_000.0 * n) for n in range(3))


@pytest.mark.parametrize("ppm", [-2.5, -0.9, 1.4, 3.2, 50.0])
def test_an_offset_of_all_tags_is_the_receivers_and_no_tag_is_offered_at_another_frequency(
    ppm: float,
) -> None:
    tags = (NARROW, *OTHERS)
    found = [
        found_at(tag, ppm * 1e-6 * tag.frequency_hz + off_hz)
        for tag, off_hz in zip(tags, (12.0, -15.0, 0.0, 8.0), strict=True)
    ]
    assert shared_offset_ppm(found) == pytest.approx(ppm, abs=0.1)
    (line,) = shared_offset_in_words(found)
    assert f"{ppm:+.1f} ppm" in line
    assert ("lower" in line) is (ppm > 0)
    for tag, beep in zip(tags, found, strict=True):
        alone, one = some(correction_of(tag, beep, 0)), correction_of(tag, beep, 0, found)
        assert alone.what == "frequency"
        assert one is None or one.what == "interval"


def test_one_tag_of_four_that_differs_does_not_hide_the_receivers_offset() -> None:
    for odd_hz in (20.0, -450.0, 2000.0):
        found = [found_at(NARROW, odd_hz), *(found_at(tag, 300.0) for tag in OTHERS)]
        assert shared_offset_ppm(found) == pytest.approx(2.0, abs=0.1)
        one = correction_of(NARROW, found[0], 0, found)
        moved = one is not None and one.what == "frequency"
        assert moved is (odd_hz == 2000.0), "only a tag that is not found otherwise"
        for tag, beep in zip(OTHERS, found[1:], strict=True):
            one = correction_of(tag, beep, 0, found)
            assert one is None or one.what == "interval"


@pytest.mark.parametrize(
    "away_hz",
    [
        (220.0, 3.0, -5.0, 9.0),
        (220.0, -210.0, 0.0, 10.0),
        (450.0, 180.0),
        (220.0,),
        (4000.0,),
        (4000.0, 10.0),
        (60.0, 55.0, 58.0),
        (300.0, 300.0, 20.0),
    ],
)
def test_tags_that_differ_and_a_tag_alone_drift_by_themselves(
    away_hz: tuple[float, ...],
) -> None:
    tags = (NARROW, *OTHERS)
    found = [found_at(tag, hz) for tag, hz in zip(tags, away_hz, strict=False)]
    assert shared_offset_ppm(found) is None
    assert shared_offset_in_words(found) == []
    one = correction_of(NARROW, found[0], 0, found)
    assert (one is not None and one.what == "frequency") is (away_hz[0] >= 100.0)


def corrected(tag: Tag, at_hz: float) -> TagCorrection:
    return some(correction_of(tag, found_at(tag, at_hz - tag.frequency_hz), 0))


def test_the_undo_of_an_edited_entry_changes_only_what_was_corrected() -> None:
    one = corrected(NARROW, 148_710_640.0)
    edited = replace(one.after, name="otter", k=5)
    undo = one.undone(edited, 7)
    assert undo.after == replace(NARROW, name="otter", k=5)
    assert standing_corrections([one, undo]) == []


def test_an_undo_in_a_file_of_the_first_version_is_recognized_by_its_values() -> None:
    first = corrected(NARROW, 148_710_640.0)
    second = corrected(first.after, 148_711_900.0)
    undo = replace(second, before=second.after, after=first.after)
    assert standing_corrections([first, second, undo]) == [first]
    again = replace(first, before=first.after, after=NARROW)
    assert standing_corrections([first, second, undo, again]) == []
    assert standing_corrections([first, second, undo, second]) == [first, second]
