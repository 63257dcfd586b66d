"""What the tag files refuse no wire may bring in: a detector would die of it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from operated import Operator
from some import typed

from uavrt.config.settings import DetectionSettings
from uavrt.config.tags.tag_files import faults_of_tags, read_tags, write_tags
from uavrt.core.errors import TagFileError
from uavrt.core.messages import Command
from uavrt.link.tunnel.drone_exchange import Answer, Exchange
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g0 import FAILURE
from uavrt.link.tunnel.generations.g1 import AckG1
from uavrt.link.tunnel.tunnel_records import tag_to_wire

TAG = made.tag(interval_uncertainty_s=0.06, interval_jitter_s=0.01)
BAD: list[tuple[dict[str, Any], str]] = [
    ({"pulse_width_s": 0.7}, "pulse_width_ms 700 must be under half of the interval"),
    ({"interval_uncertainty_s": 60.0}, "interval_uncertainty_ms 60000 must be under half"),
    ({"k": 400}, "k 400 must be a whole number from 1 to 100"),
    ({"k": 4_000_000_000}, "k 4000000000 must be a whole number from 1 to 100"),
    ({"k": 40}, "k 40 is too large for interval_uncertainty_ms 60"),
    ({"frequency_hz": 148_710.0}, "looks like kHz"),
    ({"pulse_intervals_s": (3600.0,)}, "at most 60000 ms"),
    ({"pulse_intervals_s": (1.254, 1.254)}, "is the same as the first interval"),
    ({"interval_jitter_s": 1.0}, "must be under half of the interval"),
    ({"false_alarm_probability": 0.6}, "must be above 0 and at most 0.5"),
]


@pytest.mark.parametrize(("change", "reason"), BAD)
def test_a_bad_tag_is_refused_by_air_with_its_reason_and_in_files(
    change: dict[str, Any], reason: str, tmp_path: Path
) -> None:
    exchange, operator = Exchange(), Operator(tmp_path)
    operator.say("start_tags", "mavlink 255/190")
    tag = replace(TAG, **change)
    asked = typed(Command, exchange.receive(tag_to_wire(tag).encode(), (255, 190)))
    answer = typed(Answer, exchange.reply(operator.mission.command(asked)))
    acknowledgement = typed(AckG1, decode(answer.payload))
    assert acknowledgement.result == FAILURE
    assert acknowledgement.message.startswith("tag 2: ")
    assert reason[:90] in acknowledgement.message
    assert not operator.mission.upload.tags
    # The files refuse the same tag.
    assert reason in faults_of_tags([tag])[0]
    write_tags(tmp_path / "tags.toml", (tag,))
    with pytest.raises(TagFileError):
        read_tags(tmp_path / "tags.toml")


def test_no_more_tags_are_taken_than_the_computer_carries(tmp_path: Path) -> None:
    operator = Operator(tmp_path, detection=DetectionSettings(maximum_tags=3))
    operator.say("start_tags")
    for number in (2, 4, 6):
        assert operator.say("add_tag", tag=replace(TAG, tag_id=number)).accepted
    refused = operator.say("add_tag", tag=replace(TAG, tag_id=8))
    assert (refused.accepted, refused.message) == (
        False,
        "the list has more than 3 tags: send fewer, or raise detection.maximum_tags",
    )
    assert operator.say("add_tag", tag=replace(TAG, tag_id=6)).accepted, "a repetition"
    assert len(operator.mission.upload.tags) == 3


def test_a_setting_that_makes_all_tags_unsearchable_is_told_at_the_start(
    tmp_path: Path,
) -> None:
    operator = Operator(tmp_path, detection=DetectionSettings(k=40))
    operator.send_tags(TAG)
    assert "k 40 is too large" in operator.refusal("start_detection")
    assert operator.flights == []


@given(
    width_ms=st.integers(0, 2_000),
    intervals_ms=st.lists(st.integers(0, 70_000), min_size=1, max_size=2),
    uncertainty_ms=st.integers(0, 70_000),
    jitter_ms=st.integers(0, 40_000),
    k=st.integers(0, 9),
    false_alarm=st.floats(0.0, 1.0),
)
@settings(max_examples=15, suppress_health_check=[HealthCheck.filter_too_much])
def test_whatever_the_rules_take_a_detector_takes(
    width_ms: int,
    intervals_ms: list[int],
    uncertainty_ms: int,
    jitter_ms: int,
    k: int,
    false_alarm: float,
) -> None:
    tag = made.tag(
        1,
        148.7e6,
        *tuple(interval / 1e3 for interval in intervals_ms),
        pulse_width_s=width_ms / 1e3,
        interval_uncertainty_s=uncertainty_ms / 1e3,
        interval_jitter_s=jitter_ms / 1e3,
        k=k,
        false_alarm_probability=false_alarm,
    )
    assume(not faults_of_tags([tag]))
    assert made.detector(tag, 7500.0, center_frequency_hz=148.7e6).flush() == []


@pytest.mark.parametrize("jitter_s", [0.0, 0.001])
def test_a_hundred_pulses_for_a_decision_are_searched(jitter_s: float) -> None:
    tag = replace(TAG, k=100, interval_uncertainty_s=0.001, interval_jitter_s=jitter_s)
    assert not faults_of_tags([tag])
    made.detector(tag, 7500.0, center_frequency_hz=148.71e6)


def test_a_start_with_fewer_tags_than_were_sent_is_refused(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(TAG, replace(TAG, tag_id=4))
    refused = operator.refusal("start_detection", tag_count=3)
    assert refused == "only 2 of 3 tags arrived: send them all again"
    assert operator.flights == []
    # As many or more: some may have come by another wire.
    assert operator.say("start_detection", tag_count=1).accepted


def test_codes_that_nobody_can_tell_apart_are_refused_with_the_list(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    code = replace(
        TAG,
        tag_id=30,
        pulse_width_s=0.0025,
        pulse_intervals_s=(4.7,),
        interval_uncertainty_s=0.004,
        interval_jitter_s=0.0,
        k=10,
        gaps_s=(0.022, 0.0488, 0.0366),
    )
    operator.say("start_tags")
    assert "overlap" in operator.refusal("add_tag", tag=replace(code, gaps_s=(0.004, 0.0488)))
    for tag_id in (30, 31):
        assert operator.say("add_tag", tag=replace(code, tag_id=tag_id)).accepted
    assert "tags 30 and 31 have the same code" in operator.refusal("end_tags")
