"""Bytes of the original system."""

import struct

import made
import pytest

from uavrt.link.mavlink.dialect import CRC_EXTRAS, MESSAGES, Tunnel
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.tunnel.generations.codec import decode
from uavrt.link.tunnel.generations.g0 import SUCCESS, AckG0, PulseG0, TagG0
from uavrt.link.tunnel.generations.g1 import AckG1, FieldsG1
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE

TAG_G0 = (
    "04000000020000007022dd0814000000e6040000000000003c0000000a0000000300000000000000"
    "7b14ae47e17a743f"
)
ACK_G0 = "010000000400000001000000"
ACK_FRAME = "fd0e00000001bf8101000000ffbe0c010000000400000001f256"
PULSE_G0 = (
    "0700000002000000940000000000000084966fdbc455d941daa4bcdbc455d941cba145b6f38d5140"
    "410fb56d1805d03f0300000000000000e25817b7d17451400101000000000000a52c431cebb24740"
    "babda4315a172140105839b4c8807e40e3ff0a70ac51603f2b62e0d2941155bfd9ebdd1fefd5e63f"
    "d68d7747c66ae63f"
)


def test_the_thesis_tag_has_the_original_bytes() -> None:
    tag = TagG0(
        tag_id=2,
        frequency_hz=148_710_000,
        pulse_width_ms=20,
        interval1_ms=1254,
        interval2_ms=0,
        interval_uncertainty_ms=60,
        interval_jitter_ms=10,
        k=3,
        false_alarm_probability=0.005,
    )
    assert tag.encode().hex() == TAG_G0
    assert decode(bytes.fromhex(TAG_G0)) == tag


def test_an_acknowledgement_and_its_whole_frame_have_the_original_bytes() -> None:
    ack = AckG0(acked_command=4, result=SUCCESS)
    payload = bytes.fromhex(ACK_G0)
    assert ack.encode() == payload
    assert decode(payload) == ack
    message = made.tunnel(PAYLOAD_TYPE, payload, target_system=255)
    assert FrameWriter(1, 191).encode(message).hex() == ACK_FRAME
    (frame,) = FrameParser().feed(bytes.fromhex(ACK_FRAME))
    read = frame.message()
    assert isinstance(read, Tunnel)
    assert read.payload[: read.payload_length] == payload


def test_a_pulse_of_the_thesis_is_read_and_written_bit_for_bit() -> None:
    pulse = decode(bytes.fromhex(PULSE_G0))
    assert isinstance(pulse, PulseG0)
    assert pulse.encode().hex() == PULSE_G0
    assert (pulse.tag_id, pulse.frequency_hz, pulse.group_index) == (2, 148, 3)
    assert pulse.start_time_s == 1700205421.7435617
    assert (pulse.snr_db, pulse.stft_score, pulse.group_snr_db) == (70.218, 0.250311, 69.8253)
    assert (pulse.position_x, pulse.position_y, pulse.position_z) == (47.3978, 8.54561, 488.049)
    assert (pulse.orientation_z, pulse.orientation_w) == (0.713615, 0.700534)


def test_pads_full_of_rubbish_change_nothing() -> None:
    clean = bytes.fromhex(PULSE_G0)
    dirty = bytearray(clean)
    for place in [*range(12, 16), *range(50, 56), *range(66, 72)]:
        dirty[place] = 0xA5
    assert decode(bytes(dirty)) == decode(clean)
    assert decode(bytes(dirty)).encode() == clean


