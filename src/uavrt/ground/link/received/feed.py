"""Send log lines, states and records of one vehicle to the pages and to the caller."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uavrt.core.clock import Clock
from uavrt.ground.link.protocol import GroundEvent
from uavrt.ground.page_listeners import Hub
from uavrt.ground.store.event_log import EventLog

_WARNING = 4
"""Severity of a warning, MAV_SEVERITY_WARNING."""


@dataclass(frozen=True, slots=True)
class StationNote:
    """A warning of the ground station itself, for an operator without a page."""

    severity: int
    text: str


class Feed:
    """Sends records to all pages, and passes events to a function of the caller."""

    def __init__(
        self,
        log: EventLog,
        clock: Clock,
        state: Callable[[], dict[str, Any]],
        on_event: Callable[[GroundEvent | StationNote], None] | None,
    ) -> None:
        self.hub = Hub()
        self.log = log
        self._clock = clock
        self._state = state
        self._on_event = on_event

    def send(self, topic: str, record: Any) -> None:
        """Send a record to all pages."""
        self.hub.send(topic, record)

    def send_state(self) -> None:
        """Send the present state to all pages."""
        self.hub.send("state", self._state())

    def emit(self, event: GroundEvent | StationNote) -> None:
        """Call the caller's function with an event."""
        if self._on_event is not None:
            self._on_event(event)

    def note(self, severity: int, text: str, *, source: str = "ground") -> None:
        """Write a line of a MAVLink severity (4: warning) to the log and to all pages."""
        line = self.log.add(self._clock.now_ns(), severity, text, source)
        self.hub.send("log", line)
        if source == "ground" and severity <= _WARNING:
            self.emit(StationNote(severity, text))
