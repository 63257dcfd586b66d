"""Layouts of the numbered versions, written here a second time."""

import math
import struct

import made
import pytest

from uavrt.core.commands import CommandId, Generation
from uavrt.link.tunnel.generations import g2
from uavrt.link.tunnel.generations.codec import TunnelMessage, decode
from uavrt.link.tunnel.generations.g0 import PulseG0
from uavrt.link.tunnel.generations.g1 import PulseG1

PULSE = PulseG1(
    tag_id=2,
    frequency_hz=148_710_123,
    start_time_s=1_700_206_353.74,
    predict_next_start_s=1_700_206_357.5,
    snr_db=21.25,
    stft_score=1.5,
    group_sequence=7,
    group_index=3,
    group_snr_db=20.5,
    noise_psd=1e-12,
    detection_status=2,
    confirmed_status=1,
    latitude_deg=35.178241,
    longitude_deg=-111.656587,
    altitude_relative_m=50.5,
    roll_deg=1.5,
    pitch_deg=-2.5,
    yaw_deg=90.0,
)
NUMBERS = (PULSE.start_time_s, PULSE.predict_next_start_s, PULSE.snr_db, PULSE.stft_score)
PLACE = (35.178241, -111.656587, 50.5, 1.5, -2.5, 90.0)
TAG = made.tunnel_tag(
    channel_number=5,
    channel_center_frequency_hz=148_712_500,
    interval1_mean=1.0,
    interval1_deviation=2.0,
    interval2_mean=3.0,
    interval2_deviation=4.0,
)
CONFIRMED: dict[str, tuple[TunnelMessage, bytes]] = {
    "pulse of version 1": (
        g2.PulseG2v1(pulse=PULSE, collection_id=11, slice_id=12),
        struct.pack(
            "<5I4x4dHH4xddBB6x3d3f4x",
            *(7, 11, 12, 2, 148_710_123, *NUMBERS, 7, 3, 20.5, 1e-12, 2, 1, *PLACE),
        ),
    ),
    "heartbeat of version 1": (
        g2.HeartbeatG2v1(protocol_version=1, system_id=1, status=3, cpu_temperature_c=51.5),
        bytes.fromhex("09000000 01000000 0100 0300 00004e42"),
    ),
    "heartbeat": (
        g2.HeartbeatG2(protocol_version=7, system_id=1, status=4, cpu_temperature_c=51.5),
        bytes.fromhex("09000000 00000000 07000000 0100 0400 00004e42"),
    ),
    "stop": (
        g2.BareG2(command=CommandId.STOP_DETECTION, request_id=0x01020304),
        bytes.fromhex("06000000 04030201"),
    ),
    "start of an upload": (
        g2.UploadG2(command=CommandId.START_TAGS, request_id=5, upload_id=0xAABB, tag_count=3),
        bytes.fromhex("02000000 05000000 bbaa0000 03000000"),
    ),
    "acknowledgement": (
        g2.AckG2(acked_command=5, request_id=9, result=1, message="/home/pi/Logs"),
        struct.pack("<5I", 1, 0, 5, 9, 1) + b"/home/pi/Logs".ljust(108, b"\0"),
    ),
    "progress": (
        g2.OperationProgress(
            operation=12, request_id=9, state=0, step=2, step_count=5, message="flight 2"
        ),
        struct.pack("<7I", 21, 0, 12, 9, 0, 2, 5) + b"flight 2".ljust(100, b"\0"),
    ),
}
INFERRED: dict[str, tuple[TunnelMessage, bytes]] = {
    "tag": (
        g2.TagG2(request_id=9, upload_id=10, tag_index=1, tag=TAG),
        struct.pack(
            "<12IdII4d",
            *(4, 9, 10, 1, 2, 148_710_000, 20, 1254, 0, 60, 10, 3),
            *(0.005, 5, 148_712_500, 1.0, 2.0, 3.0, 4.0),
        ),
    ),
    "start": (
        g2.FieldsG2(
            command=CommandId.START_DETECTION,
            request_id=9,
            numbers=(148_700_000, 21, 1, 0.9, 1.3, 1, 1),
        ),
        struct.pack("<5I4xddII", 5, 9, 148_700_000, 21, 1, 0.9, 1.3, 1, 1),
    ),
    "raw capture": (
        g2.FieldsG2(command=CommandId.RAW_CAPTURE, request_id=9, numbers=(21, 148_700_000)),
        struct.pack("<4I", 8, 9, 21, 148_700_000),
    ),
    "pulse": (
        g2.PulseG2(pulse=PULSE),
        struct.pack(
            "<4I4dHH4xddBB6x3d3f4x",
            *(7, 0, 2, 148_710_123, *NUMBERS, 7, 3, 20.5, 1e-12, 2, 1, *PLACE),
        ),
    ),
    "detector's sign of life": (
        g2.DetectorHeartbeat(tag_id=2, detection_mode=1),
        struct.pack("<4I", 23, 0, 2, 1),
    ),
}


@pytest.mark.parametrize("name", [*CONFIRMED, *INFERRED])
def test_a_numbered_message_has_the_bytes_of_its_layout(name: str) -> None:
    message, expected = {**CONFIRMED, **INFERRED}[name]

    assert message.encode() == expected
    generation: Generation = "G2v1" if name.endswith("version 1") else "G2"
    assert decode(expected, generation) == message


def test_texts_end_within_their_field() -> None:
    long = "ü" * 200
    ack = g2.AckG2(acked_command=5, request_id=9, result=0, message=long).encode()
    step = g2.OperationProgress(
        operation=5, request_id=9, state=2, step=0, step_count=0, message=long
    ).encode()
    for payload in (ack, step):
        assert len(payload) == 128
        assert payload[-1] == 0
    read = decode(ack, "G2")
    assert isinstance(read, g2.AckG2)
    assert read.message == "ü" * 53


def test_the_thesis_pulse_of_the_same_length_is_still_the_thesis_pulse() -> None:
    old = struct.pack("<III4x4dH6xdBB6x7d", 7, 2, 148, *[0.0] * 4, 1, math.pi, 1, 0, *[0.0] * 7)
    assert isinstance(decode(old), PulseG0)
    assert isinstance(decode(PULSE.encode()), PulseG1)
