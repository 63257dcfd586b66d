import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Health,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    SearchReport,
    StatusText,
    Tag,
)
from uavrt.drone.ipc.record_link import LineBuffer
from uavrt.drone.ipc.topics import TOPICS, decode_record, encode_record

finite = st.floats(allow_nan=False, allow_infinity=False)
times = st.integers(0, 2**62)
tags = st.builds(
    Tag,
    tag_id=st.integers(0, 2**32 - 1),
    frequency_hz=finite,
    pulse_width_s=finite,
    pulse_intervals_s=st.lists(finite, min_size=1, max_size=2).map(tuple),
    interval_uncertainty_s=finite,
    interval_jitter_s=finite,
    k=st.integers(1, 50),
    false_alarm_probability=finite,
    name=st.none() | st.text(),
)
pulses = st.builds(
    Pulse,
    **dict.fromkeys(("frequency_hz", "snr_db", "group_snr_db", "score", "noise_psd"), finite),
    start_time_ns=times,
    end_time_ns=times,
    predicted_next_start_ns=st.none() | times,
    predicted_next_end_ns=st.none() | times,
)
poses = st.builds(
    Pose,
    time_ns=times,
    latitude_deg=finite,
    longitude_deg=finite,
    altitude_amsl_m=finite,
    altitude_relative_m=finite,
    quaternion_wxyz=st.tuples(finite, finite, finite, finite),
)
records = st.one_of(
    st.tuples(st.just("pulse"), pulses),
    st.tuples(
        st.just("pulse_pose"), st.builds(PulsePose, pulse=pulses, pose=st.none() | poses)
    ),
    st.tuples(st.just("poses"), st.builds(Poses, poses=st.lists(poses, max_size=3).map(tuple))),
    st.tuples(st.just("status_text"), st.builds(StatusText, text=st.text())),
    st.tuples(
        st.just("command"),
        st.builds(Command, tag=st.none() | tags, center_frequency_hz=st.none() | finite),
    ),
    st.tuples(st.just("command_reply"), st.builds(CommandReply)),
    st.tuples(
        st.just("health"),
        st.builds(Health, counters=st.dictionaries(st.text(), finite, max_size=3)),
    ),
    st.tuples(
        st.just("search_report"),
        st.builds(
            SearchReport,
            time_ns=times,
            frequency_hz=finite,
            noise_psd=finite,
            best_score=finite,
        ),
    ),
    st.tuples(
        st.just("flight"),
        st.builds(
            FlightInfo,
            start_time_ns=times,
            clock_offset_ns=times,
            center_frequency_hz=finite,
            sample_rate_hz=finite,
            tags=st.lists(tags, max_size=3).map(tuple),
        ),
    ),
)


@given(records)
def test_every_record_survives_the_wire(item: tuple[str, object]) -> None:
    topic, record = item
    line = encode_record(topic, record)
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 1
    assert decode_record(line[:-1]) == (topic, record)


@given(st.binary())
def test_any_line_is_a_record_or_refused_by_name(line: bytes) -> None:
    try:
        topic, record = decode_record(line)
    except ValueError:
        return
    assert isinstance(record, TOPICS[topic].record)


def test_a_record_on_the_wrong_topic_is_a_fault_of_the_program() -> None:
    with pytest.raises(TypeError, match="pulse carries Pulse"):
        encode_record("pulse", StatusText(severity=6, text="no"))


@given(st.lists(st.binary().map(lambda b: b.replace(b"\n", b""))), st.integers(1, 7))
def test_lines_come_out_whole_however_the_stream_is_cut(lines: list[bytes], cut: int) -> None:
    stream = b"".join(line + b"\n" for line in lines)
    buffer = LineBuffer()
    got = [
        line
        for start in range(0, len(stream), cut)
        for line in buffer.feed(stream[start : start + cut])
    ]
    assert got == lines
