"""What waits to be sent to one process; it outlives the process.

Lossless lines are kept however long the process is away. Of the other topics the newest are
kept and the rest counted.
"""

import socket
from collections import Counter, deque

from uavrt.ipc.topics import TOPICS, topic_of

BYTES_AT_ONCE = 32_768


class Outbox:
    """Lines for one process instance, in order.

    Parameters
    ----------
    backlog : int, optional
        Keep no more lines of any topic than this; see `ProcessRow.backlog`.
    """

    def __init__(self, backlog: int | None = None) -> None:
        self._backlog = backlog
        self._lines: deque[tuple[str, bytes]] = deque()
        self._waiting: Counter[str] = Counter()
        self._written = 0
        """Bytes of the first line that the present process has already got."""
        self.dropped: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._lines)

    def put(self, line: bytes) -> None:
        """Add a line (newline included); make room by the topic's rule."""
        name = topic_of(line)
        topic = TOPICS[name]
        self._lines.append((name, line))
        self._waiting[name] += 1
        limit = self._backlog if topic.lossless else topic.backlog
        if limit is not None and self._waiting[name] > limit:
            self._drop_oldest(name)

    def put_first(self, line: bytes) -> None:
        """Add a line in front of all others, for a process that has just been started."""
        self._written = 0
        self._lines.appendleft((topic_of(line), line))
        self._waiting[topic_of(line)] += 1

    def forget(self, name: str) -> None:
        """Remove all lines of a topic; an old assignment must not reach a new process."""
        self._lines = deque(item for item in self._lines if item[0] != name)
        self._waiting[name] = 0
        self._written = 0

    def write_to(self, sock: socket.socket) -> bool:
        """Write as much as the socket takes; True when nothing is left."""
        while self._lines:
            try:
                sent = sock.send(self._next_bytes())
            except BlockingIOError:
                return False
            self._written += sent
            while self._lines and self._written >= len(self._lines[0][1]):
                name, line = self._lines.popleft()
                self._waiting[name] -= 1
                self._written -= len(line)
        return True

    def _next_bytes(self) -> bytes:
        """Join what goes into one call: a burst of pulses wakes the receiver once."""
        size, lines = 0, []
        for _, line in self._lines:
            lines.append(line)
            size += len(line)
            if size > BYTES_AT_ONCE:
                break
        return b"".join(lines)[self._written :]

    def _drop_oldest(self, name: str) -> None:
        for index, (topic, _) in enumerate(self._lines):
            # The first line may be half written; it stays whole.
            if topic == name and not (index == 0 and self._written):
                del self._lines[index]
                self._waiting[name] -= 1
                self.dropped[name] += 1
                return
