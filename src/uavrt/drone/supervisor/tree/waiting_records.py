"""Queue of records to be sent to one process; the queue is kept when the process ends.

Records of lossless topics wait until the process reads them. Of other topics, only the newest
records are kept; dropped ones are counted.

A process may end before it has read or stored records that were sent to it. If it acknowledges
records (`ProcessRow.acknowledges_records`), those not acknowledged are sent again when it is
restarted.
"""

import socket
from collections import Counter, deque

from uavrt.core.messages import FlightInfo
from uavrt.drone.ipc.topics import TOPICS, decode_record, topic_of

BYTES_AT_ONCE = 32_768
MOST_KEPT = 20_000
"""Most unacknowledged records of a process that are kept: 10 MB, 30 min of a failing disk."""
RUNS_WITHOUT_PROGRESS = 3
"""Number of runs without an acknowledgement after which a process's unacknowledged records are
dropped, because one of them may make it crash."""

Line = tuple[str, bytes]
"""A record to send: its topic and its encoded line, with newline."""


class Outbox:
    """Queue of records for one process. With `keeps`, sent records stay until acknowledged."""

    def __init__(self, backlog: int | None = None, *, keeps: bool = False) -> None:
        self._backlog = backlog
        self._keeps = keeps
        self._lines: deque[Line] = deque()
        self._kept: deque[Line] = deque()
        """Lines sent to the present run of the process but not yet acknowledged."""
        self._acknowledged = 0
        self._runs_without_progress = 0
        self._flight: bytes | None = None
        """Record of the flight of the first waiting or kept line; None outside of flights."""
        self._waiting: Counter[str] = Counter()
        self._written = 0
        """Number of bytes of the first waiting line that were already sent."""
        self.dropped: Counter[str] = Counter()

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def flight(self) -> FlightInfo | None:
        """Flight of the first record in the queue; None if it belongs to no flight."""
        return None if self._flight is None else decode_record(self._flight)[1]

    def holds(self, name: str) -> bool:
        """True if a record of this topic is still to be sent or (with `keeps`) acknowledged."""
        return any(topic == name for lines in (self._kept, self._lines) for topic, _ in lines)

    def put(self, line: bytes) -> None:
        """Add an encoded record; if its topic has too many, drop the oldest of them."""
        name = topic_of(line)
        newest = TOPICS[name].newest
        self._lines.append((name, line))
        self._waiting[name] += 1
        limit = self._backlog if newest is None else newest
        if limit is not None and self._waiting[name] > limit:
            self._drop_oldest(name)

    def put_first(self, line: bytes) -> None:
        """Add a record before all others; used when a process starts."""
        self._written = 0
        self._lines.appendleft((topic_of(line), line))
        self._waiting[topic_of(line)] += 1

    def remove_topic(self, name: str) -> None:
        """Remove all records of a topic from the queue, such as an outdated assignment."""
        self._lines = deque(item for item in self._lines if item[0] != name)
        self._waiting[name] = 0
        self._written = 0

    def remove_acknowledged(self, count: int) -> None:
        """Remove sent records up to the number that this run has acknowledged."""
        while self._acknowledged < count and self._kept:
            self._acknowledged += 1
            self._update_flight(*self._kept.popleft())

    def process_ended(self, *, by_itself: bool) -> None:
        """Queue the unacknowledged records again, before all others.

        After `RUNS_WITHOUT_PROGRESS` unexpected ends, drop them.
        """
        self._runs_without_progress = (
            self._runs_without_progress + 1 if by_itself and not self._acknowledged else 0
        )
        self._acknowledged = 0
        if self._runs_without_progress >= RUNS_WITHOUT_PROGRESS:
            self._runs_without_progress = 0
            while self._kept:
                self._give_up()
        self._written = 0
        self._lines.extendleft(reversed(self._kept))
        self._waiting.update(name for name, _ in self._kept)
        self._kept.clear()

    def write_to(self, sock: socket.socket) -> bool:
        """Send records until the socket is full; True if all are sent."""
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
        self._kept.append((name, line))
        if len(self._kept) > MOST_KEPT:
            self._give_up()
            self._acknowledged += 1

    def _next_bytes(self) -> bytes:
        """Join queued records for one send call, because each call wakes the receiver."""
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
        self._update_flight(name, line)

    def _update_flight(self, name: str, line: bytes) -> None:
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
