"""Settings and task of a process, sent by the supervisor at its start."""

from dataclasses import dataclass, field

from uavrt.config.settings import Settings
from uavrt.messages import FlightInfo, Tag


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """Everything a process needs at its start; its first record."""

    process: str
    """Name of the row, with the worker's number where there are several: ``detector-2``."""
    settings: Settings
    clock_offset_ns: int
    flight: FlightInfo | None
    """The flight in progress, if any."""
    last_flights: tuple[str, ...] = ()
    """Earlier flights' directories, whose pulses may not all have reached the ground."""
    tags: tuple[Tag, ...] = ()
    """The tags this process serves: all, or a worker's share."""
    worker_of_tag: dict[int, int] = field(default_factory=dict)
    """Tag id to detector worker, for the receiver."""
    sample_fds: tuple[int, ...] = ()
    """Datagram sockets: the one where it receives samples, if it does, then one for each
    receiver."""
