"""Pulses of a coded tag's burst, for a ground station that acknowledges pulses.

The burst itself is a pulse message, for any ground station. This message adds its pulses and
the other tags that may have sent it, and is acknowledged and repeated like pulses. Layout:
payload type 60007 of the manual's tunnel reference.
"""

from itertools import pairwise

from uavrt.core.errors import TunnelError
from uavrt.core.messages import BurstInside, Pulse
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.link.tunnel.own_messages.field_layout import Layout

BURST_TYPE = 60_007
MOST_PULSES, MOST_OTHERS = 8, 7
_STEP_NS = 100
_LONGEST_S = 60.0
"""Longest time from a burst's start to a pulse [s]; a longer one shows a damaged message."""
_LATEST_S = 9.2e9
_SNR_STEPS = 100.0
_I16 = 32_767
_LAYOUT = Layout(
    "the content of a burst",
    "version:B pulses#:B others#:B :x tag_id:I start_s:d pulses*:i snrs*pulses:h others*:I",
    {"pulses": (1, MOST_PULSES), "others": (0, MOST_OTHERS), "start_s": (0.0, _LATEST_S)},
    version=1,
)


def encode_burst(pulse: Pulse) -> bytes | None:
    """Encode the content of a burst; None for a pulse of a beeping tag."""
    starts_ns = pulse.burst_starts_ns[:MOST_PULSES]
    if not starts_ns:
        return None
    snrs_db = pulse.burst_snrs_db[: len(starts_ns)]
    return _LAYOUT.pack(
        pulse,
        start_s=pulse.start_time_ns / NANOSECONDS_PER_SECOND,
        pulses=[round((one_ns - pulse.start_time_ns) / _STEP_NS) for one_ns in starts_ns],
        snrs=[max(-_I16, min(_I16, round(_SNR_STEPS * snr_db))) for snr_db in snrs_db],
        others=pulse.also_possible_tag_ids[:MOST_OTHERS],
    )


def decode_burst(payload: bytes) -> BurstInside:
    """Decode the content of a burst; raises `TunnelError` if invalid."""
    got = _LAYOUT.unpack(payload)
    steps = got["pulses"]
    rising = all(one < two for one, two in pairwise(steps))
    if not rising or max(map(abs, steps)) * _STEP_NS > ns_from_s(_LONGEST_S):
        raise TunnelError("a burst message contains impossible times", payload)
    start_ns = ns_from_s(got["start_s"])
    return BurstInside(
        tag_id=got["tag_id"],
        start_time_ns=start_ns,
        burst_starts_ns=tuple(start_ns + _STEP_NS * step for step in steps),
        burst_snrs_db=tuple(snr / _SNR_STEPS for snr in got["snrs"]),
        also_possible_tag_ids=got["others"],
    )
