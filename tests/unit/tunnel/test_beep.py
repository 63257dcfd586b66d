"""What beeps beside the listed tags, on the wire."""

import contextlib
import json
import math
import struct
from dataclasses import asdict

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.config.tags.tag_corrections import correction_of, shared_offset_ppm
from uavrt.core.errors import TunnelError
from uavrt.core.messages import Beep, BeepKind
from uavrt.flight.database.schema import BEEPS
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.beep import decode_beep, encode_beep

NAMED = made.beep(offsets_hz=(640.0,), tag_ids=(2,))
offsets = st.floats(-1e5, 1e5, width=32)
named = st.lists(st.tuples(st.integers(1, 2**32 - 1), offsets), max_size=3)
beeps = st.builds(
    lambda names, kind, **given: Beep(
        kind=kind if names else BeepKind.UNLISTED,
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
    with contextlib.suppress(TunnelError):
        assert_can_be_shown(decode_beep(payload))


@given(beeps, st.integers(0, 52), st.binary(min_size=1, max_size=4))
def test_a_beep_with_changed_bytes_can_be_shown_or_is_refused(
    beep: Beep, at: int, changed: bytes
) -> None:
    payload = bytearray(encode_beep(beep))
    payload[at : at + len(changed)] = changed[: max(0, len(payload) - at)]
    with contextlib.suppress(TunnelError):
        assert_can_be_shown(decode_beep(bytes(payload)))


def assert_can_be_shown(beep: Beep) -> None:
    """All that a page, a status text, a report and a list make of it."""
    assert str(beep)
    assert shared_offset_ppm([beep, beep]) is None or beep.away_hz is not None
    for tag_id in beep.tag_ids:
        correction_of(made.tag(tag_id, beep.frequency_hz), beep, 0)
    json.dumps(asdict(beep), allow_nan=False)


@pytest.mark.parametrize("offset_hz", [math.nan, math.inf, -math.inf, 148_710_000.0])
def test_an_offset_that_leaves_no_listed_frequency_is_refused(offset_hz: float) -> None:
    payload = bytearray(encode_beep(NAMED))
    struct.pack_into("<f", payload, 45, offset_hz)
    with pytest.raises(TunnelError, match="offset"):
        decode_beep(bytes(payload))


@pytest.mark.parametrize("kind", [BeepKind.OFF_LABEL, BeepKind.OTHER_RATE, BeepKind.MIRRORED])
def test_a_kind_that_says_something_of_a_tag_is_refused_without_one(kind: BeepKind) -> None:
    payload = bytearray(encode_beep(made.beep(BeepKind.UNLISTED)))
    payload[1] = list(BeepKind).index(kind)
    with pytest.raises(TunnelError, match="needs a tag"):
        decode_beep(bytes(payload))


def test_a_damaged_row_of_a_flight_is_no_beep() -> None:
    columns = BEEPS.names.split(", ")
    for column, cell in (("offsets_hz", ""), ("kind", "mirrored"), ("interval_s", 0.0)):
        row = list(BEEPS.row(NAMED if column != "kind" else made.beep(BeepKind.UNLISTED)))
        row[columns.index(column)] = cell
        with pytest.raises(ValueError, match=r"offset|needs a tag|invalid values"):
            BEEPS.record(tuple(row))


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
