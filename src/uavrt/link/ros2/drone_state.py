"""State of the drone that both directions of the ROS 2 gateway share, and the log on
``rosout``.
"""

from collections.abc import Callable
from dataclasses import dataclass

from uavrt.config.settings import Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import FlightInfo, SystemStatus
from uavrt.link.allowance import Allowance
from uavrt.link.ros2 import ros_records as convert
from uavrt.link.ros2.graph import LOG_TOPIC, START_STOP
from uavrt.link.ros2.network.bus import Bus
from uavrt.link.ros2.types.ros_messages import Log

SOURCE = "ros2"
LOG_LEVELS = (50, 50, 50, 40, 30, 20, 20, 10)
"""Level in ROS 2's ``rosout`` for each MAVLink severity, from 0 (emergency) to 7 (debug)."""


@dataclass(slots=True)
class DroneState:
    """Latest settings, flight and status that the drone's processes have reported."""

    settings: Settings
    flight: FlightInfo | None
    status: SystemStatus | None = None
    status_heard_ns: int = 0

    def is_in(self, state: SystemState) -> bool:
        """True if the drone is in the given state."""
        return self.status is not None and self.status.state is state

    @property
    def running(self) -> bool:
        """True if detection runs and is not being stopped."""
        status = self.status
        return self.is_in(SystemState.DETECTING) and status is not None and not status.ending

    def tag_directory(self, tag_id: int) -> str:
        """Directory of a tag's detector in the flight; empty without a flight."""
        root = self.flight.directory if self.flight is not None else ""
        return f"{root}/detector_log/tag_id_{tag_id}" if root else ""


class RosLog:
    """Writes log lines to ROS 2's topic ``rosout``."""

    def __init__(self, bus: Bus, namespace: str, now_ns: Callable[[], int]) -> None:
        self._bus, self._namespace, self._now_ns = bus, namespace, now_ns
        self._lines_allowed = Allowance(burst=50, per_s=1)
        self.refused = 0
        """Number of messages from ROS 2 that were refused."""

    def write(self, severity: int, text: str, node: str = START_STOP) -> None:
        """Write a log line with a MAVLink severity from 0 to 7."""
        message = Log(
            stamp=convert.time_to_ros(self._now_ns()),
            level=LOG_LEVELS[max(0, min(7, severity))],
            name=".".join([*filter(None, self._namespace.split("/")), node]),
            msg=text,
        )
        self._bus.publish(LOG_TOPIC, message, node)

    def refuse(self, reason: str, node: str = START_STOP) -> None:
        """Count a refused message and log the reason."""
        self.refused += 1
        # A flood must not fill the shared log.
        if self._lines_allowed.take(self._now_ns()):
            self.write(4, reason[:500], node)
