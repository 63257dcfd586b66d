"""What the gateway says and hears, without a network."""

from dataclasses import replace

import made
import pytest
from ros_bench import (
    FLIGHT,
    NEIGHBOUR,
    OPERATOR,
    PULSE,
    STARTED,
    TAG,
    Bench,
    S,
    started_with,
    tags,
)

from uavrt.core.commands import SystemState
from uavrt.core.messages import Command, ProcessStatus
from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.ros_records import coded_tag_to_ros, pulse_to_ros, tag_to_ros
from uavrt.link.ros2.ros_senders import Arrival, Sender
from uavrt.link.ros2.types.cdr import decode, encode
from uavrt.link.ros2.types.ros_messages import DiagnosticArray, Flag, RosBurst, RosTag


def worker(name: str = "detector-1") -> ProcessStatus:
    serves = (TAG.tag_id,) if name.startswith("detector-") else ()
    return made.process_status(name, "detecting", tag_ids=serves)


def test_status_is_told_twice_a_second_and_a_beat_once() -> None:
    bench = Bench()
    for _ in range(10):
        bench.status(SystemState.DETECTING, worker())
        bench.run(1.0)
    assert 19 <= len(bench.line.on("status_detector_subprocess")) <= 21
    assert 9 <= len(bench.line.on("pulse")) <= 10


def test_nothing_to_run_is_an_empty_status_and_no_beat() -> None:
    bench = Bench()
    bench.status(SystemState.IDLE)
    bench.run(2.0)
    arrays = bench.line.on("status_channelizer_subprocess")
    assert len(arrays) == 4
    assert all(isinstance(a, DiagnosticArray) and a.status == () for a in arrays)
    assert bench.line.on("pulse") == []


def test_a_supervisor_that_falls_silent_makes_every_status_stale_and_stops_the_beats() -> None:
    bench = Bench()
    bench.status(SystemState.DETECTING, worker(), worker("receiver"))
    bench.run(10.0)
    for component in ("airspy_csdr_netcat", "channelizer", "detector"):
        levels = [a.status[0].level for a in bench.line.on(f"status_{component}_subprocess")]
        assert levels[0] == 0
        assert levels[-1] == 3
    assert len(bench.line.on("pulse")) <= 4


CODED_TAG = replace(
    TAG,
    tag_id=30,
    pulse_width_s=0.0025,
    pulse_intervals_s=(4.7,),
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488, 0.0366),
)


def test_a_coded_tag_is_taken_and_shown_with_its_gaps_and_a_bad_one_refused() -> None:
    bench = Bench()
    bench.hear("store_coded_tag_information", coded_tag_to_ros(CODED_TAG))
    assert bench.commands() == ["start_tags", "add_tag"]
    assert bench.sent[1][1].tag == CODED_TAG
    bad = replace(coded_tag_to_ros(CODED_TAG), gaps=(0.022,))
    bench.hear("store_coded_tag_information", bad)
    assert bench.gateway.counters["ros2_messages_refused"] == 1
    bench.gateway.receive(
        Command(name="add_tag", request_id=1, tag=CODED_TAG, source="mavlink")
    )
    assert bench.line.on("store_coded_tag_information") == [coded_tag_to_ros(CODED_TAG)]
    assert bench.line.on("store_tag_information") == [], "it does not beep"


def test_a_burst_is_a_pulse_and_besides_what_is_inside() -> None:
    bench = Bench()
    starts_ns = tuple(PULSE.start_time_ns + ms * 1_000_000 for ms in (0, 22, 71, 107))
    bench.gateway.receive(PULSE)
    burst = replace(
        PULSE, burst_starts_ns=starts_ns, burst_snrs_db=(9.0,) * 4, also_possible_tag_ids=(4,)
    )
    bench.gateway.receive(burst)
    assert len(bench.line.on("pulse")) == 2
    (message,) = bench.line.on("burst")
    assert [one.sec * S + one.nanosec for one in message.starts] == list(starts_ns)
    assert (message.snrs, message.also_possible_tag_ids) == ((9.0,) * 4, (4,))
    assert decode(RosBurst, encode(message)) == message


def test_a_refused_tag_begins_the_next_upload_anew() -> None:
    bench = Bench()
    bench.hear("store_tag_information", tag_to_ros(TAG))
    assert bench.commands() == ["start_tags", "add_tag"]
    start = bench.sent[0][1]
    bench.gateway.receive(made.reply(start, "detecting: send stop first", accepted=False))
    assert "start_tags refused: detecting" in bench.line.on("rosout")[-1].msg
    bench.hear("store_tag_information", tag_to_ros(TAG))
    assert bench.commands()[2:] == ["start_tags", "add_tag"]


def test_a_tag_joins_the_upload_that_the_ground_has_open() -> None:
    bench = Bench()
    bench.status(SystemState.RECEIVING_TAGS)
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.run(0.1)
    assert bench.commands() == ["add_tag", "end_tags"]


def test_a_hundred_tags_are_taken_at_once_and_a_flood_is_not() -> None:
    bench = Bench()
    for _ in range(100):
        bench.line.hear("store_tag_information", tag_to_ros(TAG))
    bench.run(1.0)
    assert bench.commands().count("add_tag") == 100
    for _ in range(5000):
        bench.line.hear("release_tag_information", Flag(data=True))
    bench.run(12.0)
    release = TOPICS["release_tag_information"]
    assert bench.commands().count("end_tags") == release.burst
    assert bench.line.inbox.dropped == {release.name: 5000 - release.burst}
    (line,) = bench.line.on("rosout")
    assert f"release_tag_information: dropped messages: {5000 - release.burst}" in line.msg


