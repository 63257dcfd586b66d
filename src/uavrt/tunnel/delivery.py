"""Which pulses may go to the ground, and when: once each, and only when safe on disk.

A pulse waits until the recorder says that it is written (DESIGN.md §2.7). A recorder that is
away must not silence the ground: after `PATIENCE_S` the pulse goes out all the same and is
counted.
"""

from collections import OrderedDict, deque

from uavrt.messages import PulsePose

PATIENCE_S = 1.5
"""A commit takes milliseconds; a restart of the recorder about half a second."""
REMEMBERED = 500
"""Pulses let out lately, of which another confirmation is ignored: 20 s of 25 pulses a second,
in 50 kB. More would fill for hours, and a recorder that comes back confirms each pulse once."""
MOST_EARLY = 20_000
"""Pulses sent before they were recorded, while the recorder is away."""

Key = tuple[int, int, int, int, int]


def key_of(pulse_pose: PulsePose) -> Key:
    """Identify a pulse."""
    pulse = pulse_pose.pulse
    return (
        pulse.tag_id,
        pulse.rate,
        pulse.group_sequence,
        pulse.group_index,
        pulse.start_time_ns,
    )


class PulseDelivery:
    """Holds pulses until they are recorded; lets each out once."""

    def __init__(self) -> None:
        self._waiting: OrderedDict[Key, tuple[PulsePose, float]] = OrderedDict()
        self._early: OrderedDict[Key, None] = OrderedDict()
        """Sent, and not yet recorded."""
        self._recent: deque[Key] = deque()
        self._let_out = set[Key]()
        """Those in `_recent`."""
        self.sent_before_recorded = 0

    @property
    def waiting(self) -> int:
        """Pulses that the recorder has not confirmed yet."""
        return len(self._waiting)

    def expect(self, pulse_pose: PulsePose, now_s: float) -> None:
        """A pulse has gone to the recorder."""
        self._waiting[key_of(pulse_pose)] = (pulse_pose, now_s + PATIENCE_S)

    def recorded(self, pulse_pose: PulsePose) -> PulsePose | None:
        """The recorder has it: get it for sending, or None if it was sent before.

        A pulse that was recorded before this process was restarted is not waiting here, but
        was not sent by it either: it is let out.
        """
        key = key_of(pulse_pose)
        self._waiting.pop(key, None)
        early = self._early.pop(key, key) is None
        return None if self._mark_sent(key) or early else pulse_pose

    def overdue(self, now_s: float) -> list[PulsePose]:
        """Get the pulses that have waited too long for the recorder."""
        late: list[PulsePose] = []
        while self._waiting:
            key, (pulse_pose, deadline_s) = next(iter(self._waiting.items()))
            if deadline_s > now_s:
                break
            del self._waiting[key]
            if not self._mark_sent(key):
                self._early[key] = None
                self.sent_before_recorded += 1
                late.append(pulse_pose)
        while len(self._early) > MOST_EARLY:
            self._early.popitem(last=False)
        return late

    def _mark_sent(self, key: Key) -> bool:
        """Remember that a pulse goes out; True when it had gone before."""
        if key in self._let_out:
            return True
        self._let_out.add(key)
        self._recent.append(key)
        while len(self._recent) > REMEMBERED:
            self._let_out.discard(self._recent.popleft())
        return False
