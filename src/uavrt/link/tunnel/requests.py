"""Recognise repeated requests and collect tag uploads, as protocol versions 4 and later need
it.

From version 4 on, a ground station sends a request again, byte for byte, until it is
acknowledged. The drone keeps its last 16 acknowledgements for 120 s and answers repeated
requests with them.
"""

from dataclasses import dataclass, field

from uavrt.core.commands import CommandId
from uavrt.core.errors import TunnelError
from uavrt.core.newest import Newest
from uavrt.link.tunnel.generations.g2 import TagG2, UploadG2
from uavrt.link.tunnel.own_messages.coded_tag import CodedTag

KEPT = 16
KEPT_S = 120.0

Requester = tuple[int, int]


@dataclass(slots=True)
class _Request:
    payload: bytes
    asked_s: float
    answer: bytes | None = None


class RequestCache:
    """Recent requests of all ground stations, with the acknowledgements sent for them."""

    def __init__(self) -> None:
        self._requests: Newest[tuple[Requester, int], _Request] = Newest(KEPT)

    def repeated(
        self, requester: Requester, request_id: int, payload: bytes, now_s: float
    ) -> bytes | bool:
        """Acknowledgement of a repeated request; True while it is handled, False if new."""
        if request_id == 0:
            return False  # never kept
        key = (requester, request_id)
        known = self._requests.get(key)
        if known is not None and now_s - known.asked_s <= KEPT_S:
            if known.payload != payload:
                raise TunnelError("request_id reuse: another command had this id", payload)
            return True if known.answer is None else known.answer
        self._requests[key] = _Request(payload, now_s)
        return False

    def answered(self, requester: Requester, request_id: int, answer: bytes) -> None:
        """Store the acknowledgement of a request."""
        known = self._requests.get((requester, request_id))
        if known is not None:
            known.answer = answer


@dataclass(slots=True)
class TagUpload:
    """An upload of several tags, complete once the tags with all indices have arrived."""

    upload_id: int
    tag_count: int
    requester: Requester
    indices: set[int] = field(default_factory=set)

    def check_tag(self, message: TagG2 | CodedTag, requester: Requester) -> None:
        """Raise `TunnelError` if a tag belongs to another upload or has a wrong index."""
        if (message.upload_id, requester) != (self.upload_id, self.requester):
            raise TunnelError(
                f"stale upload_id {message.upload_id}: {self.upload_id} is open",
                message.encode(),
            )
        if message.tag_index >= self.tag_count:
            raise TunnelError(
                f"tag_index {message.tag_index} is beyond tag_count {self.tag_count}",
                message.encode(),
            )

    def check_end(self, message: UploadG2, requester: Requester) -> None:
        """Raise `TunnelError` unless the upload is complete."""
        payload = message.encode()
        if (message.upload_id, requester) != (self.upload_id, self.requester):
            raise TunnelError(
                f"stale upload_id {message.upload_id}: {self.upload_id} is open",
                payload,
            )
        if message.tag_count != self.tag_count:
            raise TunnelError(
                f"tag_count mismatch: {message.tag_count}, but {self.tag_count} at the start",
                payload,
            )
        missing = sorted(set(range(self.tag_count)) - self.indices)
        if missing:
            some = ",".join(map(str, missing[:20]))
            raise TunnelError(f"incomplete: missing {some}", payload)


def open_upload(message: UploadG2, requester: Requester) -> TagUpload:
    """Begin an upload; raises `TunnelError` if its number of tags is 0."""
    assert message.command is CommandId.START_TAGS
    if message.tag_count == 0:
        raise TunnelError("START_TAGS announces no tags: tag_count is 0", message.encode())
    return TagUpload(message.upload_id, message.tag_count, requester)
