"""What the gateway refuses of what ROS 2 programs send, and what it says of it."""

import re
from dataclasses import replace

import made
import pytest
from ros_bench import FLIGHT, PULSE, TAG, Bench, S, started_with, tags

from uavrt.core.commands import SystemState
from uavrt.core.messages import Tag
from uavrt.link.ros2.ros_records import pulse_to_ros, tag_to_ros
from uavrt.link.ros2.types.ros_messages import (
    DiagnosticArray,
    DiagnosticStatus,
    Flag,
    KeyValue,
    RosTag,
)


def start(**values: str) -> DiagnosticArray:
    pairs = tuple(KeyValue(key=key, value=value) for key, value in values.items())
    return DiagnosticArray(status=(DiagnosticStatus(message="start", values=pairs),))


FREQUENCIES = ["nan", "148705000", "-148.7", "0", "1e99", "", "148,7", "1_48", "inf"]
GAINS = ["1_5", "nan", "15.5", "22", "-2", "much", "1e30"]


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        *(("center_frequency", f, r"radio frequency .*20 to 1000 MHz") for f in FREQUENCIES),
        *(("gain", gain, r"RADIO_GAIN cannot .*0 to 21") for gain in GAINS),
    ],
)
def test_a_start_with_an_impossible_value_is_refused_with_the_range(
    name: str, value: str, told: str
) -> None:
    bench = Bench()
    bench.hear("control_start_subprocess", start(**{name: value}))
    assert bench.commands() == []
    (line,) = bench.line.on("rosout")
    assert re.search(told, line.msg)


def test_a_start_with_possible_values_has_them() -> None:
    bench = Bench()
    bench.hear("control_start_subprocess", start(center_frequency="148.705", gain="15"))
    ((_, command),) = bench.sent
    assert (command.center_frequency_hz, command.gain) == (pytest.approx(148.705e6), 15)


IN_2038 = (2**31 - 1) * S


@pytest.mark.parametrize(
    ("tag_id", "start_ns", "reason"),
    [
        (77, PULSE.start_time_ns, "not a tag of this flight"),
        (TAG.tag_id, None, "no flight"),
        (TAG.tag_id, IN_2038, "s in the future"),
        (TAG.tag_id, FLIGHT.start_time_ns - 3 * S, "3 s before the flight"),
    ],
)
def test_a_pulse_that_is_not_of_this_flight_is_refused(
    tag_id: int, start_ns: int | None, reason: str
) -> None:
    bench = Bench(accept_pulses=True)
    if start_ns is not None:
        bench.gateway.take_flight(FLIGHT)
    start_ns = start_ns or PULSE.start_time_ns
    pulse = replace(
        PULSE, tag_id=tag_id, start_time_ns=start_ns, end_time_ns=start_ns + 20_000_000
    )
    bench.hear("pulse", pulse_to_ros(pulse, ""))
    assert bench.sent == []
    assert reason in bench.line.on("rosout")[-1].msg
    assert bench.gateway.counters["ros2_messages_refused"] == 1


def test_the_end_of_an_upload_says_how_many_tags_were_sent() -> None:
    bench = Bench()
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.line.hear("store_tag_information", RosTag(tag_id=777))
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.run(0.1)
    assert bench.commands() == ["start_tags", "add_tag", "end_tags"]
    assert bench.sent[-1][1].tag_count == 2


def receiving(bench: Bench, *received: Tag, commander: str = "ros2") -> None:
    bench.gateway.receive(
        made.system_status(
            bench.now_ns, state=SystemState.RECEIVING_TAGS, tags=received, commander=commander
        )
    )


def test_a_gateway_that_restarts_during_an_upload_counts_a_tag_that_may_be_lost() -> None:
    bench = Bench()
    first, _, third = tags(3)
    receiving(bench, first)
    bench.line.hear("store_tag_information", tag_to_ros(third))
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.line.hear("control_start_subprocess", start())
    bench.run(0.1)
    assert bench.commands() == ["add_tag", "end_tags", "start_detection"]
    assert started_with(bench) == 3, "two came, and one may be lost"
    assert "send all tags again" in bench.line.on("rosout")[0].msg


def test_an_upload_of_a_ground_station_is_not_taken_over() -> None:
    bench = Bench()
    receiving(bench, *tags(2), commander="mavlink 255/190")
    bench.hear("control_start_subprocess", start())
    assert started_with(bench) is None


def test_drops_are_said_at_most_every_ten_seconds_with_their_number() -> None:
    bench = Bench()
    for _ in range(60):
        for _ in range(100):
            bench.line.hear("pulse", pulse_to_ros(PULSE, ""))
        bench.run(1.0)
    lines = [line.msg for line in bench.line.on("rosout")]
    assert len(lines) == 6
    assert all("accept_pulses = false" in line for line in lines)
    counted = sum(int(line.split(": ")[2].split(".")[0]) for line in lines)
    assert 5000 < counted <= 6000 == bench.line.inbox.dropped["pulse"]
