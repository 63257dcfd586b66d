"""Report beeping senders that are not in the tag list to a ground station of uavrt.

Reports are sent with the lowest priority, and repeated in turn. Layout: payload type 60012 of
the manual's tunnel reference.
"""

from math import inf

from uavrt.core.errors import TunnelError
from uavrt.core.messages import Beep, BeepKind
from uavrt.link.tunnel.own_messages.field_layout import Layout

BEEP_TYPE = 60_012
MOST_TAGS = 3
_MOST_PULSES = 0xFFFF
_MOST_REASON = 48
_KINDS = tuple(BeepKind)
"""Kinds of beeping senders in the order of their wire numbers; add new ones at the end."""
_LAYOUT = Layout(
    "a beep",
    "version:B kind:B pulses:H time_ns:q frequency_hz:d interval_s:f jitter_s:f level_db:f "
    "image_of_hz?:d tag_ids#:B tag_ids*:I offsets_hz*tag_ids:f text~",
    {
        "kind": (0, len(_KINDS) - 1),
        "frequency_hz": (1.0, 1e12),
        "interval_s": (1e-3, 1e3),
        "jitter_s": (0.0, inf),
        "tag_ids": (0, MOST_TAGS),
    },
    version=1,
)


def encode_beep(beep: Beep) -> bytes:
    """Encode a report of a transmitter of regular pulses.

    The text that says why it may not be an animal's tag is cut to 48 bytes, the list of
    possible tags to three.
    """
    return _LAYOUT.pack(
        beep,
        kind=_KINDS.index(beep.kind),
        pulses=min(beep.pulses, _MOST_PULSES),
        tag_ids=beep.tag_ids[:MOST_TAGS],
        offsets_hz=beep.offsets_hz[:MOST_TAGS],
        text=beep.reason.encode()[:_MOST_REASON],
    )


def decode_beep(payload: bytes) -> Beep:
    """Decode a report of a beeping sender; raises `TunnelError` if invalid."""
    got = _LAYOUT.unpack(payload)
    reason = got.pop("text").decode("utf-8", "ignore")
    try:
        return Beep(**{**got, "kind": _KINDS[got["kind"]], "reason": reason})
    except ValueError as error:
        raise TunnelError(str(error), payload) from error
