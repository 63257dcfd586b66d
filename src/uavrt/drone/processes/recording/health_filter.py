"""Select which health reports are recorded: every change, and one in thirty of the others.

Each process reports once a second, with 450 bytes of counters. Arming and landing count as
changes, because they separate turns in flight from carrying the drone.
"""

from uavrt.core.earth.on_ground import ground_state
from uavrt.core.messages import Health
from uavrt.core.units import ns_from_s

PERIOD_NS = ns_from_s(30.0)


class HealthFilter:
    """Selects the health reports to record, among them each process's last one."""

    def __init__(self) -> None:
        self._recorded: dict[str, Health] = {}
        self._last: dict[str, Health] = {}
        """Last health report that was not recorded, by process."""
        self.left_out = 0
        """Number of health reports that were not recorded."""

    def to_record(self, health: Health) -> list[Health]:
        """Return the reports to record now. A change also records the report before it."""
        process = health.process
        before, last = self._recorded.get(process), self._last.pop(process, None)
        same = before is not None and _state(before) == _state(health)
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
        """At the end of a flight, return each process's last unrecorded report, and reset."""
        last = list(self._last.values())
        self._last.clear()
        self._recorded.clear()
        return last


def _state(health: Health) -> tuple[object, ...]:
    return (health.status, health.ok, *ground_state(health))
