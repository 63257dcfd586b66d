"""Records waiting to be sent to one process; the queue outlives the process.

Lossless records are kept however long the process is away; of other topics the newest are kept
and the rest counted.

A process may die with records that were sent: unread, or not yet on the disk. If it reports its
progress (`ProcessRow.says_taken`), these are kept and sent again to its successor.
"""

import socket
from collections import Counter, deque

from uavrt.ipc.topics import TOPICS, decode_record, topic_of
from uavrt.messages import FlightInfo

BYTES_AT_ONCE = 32_768
MOST_KEPT = 20_000
"""Most lines kept in addition to waiting ones: 10 MB, half an hour of a disk that fails."""
BARREN_LIVES = 3
"""Ends of a process without progress after which kept lines are dropped: one may be the
cause."""

Line = tuple[str, bytes]
"""Topic and the whole line."""


class Outbox:
    """Lines for a process instance, at most `backlog` a topic; `keeps` them until taken."""

    def __init__(self, backlog: int | None = None, *, keeps: bool = False) -> None:
        self._backlog = backlog
        self._keeps = keeps
        self._lines: deque[Line] = deque()
        self._kept: deque[Line] = deque()
        """Lines sent to the present process, and not yet taken by it."""
        self._taken = 0
        """Number of lines that the present process has taken, kept or not."""
        self._barren = 0
        self._flight: bytes | None = None
        """The flight in progress when the first waiting or kept line was added."""
        self._waiting: Counter[str] = Counter()
        self._written = 0
        """Bytes of the first line that the present process has already got."""
        self.dropped: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def flight(self) -> FlightInfo | None:
        """The flight of the first line that is not yet taken."""
        return None if self._flight is None else decode_record(self._flight)[1]

    def holds(self, name: str) -> bool:
        """Whether a line of a topic is not yet sent, or not yet taken."""
        return any(topic == name for lines in (self._kept, self._lines) for topic, _ in lines)

    def put(self, line: bytes) -> None:
        """Add a line (newline included); make room by the topic's rule."""
        name = topic_of(line)
        newest = TOPICS[name].newest
        self._lines.append((name, line))
        self._waiting[name] += 1
        limit = self._backlog if newest is None else newest
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

    def taken(self, count: int) -> None:
        """Handle the present process's report of how many lines it has taken."""
        while self._taken < count and self._kept:
            self._taken += 1
            self._leave(*self._kept.popleft())

    def process_ended(self, *, by_itself: bool) -> None:
        """Queue the lines that the process has not taken, before all that waits."""
        self._barren = self._barren + 1 if by_itself and not self._taken else 0
        self._taken = 0
        if self._barren >= BARREN_LIVES:
            self._barren = 0
            while self._kept:
                self._give_up()
        self._written = 0
        self._lines.extendleft(reversed(self._kept))
        self._waiting.update(name for name, _ in self._kept)
        self._kept.clear()

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
                if self._keeps and name != "assignment":
                    self._keep(name, line)
        return True

    def _keep(self, name: str, line: bytes) -> None:
        """Keep what was sent; the oldest makes room."""
        self._kept.append((name, line))
        if len(self._kept) > MOST_KEPT:
            self._give_up()
            self._taken += 1

    def _next_bytes(self) -> bytes:
        """Join lines for one call: a burst of pulses wakes the receiver once."""
        size, lines = 0, []
        for _, line in self._lines:
            lines.append(line)
            size += len(line)
            if size > BYTES_AT_ONCE:
                break
        return b"".join(lines)[self._written :]

    def _give_up(self) -> None:
        name, line = self._kept.popleft()
        self.dropped[name] += 1
        self._leave(name, line)

    def _leave(self, name: str, line: bytes) -> None:
        """Drop a line; the next line belongs to the flight in progress after it."""
        if name == "flight":
            self._flight = line
        elif name == "flight_end":
            self._flight = None

    def _drop_oldest(self, name: str) -> None:
        for index, (topic, _) in enumerate(self._lines):
            # The first line may be partly written, so it stays.
            if topic == name and not (index == 0 and self._written):
                del self._lines[index]
                self._waiting[name] -= 1
                self.dropped[name] += 1
                return
