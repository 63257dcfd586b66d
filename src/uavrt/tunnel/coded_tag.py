"""A coded tag on its way to the drone, from a ground station of uavrt.

The message for a tag has no place for gaps, so this stands for it in an upload: payload type
60008, of the private range (`uavrt.tunnel.private`)::

    offset  type    field
    0       u32     command, TAG
    4       u32     request id; 0 before the numbered versions, as the two below
    8       u32     upload id
    12      u32     place of the tag in the upload, from 0
    16      u32     tag id
    20      u32     frequency, Hz
    24      u32 ×4  pulse width, burst interval, its uncertainty and jitter, µs
    40      u8      version, 1
    41      u8      n: gaps, 1 to 7
    42      u16     K
    44      f64     false alarm probability
    52      u32 ×n  gaps from pulse start to pulse start, µs

It is acknowledged as a tag is. A drone that does not know it gives no answer.
"""

import math
import struct
from dataclasses import dataclass

from uavrt.errors import TunnelError
from uavrt.messages import Tag
from uavrt.tunnel.wire import CommandId, check, pack

CODED_TAG_TYPE = 60_008
MOST_GAPS = 7
_HEAD = struct.Struct("<10IBBHd")
_VERSION = 1
_US = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedTag:
    """The message; the numbers are those of a tag in an upload of G2, or 0."""

    tag: Tag
    request_id: int = 0
    upload_id: int = 0
    tag_index: int = 0

    def encode(self) -> bytes:
        """Bytes of the payload; raises `TunnelError` for what has no room."""
        tag = self.tag
        times_s = (
            tag.pulse_width_s,
            tag.pulse_intervals_s[0],
            tag.interval_uncertainty_s,
            tag.interval_jitter_s,
        )
        head = pack(
            _HEAD,
            CommandId.TAG,
            self.request_id,
            self.upload_id,
            self.tag_index,
            tag.tag_id,
            round(tag.frequency_hz),
            *(round(_US * one_s) for one_s in times_s),
            _VERSION,
            len(tag.gaps_s),
            tag.k,
            tag.false_alarm_probability,
        )
        gaps_us = (round(_US * gap_s) for gap_s in tag.gaps_s)
        return head + pack(struct.Struct(f"<{len(tag.gaps_s)}I"), *gaps_us)

    @classmethod
    def decode(cls, payload: bytes) -> "CodedTag":
        """Read the payload.

        Raises
        ------
        TunnelError
            Another length or version, or numbers that no burst can have.
        """
        if len(payload) < _HEAD.size:
            raise TunnelError(f"a coded tag has at least {_HEAD.size} bytes", payload)
        _, request_id, upload_id, index, *numbers = _HEAD.unpack_from(payload)
        tag_id, frequency_hz, *times_us, version, count, k, false_alarm_probability = numbers
        if version != _VERSION or not 1 <= count <= MOST_GAPS:
            raise TunnelError(f"a coded tag of version {version} with {count} gaps", payload)
        check(payload, CommandId.TAG, _HEAD.size + 4 * count)
        gaps_us = struct.unpack_from(f"<{count}I", payload, _HEAD.size)
        width_us, interval_us, uncertainty_us, jitter_us = times_us
        _check_numbers(payload, tag_id, frequency_hz, k, false_alarm_probability)
        if not 0 < 2 * width_us < min(gaps_us) or sum(gaps_us) + width_us >= interval_us:
            raise TunnelError(
                f"tag {tag_id}: pulses overlap, or the burst is longer than its interval",
                payload,
            )
        return cls(
            tag=Tag(
                tag_id=tag_id,
                frequency_hz=float(frequency_hz),
                pulse_width_s=width_us / _US,
                pulse_intervals_s=(interval_us / _US,),
                interval_uncertainty_s=uncertainty_us / _US,
                interval_jitter_s=jitter_us / _US,
                k=k,
                false_alarm_probability=false_alarm_probability,
                gaps_s=tuple(gap_us / _US for gap_us in gaps_us),
            ),
            request_id=request_id,
            upload_id=upload_id,
            tag_index=index,
        )


def _check_numbers(
    payload: bytes, tag_id: int, frequency_hz: int, k: int, false_alarm_probability: float
) -> None:
    for name, value in {"id": tag_id, "frequency": frequency_hz, "K": k}.items():
        if value == 0:
            raise TunnelError(f"tag {tag_id}: {name} is 0", payload)
    if not (math.isfinite(false_alarm_probability) and 0.0 < false_alarm_probability < 1.0):
        raise TunnelError(
            f"tag {tag_id}: false alarm probability must be between 0 and 1", payload
        )
