"""Bearings of the drone on the wire."""

import math
import struct

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.errors import TunnelError
from uavrt.core.messages import LiveBearing
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.live_bearing import decode_bearing, encode_bearing

angles = st.floats(0.0, 359.0, width=32)
bearings = st.builds(
    LiveBearing,
    tag_id=st.integers(1, 2**32 - 1),
    start_time_ns=st.integers(0, 2**62),
    end_time_ns=st.integers(2**62, 2**63 - 1),
    turned_deg=st.floats(-3600.0, 3600.0, width=32),
    latitude_deg=st.floats(-90.0, 90.0),
    longitude_deg=st.floats(-180.0, 180.0),
    bearing_deg=angles,
    sigma_deg=st.floats(0.0, 180.0, width=32),
    interval90_deg=st.tuples(angles, angles),
    level_db=st.none() | st.floats(-30.0, 60.0, width=32),
    pulses=st.integers(3, 0xFFFF),
    accepted=st.booleans(),
    ambiguous=st.booleans(),
    multipath_suspected=st.booleans(),
)


@given(bearings)
def test_a_bearing_comes_back_as_it_was_sent(bearing: LiveBearing) -> None:
    payload = encode_bearing(bearing)
    assert len(payload) == 64 <= MAX_PAYLOAD
    assert decode_bearing(payload) == bearing


@given(st.binary(max_size=MAX_PAYLOAD))
def test_bytes_are_a_bearing_or_refused(payload: bytes) -> None:
    try:
        found = decode_bearing(payload)
    except TunnelError:
        return
    assert 0.0 <= found.bearing_deg < 360.0
    assert math.isfinite(found.latitude_deg)


@given(bearings, st.sampled_from([24, 32]), st.sampled_from([math.nan, 181.0, math.inf]))
def test_a_bearing_from_nowhere_is_refused(
    bearing: LiveBearing, offset: int, value: float
) -> None:
    payload = bytearray(encode_bearing(bearing))
    struct.pack_into("<d", payload, offset, value)
    with pytest.raises(TunnelError, match="itude_deg"):
        decode_bearing(bytes(payload))


def test_the_bytes_are_those_of_the_manual() -> None:
    payload = encode_bearing(
        made.live_bearing(
            2,
            start_time_ns=1,
            end_time_ns=2,
            turned_deg=-90.0,
            latitude_deg=47.0,
            longitude_deg=8.5,
            bearing_deg=123.5,
            sigma_deg=4.0,
            interval90_deg=(117.0, 130.0),
            level_db=None,
            pulses=7,
            ambiguous=True,
        )
    )
    assert payload[:8] == bytes([1, 3, 7, 0, 2, 0, 0, 0])
    assert struct.unpack_from("<f", payload, 40) == (123.5,)
    assert math.isnan(struct.unpack_from("<f", payload, 60)[0])