def test_pulses_of_other_computers_are_taken_once_and_not_sent_back() -> None:
    bench = Bench(accept_pulses=True)
    bench.gateway.take_flight(FLIGHT)
    for _ in range(3):
        bench.line.hear("pulse", pulse_to_ros(PULSE, "/elsewhere"))
    bench.run(0.1)
    ((topic, record),) = bench.sent
    assert topic == "pulse"
    assert (record.tag_id, record.start_time_ns) == (2, PULSE.start_time_ns)
    bench.gateway.receive(record)
    assert bench.line.on("pulse") == []


@pytest.mark.parametrize(("wanted", "sender"), [(False, OPERATOR), (True, NEIGHBOUR)])
def test_pulses_that_are_not_wanted_or_of_another_drone_s_gateway_are_not_taken(
    wanted: bool, sender: Sender
) -> None:
    bench = Bench(accept_pulses=wanted)
    bench.hear("pulse", pulse_to_ros(PULSE, "/elsewhere"), sender)
    assert bench.sent == []


def test_a_flood_of_pulses_is_taken_no_faster_than_a_hundred_tags_beep() -> None:
    bench = Bench(accept_pulses=True)
    bench.gateway.take_flight(FLIGHT)
    for number in range(4000):
        start_ns = PULSE.start_time_ns + number
        pulse = replace(PULSE, start_time_ns=start_ns, end_time_ns=start_ns + 20_000_000)
        bench.line.hear("pulse", pulse_to_ros(pulse, ""))
    bench.run(10.0)
    burst = TOPICS["pulse"].burst
    assert len(bench.sent) == burst
    assert bench.line.inbox.dropped == {"pulse": 4000 - burst}


def test_orders_of_another_gateway_are_not_obeyed_and_told_once() -> None:
    bench = Bench()
    for _ in range(3):
        bench.line.hear("store_tag_information", tag_to_ros(TAG), NEIGHBOUR)
        bench.line.hear("release_tag_information", Flag(data=True), NEIGHBOUR)
        bench.line.hear("control_start_subprocess", STARTED, NEIGHBOUR)
        bench.line.hear("control_detector_subprocess", STARTED, NEIGHBOUR)
    bench.run(2.0)
    assert bench.sent == []
    assert bench.line.inbox.of_gateways == 12
    (line,) = bench.line.on("rosout")
    assert "namespace" in line.msg
    statuses = bench.line.on("status_detector_subprocess")
    assert all(array.status == () for array in statuses)  # nor refused in public
    bench.hear("control_start_subprocess", STARTED)
    assert bench.commands() == ["start_detection"]


def test_an_order_whose_sender_nobody_knows_is_refused() -> None:
    bench = Bench()
    bench.hear("control_start_subprocess", STARTED, Sender())
    assert bench.commands() == []
    assert "DDS has not announced its sender" in bench.line.on("rosout")[-1].msg


def test_a_start_says_how_many_tags_were_sent_the_refused_ones_among_them() -> None:
    bench = Bench()
    for tag in tags(20):
        for _ in range(3):  # as a careful operator sends them
            bench.line.hear("store_tag_information", tag_to_ros(tag))
    bench.line.hear("store_tag_information", RosTag(tag_id=777))
    bench.line.inbox.put(
        Arrival(topic=TOPICS["store_tag_information"], cdr=b"\0\1\0\0?", sender=OPERATOR)
    )
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.line.hear("control_start_subprocess", STARTED)
    bench.run(1.0)
    assert bench.commands().count("add_tag") == 60
    assert started_with(bench) == 22


def test_tags_that_the_network_has_lost_count_as_sent() -> None:
    bench = Bench()
    for _ in range(5):
        bench.line.inbox.drop(TOPICS["store_tag_information"])  # long ago
    bench.run(1.0)
    bench.line.hear("store_tag_information", tag_to_ros(TAG))
    for _ in range(2):
        bench.line.inbox.drop(TOPICS["store_tag_information"])
    bench.line.hear("release_tag_information", Flag(data=True))
    bench.line.hear("control_start_subprocess", STARTED)
    bench.run(1.0)
    assert started_with(bench) == 3


def test_a_tag_that_its_release_has_overtaken_begins_no_upload_of_its_own() -> None:
    bench = Bench()
    first, second, late = tags(3)
    bench.line.hear("store_tag_information", tag_to_ros(first), sent_ns=1)
    bench.line.hear("store_tag_information", tag_to_ros(second), sent_ns=2)
    bench.line.hear("release_tag_information", Flag(data=True), sent_ns=4)
    bench.line.hear("store_tag_information", tag_to_ros(late), sent_ns=3)
    bench.line.hear("control_start_subprocess", STARTED, sent_ns=5)
    bench.run(1.0)
    assert bench.commands() == [
        "start_tags",
        "add_tag",
        "add_tag",
        "end_tags",
        "start_detection",
    ]
    assert started_with(bench) == 3
    assert "tag 6 arrived after" in bench.line.on("rosout")[-1].msg


def test_tags_of_the_ground_station_are_not_counted_by_ros_2() -> None:
    bench = Bench()
    bench.hear("store_tag_information", tag_to_ros(TAG))
    bench.gateway.receive(Command(name="start_tags", request_id=1, source="mavlink 255/190"))
    bench.hear("control_start_subprocess", STARTED)
    assert started_with(bench) is None
