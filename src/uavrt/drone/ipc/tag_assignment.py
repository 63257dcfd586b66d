"""Settings and task of a process, sent by the supervisor at its start."""

from dataclasses import dataclass, field

from uavrt.config.settings import Settings
from uavrt.core.messages import FlightInfo, Tag


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """First record that a process receives: its settings, clock, tags and sockets."""

    process: str
    """Name of the process; a detector worker's name ends with its number: ``detector-2``."""
    settings: Settings
    clock_offset_ns: int
    flight: FlightInfo | None
    """The flight in progress; None if there is none."""
    last_flights: tuple[str, ...] = ()
    """Directories of earlier flights with pulses that may not have reached the ground."""
    tags: tuple[Tag, ...] = ()
    """Tags that the process handles: all tags, or the share of one detector worker."""
    worker_of_tag: dict[int, int] = field(default_factory=dict)
    """For the receiver: number of the detector worker that searches each tag, by tag id."""
    sample_fds: tuple[int, ...] = ()
    """File descriptors of sample sockets: a receiving end, if any, then a sending end per
    detector."""
