"""Send a coded tag from a ground station of uavrt to the drone.

The message for a beeping tag has no room for gaps; this message replaces it in an upload and is
acknowledged in the same way. A drone of an older version does not answer. Layout: payload type
60008 of the manual's tunnel reference.
"""

import math
from dataclasses import dataclass

from uavrt.core.commands import CommandId
from uavrt.core.errors import TunnelError
from uavrt.core.messages import Tag
from uavrt.link.tunnel.own_messages.field_layout import Layout

CODED_TAG_TYPE = 60_008
MOST_GAPS = 7
_US = 1_000_000
_SOME = (1, math.inf)
_LAYOUT = Layout(
    "a coded tag",
    "command:I request_id:I upload_id:I tag_index:I tag_id:I frequency_hz:I times_us:IIII "
    "version:B gaps#:B k:H false_alarm_probability:d gaps*:I",
    {"tag_id": _SOME, "frequency_hz": _SOME, "k": _SOME, "gaps": (1, MOST_GAPS)},
    command=CommandId.TAG,
    version=1,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedTag:
    """A coded tag to search for; request, upload and index as for a tag of G2, or 0."""

    tag: Tag
    request_id: int = 0
    upload_id: int = 0
    tag_index: int = 0

    def encode(self) -> bytes:
        """Encode the message; raises `TunnelError` for values that do not fit."""
        tag = self.tag
        times_s = (
            tag.pulse_width_s,
            tag.pulse_intervals_s[0],
            tag.interval_uncertainty_s,
            tag.interval_jitter_s,
        )
        return _LAYOUT.pack(
            self,
            tag_id=tag.tag_id,
            frequency_hz=round(tag.frequency_hz),
            times_us=[round(_US * one_s) for one_s in times_s],
            k=tag.k,
            false_alarm_probability=tag.false_alarm_probability,
            gaps=[round(_US * gap_s) for gap_s in tag.gaps_s],
        )

    @classmethod
    def decode(cls, payload: bytes) -> "CodedTag":
        """Decode a payload; raises `TunnelError` for a wrong length or an impossible burst."""
        got = _LAYOUT.unpack(payload)
        width_us, interval_us, uncertainty_us, jitter_us = got["times_us"]
        gaps_us, tag_id = got["gaps"], got["tag_id"]
        if not 0.0 < got["false_alarm_probability"] < 1.0:
            raise TunnelError(
                f"tag {tag_id}: false alarm probability must be between 0 and 1", payload
            )
        if not 0 < 2 * width_us < min(gaps_us) or sum(gaps_us) + width_us >= interval_us:
            raise TunnelError(
                f"tag {tag_id}: pulses overlap, or the burst is longer than its interval",
                payload,
            )
        return cls(
            tag=Tag(
                tag_id=tag_id,
                frequency_hz=float(got["frequency_hz"]),
                pulse_width_s=width_us / _US,
                pulse_intervals_s=(interval_us / _US,),
                interval_uncertainty_s=uncertainty_us / _US,
                interval_jitter_s=jitter_us / _US,
                k=got["k"],
                false_alarm_probability=got["false_alarm_probability"],
                gaps_s=tuple(gap_us / _US for gap_us in gaps_us),
            ),
            request_id=got["request_id"],
            upload_id=got["upload_id"],
            tag_index=got["tag_index"],
        )
