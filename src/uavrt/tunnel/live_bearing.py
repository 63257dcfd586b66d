"""A bearing that the drone has estimated, to a ground station of uavrt.

Payload type 60003, of the private range (`uavrt.tunnel.private`)::

    offset  type   field
    0       u8     version, 1
    1       u8     flags: 1 accepted, 2 ambiguous, 4 a reflection is suspected
    2       u16    pulses
    4       u32    tag id
    8       i64    start of the turn, ns UTC
    16      i64    its end so far
    24      f64    latitude, degrees
    32      f64    longitude
    40      f32    bearing, degrees clockwise from true north
    44      f32    standard deviation
    48      f32 ×2 90 % interval, clockwise from first to second
    56      f32    how far the drone has turned, positive clockwise
    60      f32    SNR on boresight, dB; NaN when not known

64 bytes say what all pulses of a turn say together. It is sent again with each new pulse and
some times after the last, so that any one that arrives will do.
"""

import math
import struct

from uavrt.errors import TunnelError
from uavrt.messages import LiveBearing
from uavrt.units import wrap_degrees_360

BEARING_TYPE = 60_003
_LAYOUT = struct.Struct("<BBHIqqdd6f")
_VERSION = 1
_ACCEPTED, _AMBIGUOUS, _REFLECTION = 1, 2, 4
_MOST_PULSES = 0xFFFF


def encode_bearing(bearing: LiveBearing) -> bytes:
    """Write the payload."""
    flags = _ACCEPTED * bearing.accepted + _AMBIGUOUS * bearing.ambiguous
    flags += _REFLECTION * bearing.multipath_suspected
    return _LAYOUT.pack(
        _VERSION,
        flags,
        min(bearing.pulses, _MOST_PULSES),
        bearing.tag_id,
        bearing.start_time_ns,
        bearing.end_time_ns,
        bearing.latitude_deg,
        bearing.longitude_deg,
        bearing.bearing_deg,
        bearing.sigma_deg,
        *bearing.interval90_deg,
        bearing.turned_deg,
        math.nan if bearing.level_db is None else bearing.level_db,
    )


def decode_bearing(payload: bytes) -> LiveBearing:
    """Read the payload.

    Raises
    ------
    TunnelError
        It has another length or version, or a number that cannot be.
    """
    if len(payload) != _LAYOUT.size or payload[0] != _VERSION:
        raise TunnelError("no bearing of version 1", payload)
    _, flags, pulses, tag_id, start_ns, end_ns, *numbers = _LAYOUT.unpack(payload)
    latitude, longitude, bearing, sigma, low, high, turned, level = numbers
    if not all(map(math.isfinite, numbers[:-1])) or sigma < 0.0 or end_ns < start_ns:
        raise TunnelError("a bearing with numbers that cannot be", payload)
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise TunnelError("a bearing from no place on earth", payload)
    return LiveBearing(
        tag_id=tag_id,
        start_time_ns=start_ns,
        end_time_ns=end_ns,
        turned_deg=turned,
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=wrap_degrees_360(bearing),
        sigma_deg=sigma,
        interval90_deg=(wrap_degrees_360(low), wrap_degrees_360(high)),
        level_db=level if math.isfinite(level) else None,
        pulses=pulses,
        accepted=bool(flags & _ACCEPTED),
        ambiguous=bool(flags & _AMBIGUOUS),
        multipath_suspected=bool(flags & _REFLECTION),
    )
