"""What beeps beside the listed tags, on the wire."""

import math
import struct

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.errors import TunnelError
from uavrt.messages import Beep, BeepKind
from uavrt.tunnel.beep import decode_beep, encode_beep
from uavrt.tunnel.wire import MAX_PAYLOAD

offsets = st.floats(-1e5, 1e5, width=32)
named = st.lists(st.tuples(st.integers(1, 2**32 - 1), offsets), max_size=3)
beeps = st.builds(
    lambda names, **given: Beep(
        **given,
        tag_ids=tuple(tag_id for tag_id, _ in names),
        offsets_hz=tuple(away_hz for _, away_hz in names),
    ),
    named,
    kind=st.sampled_from(BeepKind),
    time_ns=st.integers(0, 2**63 - 1),
    frequency_hz=st.floats(1e6, 1e9),
    interval_s=st.floats(0.25, 10.0, width=32),
    jitter_s=st.floats(0.0, 0.5, width=32),
    pulses=st.integers(5, 0xFFFF),
    level_db=st.floats(0.0, 90.0, width=32),
    image_of_hz=st.none() | st.floats(1e6, 1e9),
    reason=st.text(max_size=12),
)


@given(beeps)
def test_a_beep_comes_back_as_it_was_sent(beep: Beep) -> None:
    payload = encode_beep(beep)
    assert len(payload) <= MAX_PAYLOAD
    assert decode_beep(payload) == beep


@given(st.binary(max_size=MAX_PAYLOAD))
def test_bytes_are_a_beep_or_refused(payload: bytes) -> None:
    try:
        found = decode_beep(payload)
    except TunnelError:
        return
    assert str(found)
    assert all(map(math.isfinite, (found.frequency_hz, found.interval_s, *found.offsets_hz)))


def test_an_offset_that_is_no_number_is_refused() -> None:
    payload = bytearray(encode_beep(made.beep(offsets_hz=(640.0,), tag_ids=(2,))))
    struct.pack_into("<f", payload, 45, math.nan)
    with pytest.raises(TunnelError, match="offset"):
        decode_beep(bytes(payload))


def test_a_long_reason_is_cut_to_fit() -> None:
    beep = made.beep(tag_ids=(2, 4, 6), offsets_hz=(1.0, 2.0, 3.0), reason="ü" * 100)
    payload = encode_beep(beep)
    assert len(payload) <= MAX_PAYLOAD
    assert decode_beep(payload).reason == "ü" * 24


def test_the_bytes_are_those_of_the_manual() -> None:
    beep = made.beep(
        kind=BeepKind.OFF_LABEL,
        time_ns=2,
        frequency_hz=148_710_640.0,
        interval_s=1.25,
        jitter_s=0.5,
        level_db=20.0,
        pulses=7,
        tag_ids=(2,),
        offsets_hz=(640.0,),
        reason="why",
    )
    assert encode_beep(beep).hex(" ") == (
        "01 01 07 00 02 00 00 00 00 00 00 00 00 00 00 e0 49 ba a1 41 "
        "00 00 a0 3f 00 00 00 3f 00 00 a0 41 00 00 00 00 00 00 f8 7f "
        "01 02 00 00 00 00 00 20 44 77 68 79"
    )
