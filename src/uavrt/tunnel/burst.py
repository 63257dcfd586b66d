"""What is inside a burst of a coded tag, to a ground station of uavrt.

The burst itself goes as a pulse, under the tag's number and to any ground station. A ground
station that acknowledges pulses is then told which pulses the burst had and whose else it may
be: payload type 60007, of the private range (`uavrt.tunnel.private`)::

    offset     type    field
    0          u8      version, 1
    1          u8      n: pulses, 1 to 8
    2          u8      m: other tags that may have sent it, at most 7
    3          u8      0
    4          u32     tag id
    8          f64     start of the burst as its pulse message has it, s since 1970 UTC
    16         i32 ×n  start of each pulse less that, 1e-7 s, rising
    16 + 4n    i16 ×n  SNR of each, 0.01 dB
    16 + 6n    u32 ×m  ids of the other tags, the likeliest first

It is acknowledged by its hash as pulses are, and sent again until it is.
"""

import math
import struct
from itertools import pairwise

from uavrt.errors import TunnelError
from uavrt.messages import BurstInside, Pulse
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

BURST_TYPE = 60_007
MOST_PULSES, MOST_OTHERS = 8, 7
_HEAD = struct.Struct("<BBBBId")
_VERSION = 1
_STEP_NS = 100
_LONGEST_S = 60.0
"""No burst is as long; what says so is damaged."""
_LATEST_S = 9.2e9
_SNR_STEPS = 100.0
_I16 = 32_767


def encode_burst(pulse: Pulse) -> bytes | None:
    """Write what is inside a burst; None for a pulse of a tag that beeps."""
    starts_ns = pulse.burst_starts_ns[:MOST_PULSES]
    if not starts_ns:
        return None
    snrs_db = pulse.burst_snrs_db[: len(starts_ns)]
    others = pulse.also_possible_tag_ids[:MOST_OTHERS]
    head = _HEAD.pack(
        _VERSION,
        len(starts_ns),
        len(others),
        0,
        pulse.tag_id,
        pulse.start_time_ns / NANOSECONDS_PER_SECOND,
    )
    return head + struct.pack(
        _shape(len(starts_ns), len(others)),
        *(round((start_ns - pulse.start_time_ns) / _STEP_NS) for start_ns in starts_ns),
        *(max(-_I16, min(_I16, round(_SNR_STEPS * snr_db))) for snr_db in snrs_db),
        *others,
    )


def decode_burst(payload: bytes) -> BurstInside:
    """Read what is inside a burst.

    Raises
    ------
    TunnelError
        It has another length or version, or a number that cannot be.
    """
    if len(payload) < _HEAD.size:
        raise TunnelError(f"the inside of a burst has at least {_HEAD.size} bytes", payload)
    version, pulses, others, _, tag_id, start_s = _HEAD.unpack_from(payload)
    if version != _VERSION:
        raise TunnelError("the inside of a burst of another version", payload)
    if not 1 <= pulses <= MOST_PULSES or others > MOST_OTHERS:
        raise TunnelError(f"a burst of {pulses} pulses and {others} other tags", payload)
    shape = _shape(pulses, others)
    if len(payload) != _HEAD.size + struct.calcsize(shape):
        raise TunnelError(f"{pulses} pulses in a burst of {len(payload)} bytes", payload)
    if not (math.isfinite(start_s) and 0.0 <= start_s < _LATEST_S):
        raise TunnelError("a burst's time is not a time since 1970", payload)
    numbers = struct.unpack_from(shape, payload, _HEAD.size)
    steps, snrs = numbers[:pulses], numbers[pulses : 2 * pulses]
    rising = all(one < two for one, two in pairwise(steps))
    if not rising or max(map(abs, steps)) * _STEP_NS > ns_from_s(_LONGEST_S):
        raise TunnelError("pulses in a burst at times that cannot be", payload)
    start_ns = ns_from_s(start_s)
    return BurstInside(
        tag_id=tag_id,
        start_time_ns=start_ns,
        burst_starts_ns=tuple(start_ns + _STEP_NS * step for step in steps),
        burst_snrs_db=tuple(snr / _SNR_STEPS for snr in snrs),
        also_possible_tag_ids=numbers[2 * pulses :],
    )


def _shape(pulses: int, others: int) -> str:
    return f"<{pulses}i{pulses}h{others}I"
