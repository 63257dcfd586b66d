"""Any message survives the wire; any bytes are a message or a `TunnelError`."""

import dataclasses
import math
import struct

import made
from hypothesis import given, settings
from hypothesis import strategies as st

from uavrt.core.commands import CommandId, Generation
from uavrt.core.earth.attitude import euler_deg, from_euler_deg
from uavrt.core.errors import TunnelError
from uavrt.core.messages import PulsePose, Tag
from uavrt.link.tunnel.generations.codec import DECODERS, TunnelMessage, decode, generation_of
from uavrt.link.tunnel.generations.g0 import AckG0, PulseG0, TagG0
from uavrt.link.tunnel.generations.g1 import (
    AckG1,
    FieldsG1,
    Heartbeat,
    PulseG1,
    TagG1,
)
from uavrt.link.tunnel.tunnel_records import (
    pulse_from_wire,
    pulse_to_wire,
    tag_from_wire,
    tag_to_wire,
)

U8, U16, U32 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32))
F64 = st.floats(allow_nan=False)
F32 = st.floats(allow_nan=False, width=32)
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0")).filter(
    lambda text: len(text.encode()) <= 115
)

MESSAGES = st.one_of(
    st.builds(AckG0, acked_command=U32, result=U32),
    st.builds(AckG1, acked_command=U32, result=U32, message=TEXT),
    *(
        st.builds(kind, **{field.name: U32 for field in dataclasses.fields(kind)[:8]},
                  false_alarm_probability=F64)
        for kind in (TagG0,)
    ),
    st.builds(
        TagG1,
        **{field.name: U32 for field in dataclasses.fields(TagG1)[:8]},
        false_alarm_probability=F64,
        channel_number=U32,
        channel_center_frequency_hz=U32,
        interval1_mean=F64,
        interval1_deviation=F64,
        interval2_mean=F64,
        interval2_deviation=F64,
    ),
    st.builds(
        FieldsG1,
        command=st.just(CommandId.START_DETECTION),
        numbers=st.tuples(U32, U32)
        | st.tuples(U32, U32, U32)
        | st.tuples(U32, U32, U32, F64, F64)
        | st.tuples(U32, U32, U32, F64, F64, U32),
    ),
    st.builds(
        FieldsG1,
        command=st.just(CommandId.RAW_CAPTURE),
        numbers=st.tuples(U32) | st.tuples(U32, U32),
    ),
    st.builds(Heartbeat, system_id=U16, status=U16, cpu_temperature_c=F32),
)  # fmt: skip


@given(MESSAGES)
def test_a_message_comes_back_as_it_was(message: TunnelMessage) -> None:
    payload = message.encode()
    assert decode(payload) == message
    assert decode(payload).encode() == payload


def decoded_or_error(payload: bytes) -> TunnelMessage | TunnelError:
    try:
        return decode(payload)
    except TunnelError as error:
        return error


@settings(max_examples=500)
@given(st.binary(max_size=140))
def test_any_bytes_are_a_message_or_a_tunnel_error(payload: bytes) -> None:
    outcome = decoded_or_error(payload)
    if isinstance(outcome, TunnelError):
        assert outcome.payload == payload
    else:
        assert len(outcome.encode()) == len(payload)


@settings(max_examples=500)
@given(st.sampled_from(sorted(DECODERS)), st.data())
def test_any_content_of_a_right_length_is_read_and_converted_or_refused(
    kind: tuple[int, int], data: st.DataObject
) -> None:
    command, size = kind
    body = data.draw(st.binary(min_size=size - 4, max_size=size - 4))
    message = decode(struct.pack("<I", command) + body)
    try:
        if isinstance(message, TagG0 | TagG1):
            assert tag_from_wire(message).tag_id == message.tag_id
        if isinstance(message, PulseG0 | PulseG1):
            read = pulse_from_wire(message)
            pulse = read.pulse if isinstance(read, PulsePose) else read
            assert pulse is None or pulse.tag_id == message.tag_id
    except TunnelError:
        pass


TAGS = st.builds(
    Tag,
    tag_id=st.integers(1, 2**32 - 1),
    frequency_hz=st.integers(1, 2**32 - 1).map(float),
    pulse_width_s=st.integers(1, 90).map(lambda ms: ms / 1000),
    pulse_intervals_s=st.lists(
        st.integers(100, 10_000).map(lambda ms: ms / 1000), min_size=1, max_size=2
    ).map(tuple),
    interval_uncertainty_s=st.integers(0, 500).map(lambda ms: ms / 1000),
    interval_jitter_s=st.integers(0, 500).map(lambda ms: ms / 1000),
    k=st.integers(1, 50),
    false_alarm_probability=st.floats(1e-9, 0.999),
)


@given(TAGS, st.sampled_from(["G0", "G1"]))
def test_a_tag_with_whole_milliseconds_survives_both_generations(
    tag: Tag, generation: Generation
) -> None:
    wire = decode(tag_to_wire(tag, generation).encode())
    assert isinstance(wire, TagG0 | TagG1)
    assert generation_of(wire) == generation
    assert tag_from_wire(wire) == tag


ANGLES = st.tuples(st.floats(-179, 179), st.floats(-85, 85), st.floats(-179, 179))


@given(ANGLES)
def test_euler_angles_survive_the_quaternion(angles: tuple[float, float, float]) -> None:
    back = euler_deg(from_euler_deg(*angles))
    assert all(math.isclose(a, b, abs_tol=1e-6) for a, b in zip(angles, back, strict=True))


@given(
    angles=ANGLES,
    time_ns=st.integers(1_000_000_000 * 10**9, 4_000_000_000 * 10**9),
    status=st.sampled_from(["subthreshold", "detected", "confirmed"]),
    generation=st.sampled_from(["G0", "G1"]),
    posed=st.booleans(),
)
def test_a_pulse_keeps_its_time_status_and_heading(
    angles: tuple[float, float, float],
    time_ns: int,
    status: str,
    generation: Generation,
    posed: bool,
) -> None:
    pose = made.pose(
        time_ns,
        35.1,
        -111.6,
        altitude_relative_m=50.0,
        altitude_amsl_m=2150.0,
        quaternion_wxyz=from_euler_deg(*angles),
    )
    pulse = made.pulse(
        time_ns,
        frequency_hz=148_710_000.4,
        end_time_ns=time_ns,
        group_snr_db=19.0,
        group_sequence=70_000,
        detection_status=status,
        confirmed=status == "confirmed",
        predicted_next_start_ns=time_ns + 10**9,
        predicted_next_end_ns=time_ns + 10**9,
    )
    sent = PulsePose(pulse=pulse, pose=pose if posed else None)
    wire = decode(pulse_to_wire(sent, generation).encode())
    assert isinstance(wire, PulseG0 | PulseG1)
    assert wire.frequency_hz == 148_710_000
    got = pulse_from_wire(wire)
    assert isinstance(got, PulsePose)
    assert abs(got.pulse.start_time_ns - time_ns) <= 500
    assert got.pulse.predicted_next_start_ns is not None
    assert (got.pulse.detection_status, got.pulse.confirmed) == (status, pulse.confirmed)
    assert (got.pose is not None) == posed
    if got.pose is not None:
        heading = euler_deg(got.pose.quaternion_wxyz)[0]
        assert abs((heading - angles[0] + 180) % 360 - 180) < 1e-4
