"""Simulate the forwarding of messages by an autopilot, and loss and delay of links.

PX4 1.17 puts forwarded messages into a ring buffer of 2 × sizeof(mavlink_message_t) + 1 = 583
bytes for each outgoing link. Each pass of that link's main loop, every 4 ms in simulation,
takes one message out. A message that does not fit is dropped silently. PX4 loses messages only
here, which explains Tables 5.10 to 5.13 of the thesis.
"""

import random
from collections import deque

from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.frame import Frame

RING_BYTES = 583
PASS_NS = 4_000_000
HEADER_BYTES = 12
"""Bytes stored with each forwarded message: header and checksum of MAVLink 2."""
ITEM_BYTES = 4
"""Size of the length that the ring buffer stores with each message [bytes]. With header and
length, five tunnel payloads of 92 bytes or three of 128 bytes fit in a burst, as measured."""


class ForwardRing:
    """Queue of messages for one link; its size is limited, and each pass sends one message.

    Call `passes` with the arrival time before each `push`, so that no message is lost only
    because this program woke up late.

    `capacity_bytes`: size of the ring buffer. `pass_ns`: period of the main loop [ns].
    """

    def __init__(self, capacity_bytes: int = RING_BYTES, pass_ns: int = PASS_NS) -> None:
        self._capacity = capacity_bytes
        self._pass_ns = pass_ns
        self._items: deque[Frame] = deque()
        self._used = 0
        self._next_pass_ns: int | None = None
        self.forwarded = 0
        self.dropped = 0

    def __len__(self) -> int:
        return len(self._items)

    def push(self, frame: Frame) -> bool:
        """Add a message; False if it does not fit."""
        size = len(frame.payload) + HEADER_BYTES + ITEM_BYTES
        if self._used + size >= self._capacity:
            self.dropped += 1
            return False
        self._items.append(frame)
        self._used += size
        return True

    def passes(self, now_ns: int) -> list[Frame]:
        """Remove and return the messages sent up to `now_ns`, one for each pass of the loop."""
        if self._next_pass_ns is None:
            self._next_pass_ns = now_ns + self._pass_ns
        sent: list[Frame] = []
        while self._next_pass_ns <= now_ns:
            if not self._items:  # empty passes do nothing: skip them all
                empty = (now_ns - self._next_pass_ns) // self._pass_ns + 1
                self._next_pass_ns += empty * self._pass_ns
                break
            frame = self._items.popleft()
            self._used -= len(frame.payload) + HEADER_BYTES + ITEM_BYTES
            self.forwarded += 1
            sent.append(frame)
            self._next_pass_ns += self._pass_ns
        return sent


class Routes:
    """Components that sent messages on a link; messages with a target go only to these."""

    def __init__(self) -> None:
        self._seen: set[tuple[int, int]] = set()

    def saw(self, frame: Frame) -> None:
        """Register the sender of a message from the link."""
        self._seen.add((frame.system_id, frame.component_id))

    def leads_to(self, system_id: int, component_id: int) -> bool:
        """True if a message with this target must be sent on the link."""
        if system_id == 0:
            return True
        return any(
            system_id == system and component_id in (0, component)
            for system, component in self._seen
        )


class Impairment:
    """Random loss and delay in one direction of a link; frames stay in order.

    `loss`: probability that a frame is lost. `jitter_s`: largest delay; delays are uniformly
    distributed from zero. `seed`: seed of the random numbers.
    """

    def __init__(self, *, loss: float = 0.0, jitter_s: float = 0.0, seed: int = 0) -> None:
        self._loss = loss
        self._jitter_s = jitter_s
        self._random = random.Random(seed)
        self._last_ns = 0
        self.lost = 0

    def release_ns(self, now_ns: int) -> int | None:
        """Time at which a frame sent now arrives [ns]; None if it is lost."""
        if self._loss > 0.0 and self._random.random() < self._loss:
            self.lost += 1
            return None
        delay = self._random.uniform(0.0, self._jitter_s) if self._jitter_s > 0.0 else 0.0
        self._last_ns = max(self._last_ns, now_ns + ns_from_s(delay))
        return self._last_ns
