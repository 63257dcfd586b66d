"""What the parts of a ground session use of it; `uavrt.ground.session.GroundSession` has it."""

from dataclasses import dataclass
from typing import Protocol

from uavrt.clock import Clock
from uavrt.commands import SystemState
from uavrt.ground.link.actions import Busy, Situation
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.vehicle import VehicleWatch
from uavrt.ground.listeners import Hub
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.settings import GroundStore
from uavrt.messages import Beep, Tag
from uavrt.recording.places import Mark


@dataclass(frozen=True, slots=True)
class StationNote:
    """What the ground station itself says to the operator, for one without a page."""

    severity: int
    text: str


class HeldSession(Protocol):
    """One vehicle: its link, its state, and the flight that is recorded of it."""

    clock: Clock
    store: GroundStore
    hub: Hub
    flight: FlightKeeper
    link: GroundLink | None
    vehicle: VehicleWatch | None
    state: SystemState | None
    busy: Busy | None
    sent_tags: tuple[Tag, ...]
    marks: list[Mark]
    beeps: list[Beep]
    drone_directory: str

    def situation(self) -> Situation:
        """Get what decides which buttons are enabled."""

    def note(self, severity: int, text: str) -> None:
        """Write a line into the event log, and show it."""

    def tags_changed(self) -> None:
        """Show the tag table to all listeners."""

    def send_state(self) -> None:
        """Show the state to every listener."""

    def begin_flight(self) -> None:
        """Begin the ground's own flight."""

    def commit_soon(self) -> None:
        """Write soon what has come."""
