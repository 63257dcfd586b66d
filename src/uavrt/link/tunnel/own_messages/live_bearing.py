"""Send a bearing estimated on the drone to a ground station of uavrt.

The 64-byte message holds the sum over all pulses of a turn. It is sent again with each new
pulse and a few times after the last, so that receiving any one of them is enough. Layout:
payload type 60003 of the manual's tunnel reference.
"""

from dataclasses import replace
from math import inf

from uavrt.core.errors import TunnelError
from uavrt.core.messages import LiveBearing
from uavrt.core.units import wrap_degrees_360
from uavrt.link.tunnel.own_messages.field_layout import Layout

BEARING_TYPE = 60_003
_MOST_PULSES = 0xFFFF
_LAYOUT = Layout(
    "a bearing",
    "version:B accepted,ambiguous,multipath_suspected:B pulses:H tag_id:I start_time_ns:q "
    "end_time_ns:q latitude_deg:d longitude_deg:d bearing_deg:f sigma_deg:f "
    "interval90_deg:ff turned_deg:f level_db?:f",
    {"latitude_deg": (-90.0, 90.0), "longitude_deg": (-180.0, 180.0), "sigma_deg": (0.0, inf)},
    version=1,
)


def encode_bearing(bearing: LiveBearing) -> bytes:
    """Encode a live bearing as payload bytes."""
    return _LAYOUT.pack(bearing, pulses=min(bearing.pulses, _MOST_PULSES))


def decode_bearing(payload: bytes) -> LiveBearing:
    """Decode a live bearing; raises `TunnelError` if invalid."""
    bearing = LiveBearing(**_LAYOUT.unpack(payload))
    if bearing.end_time_ns < bearing.start_time_ns:
        raise TunnelError("a bearing has end_time_ns before start_time_ns", payload)
    low, high = map(wrap_degrees_360, bearing.interval90_deg)
    return replace(
        bearing, bearing_deg=wrap_degrees_360(bearing.bearing_deg), interval90_deg=(low, high)
    )
