"""Which health reports are recorded: every change, and one in thirty of the rest.

Each process speaks once a second, some 450 bytes, and its counters only rise: thirty of them
say hardly more than the last. That the autopilot armed or landed is a change: turns are told
from carrying by it.
"""

from uavrt.messages import Health
from uavrt.on_ground import told_of_ground
from uavrt.units import ns_from_s

PERIOD_NS = ns_from_s(30.0)


class ToldHealth:
    """Selects reports; never loses the last one of a process."""

    def __init__(self) -> None:
        self._recorded: dict[str, Health] = {}
        self._last: dict[str, Health] = {}
        """Not recorded."""
        self.left_out = 0
        """Signs of life that were not recorded."""

    def worth_telling(self, health: Health) -> list[Health]:
        """Get what is to be recorded now: with a change, also the last before it."""
        process = health.process
        before, last = self._recorded.get(process), self._last.pop(process, None)
        same = before is not None and _told(before) == _told(health)
        if before is not None and same and abs(health.time_ns - before.time_ns) < PERIOD_NS:
            self.left_out += last is not None
            self._last[process] = health
            return []
        self._recorded[process] = health
        if same or last is None:
            self.left_out += last is not None
            return [health]
        return [last, health]

    def last(self) -> list[Health]:
        """Get what each process said last, at the end of a flight; then begin again."""
        last = list(self._last.values())
        self._last.clear()
        self._recorded.clear()
        return last


def _told(health: Health) -> tuple[object, ...]:
    return (health.status, health.ok, *told_of_ground(health))
