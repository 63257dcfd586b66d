"""A measured sender corrects the listed tag that it may be, and the old values are kept."""

from dataclasses import replace
from typing import Any

import made
import pytest
from some import some

from uavrt.config.tags.tag_corrections import TagCorrection, correction_of, still_holds
from uavrt.core.messages import BeepKind, Command
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