# Offsets of fields as in the original structs, each packed by hand.
OFFSETS_PULSE_G1 = {
    "tag_id": ("<I", 4, 7),
    "frequency_hz": ("<I", 8, 148_710_123),
    "start_time_s": ("<d", 16, 1.7e9),
    "predict_next_start_s": ("<d", 24, 1.7e9 + 1.25),
    "snr_db": ("<d", 32, 21.5),
    "stft_score": ("<d", 40, 1.5),
    "group_sequence": ("<H", 48, 900),
    "group_index": ("<H", 50, 3),
    "group_snr_db": ("<d", 56, 20.5),
    "noise_psd": ("<d", 64, 1e-13),
    "detection_status": ("<B", 72, 2),
    "confirmed_status": ("<B", 73, 1),
    "latitude_deg": ("<d", 80, 35.5),
    "longitude_deg": ("<d", 88, -111.5),
    "altitude_relative_m": ("<d", 96, 50.25),
    "roll_deg": ("<f", 104, 1.5),
    "pitch_deg": ("<f", 108, -2.5),
    "yaw_deg": ("<f", 112, 90.5),
}
OFFSETS_TAG_G1 = {
    "tag_id": ("<I", 4, 12),
    "frequency_hz": ("<I", 8, 150_000_000),
    "pulse_width_ms": ("<I", 12, 15),
    "interval1_ms": ("<I", 16, 1000),
    "interval2_ms": ("<I", 20, 1600),
    "interval_uncertainty_ms": ("<I", 24, 6),
    "interval_jitter_ms": ("<I", 28, 7),
    "k": ("<I", 32, 5),
    "false_alarm_probability": ("<d", 40, 0.01),
    "channel_number": ("<I", 48, 3),
    "channel_center_frequency_hz": ("<I", 52, 150_001_000),
    "interval1_mean": ("<d", 56, 1.0),
    "interval1_deviation": ("<d", 64, 2.0),
    "interval2_mean": ("<d", 72, 3.0),
    "interval2_deviation": ("<d", 80, 4.0),
}
OFFSETS_START = {
    "radio_center_frequency_hz": ("<I", 4, 148_700_000),
    "gain": ("<I", 8, 21),
    "detection_mode": ("<I", 12, 1),
    "detection_margin": ("<d", 16, 0.9),
    "confidence_ratio": ("<d", 24, 1.3),
    "debug_detector": ("<I", 32, 1),
}


@pytest.mark.parametrize(
    ("command", "size", "offsets"),
    [
        (7, 120, OFFSETS_PULSE_G1),
        (4, 88, OFFSETS_TAG_G1),
        (5, 40, OFFSETS_START),
        (5, 32, {name: OFFSETS_START[name] for name in list(OFFSETS_START)[:5]}),
        (5, 16, {name: OFFSETS_START[name] for name in list(OFFSETS_START)[:3]}),
        (5, 12, {name: OFFSETS_START[name] for name in list(OFFSETS_START)[:2]}),
        (8, 8, {"gain": ("<I", 4, 9)}),
        (8, 12, {"gain": ("<I", 4, 9), "frequency_hz": ("<I", 8, 150_000_000)}),
        (
            9,
            12,
            {
                "system_id": ("<H", 4, 1),
                "status": ("<H", 6, 3),
                "cpu_temperature_c": ("<f", 8, 51.5),
            },
        ),
    ],
)
def test_each_field_of_the_newer_structs_is_at_its_offset(
    command: int, size: int, offsets: dict[str, tuple[str, int, float]]
) -> None:
    payload = bytearray(size)
    struct.pack_into("<I", payload, 0, command)
    for layout, place, value in offsets.values():
        struct.pack_into(layout, payload, place, value)
    message = decode(bytes(payload))
    if isinstance(message, FieldsG1):
        got = message.numbers
    else:
        got = tuple(getattr(message, name) for name in offsets)
    assert got == tuple(value for _, _, value in offsets.values())
    assert message.encode() == bytes(payload)


def test_the_newer_acknowledgement_holds_its_reason_from_byte_12() -> None:
    payload = AckG1(acked_command=5, result=0, message="no radio").encode()
    assert len(payload) == 128
    assert payload[:21] == struct.pack("<III", 1, 5, 0) + b"no radio\0"
    assert not any(payload[20:])


@pytest.mark.parametrize(
    ("message_id", "seed", "size"),
    [(300, 217, 22), (396, 50, 160), (397, 182, 108), (410, 160, 53), (385, 147, 133)],
)
def test_generated_messages_have_the_published_checksum_seeds(
    message_id: int, seed: int, size: int
) -> None:
    assert CRC_EXTRAS[message_id] == MESSAGES[message_id].CRC_EXTRA == seed
    assert MESSAGES[message_id].LAYOUT.size == size
