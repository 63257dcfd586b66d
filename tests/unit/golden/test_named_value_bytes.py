"""NAMED_VALUE_FLOAT (251): the bytes, and names of ten bytes that never collide."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.drone.processes.connection_parts.named_values import value_name
from uavrt.link.mavlink.dialect import CRC_EXTRAS, NamedValueFloat
from uavrt.link.mavlink.frame import FrameWriter

GOLDEN = "fd0d00000001bffb00003930000033336341534e525f324fe0"
IDS = st.integers(0, 2**32 - 1)


def pymavlink(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink.dialects.v20 import common

    return common


def test_the_frame_is_the_one_that_pymavlink_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    common = pymavlink(monkeypatch)
    ours = NamedValueFloat(time_boot_ms=12_345, value=14.2, name="SNR_2")
    frame = FrameWriter(1, 191).encode(ours)
    theirs = common.MAVLink(None, srcSystem=1, srcComponent=191)
    assert frame == common.MAVLink_named_value_float_message(12_345, b"SNR_2", 14.2).pack(
        theirs
    )
    assert frame.hex() == GOLDEN
    assert CRC_EXTRAS[251] == NamedValueFloat.CRC_EXTRA
    assert NamedValueFloat.decode(frame[10:-2]) == NamedValueFloat.decode(ours.pack())


def test_names_fill_ten_bytes_at_most() -> None:
    assert value_name("SNR", 0) == "SNR_0"
    assert value_name("CNT", 999_999) == "CNT_999999"
    assert value_name("SNR", 1_000_000) == "SNRLFLS"
    assert value_name("SNR", 2**32 - 1) == "SNR1Z141Z3"


@given(IDS, IDS)
def test_no_two_tags_share_a_name(one: int, other: int) -> None:
    names = {value_name(kind, tag) for kind in ("SNR", "CNT") for tag in (one, other)}
    assert len(names) == 2 * len({one, other})
    assert all(len(name) <= 10 and name.isascii() for name in names)
