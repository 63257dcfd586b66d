"""How many tags an upload over ROS 2 had, so that no search starts with fewer. Pure.

The original's messages have no count: a tag that was refused or lost was simply not searched.
"""

from collections.abc import Iterable

from uavrt.ros2.senders import Sender

MOST = 10_000
"""Numbers of tags that are told apart; a flood of nonsense must not fill the memory."""


class Upload:
    """The tags since the first of an upload, taken or not."""

    def __init__(self) -> None:
        self.open = False
        """The last tag has not been told yet."""
        self._ids: set[int] = set()
        self._nameless = 0
        self._lost_before = self._lost = 0
        self._released: tuple[Sender, int] | None = None

    def add(self, tag_id: int | None, lost: int) -> None:
        """Note a tag; None where it could not be read.

        `lost` is the number of tags that the network has lost until now.
        """
        if not self.open:
            self.forget()
            self.open = True
        if tag_id is None:
            self._nameless += 1
        else:
            self.add_late(tag_id)
        self._lost = lost

    def add_late(self, tag_id: int) -> None:
        """Note a tag that was sent before the release and came after it."""
        if len(self._ids) < MOST:
            self._ids.add(tag_id)

    def resume(self, tag_ids: Iterable[int], lost: int) -> None:
        """Go on with an earlier gateway's upload; a tag may have been lost as that ended."""
        for tag_id in tag_ids:
            self.add(tag_id, lost)
        self.add(None, lost)

    def quiet(self, lost: int) -> None:
        """Note how many were lost before the next upload."""
        if not self.open:
            self._lost_before = lost

    def release(self, sender: Sender, sent_ns: int) -> None:
        """Note that it was the last."""
        self.open = False
        self._released = (sender, sent_ns)

    def is_late(self, sender: Sender, sent_ns: int) -> bool:
        """Whether a tag that comes now was sent before its sender's release."""
        if self.open or self._released is None or not sender.key:
            return False
        released_by, released_ns = self._released
        return sender == released_by and sent_ns < released_ns

    def forget(self) -> None:
        """Forget it: another upload has begun, here or on another wire."""
        self.open = False
        self._ids.clear()
        self._nameless = 0
        self._lost = self._lost_before
        self._released = None

    @property
    def tag_count(self) -> int | None:
        """As many tags were sent, at least; None when none were."""
        count = len(self._ids) + self._nameless + max(0, self._lost - self._lost_before)
        return count or None
