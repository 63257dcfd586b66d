"""Settings and task of a process, sent by the supervisor at its start."""

from dataclasses import dataclass, field

from uavrt.config.settings import Settings
from uavrt.core.messages import FlightInfo, Tag


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """Settings, clock and task of a process: the first record that it receives."""

    process: str
    """Name of the process, with a number if there are several workers: ``detector-2``."""
    settings: Settings
    clock_offset_ns: int
    flight: FlightInfo | None
    """The flight in progress; None if there is none."""
    last_flights: tuple[str, ...] = ()
    """Directories of earlier flights with pulses that may not have reached the ground."""
    tags: tuple[Tag, ...] = ()
    """Tags that this process serves: all, or this detector worker's share."""
    worker_of_tag: dict[int, int] = field(default_factory=dict)
    """Number of each tag's detector worker by tag id, for the receiver."""
    sample_fds: tuple[int, ...] = ()
    """Descriptors of sample sockets: the receiving one, if any, then one for each detector."""
