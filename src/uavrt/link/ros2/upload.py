"""Count the tags of an upload over ROS 2, so that no search starts with tags missing; no I/O.

The original system's messages carry no count of tags, so a tag lost in the upload was silently
left out of the search.
"""

from collections.abc import Iterable

from uavrt.link.ros2.ros_senders import Sender

MOST = 10_000
"""Largest number of tag ids counted per upload; without a limit, a flood of tags could fill the
memory."""


class Upload:
    """Counts all tags sent since an upload's first tag, both accepted and refused."""

    def __init__(self) -> None:
        self.open = False
        """True until the message that ends the tag upload, its release, has arrived."""
        self._ids: set[int] = set()
        self._nameless = 0
        self._lost_before = self._lost = 0
        self._released: tuple[Sender, int] | None = None

    def add(self, tag_id: int | None, lost: int) -> None:
        """Count a tag (id None: unreadable); `lost`: number of tag messages lost so far."""
        if not self.open:
            self.forget()
            self.open = True
        if tag_id is None:
            self._nameless += 1
        else:
            self.add_late(tag_id)
        self._lost = lost

    def add_late(self, tag_id: int) -> None:
        """Count a tag that was sent before the end of the upload but arrived after it."""
        if len(self._ids) < MOST:
            self._ids.add(tag_id)

    def resume(self, tag_ids: Iterable[int], lost: int) -> None:
        """Continue an upload of an earlier gateway process, and count one more tag that may
        have been lost.
        """
        for tag_id in tag_ids:
            self.add(tag_id, lost)
        self.add(None, lost)

    def quiet(self, lost: int) -> None:
        """Set how many tag messages were lost so far; only later losses count for an upload."""
        if not self.open:
            self._lost_before = lost

    def release(self, sender: Sender, sent_ns: int) -> None:
        """Handle the message that ends an upload of tags."""
        self.open = False
        self._released = (sender, sent_ns)

    def is_late(self, sender: Sender, sent_ns: int) -> bool:
        """True if a tag that arrives now was sent before its sender ended the upload."""
        if self.open or self._released is None or not sender.key:
            return False
        released_by, released_ns = self._released
        return sender == released_by and sent_ns < released_ns

    def forget(self) -> None:
        """Reset all counts, because another upload has begun over ROS 2 or another link."""
        self.open = False
        self._ids.clear()
        self._nameless = 0
        self._lost = self._lost_before
        self._released = None

    @property
    def tag_count(self) -> int | None:
        """Smallest number of tags that can have been sent; None without an upload."""
        count = len(self._ids) + self._nameless + max(0, self._lost - self._lost_before)
        return count or None
