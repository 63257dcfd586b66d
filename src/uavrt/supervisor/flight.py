"""Opening a flight: its directory, and which worker has which tag."""

from pathlib import Path

from uavrt.clock import Clock, flight_stamp
from uavrt.config.settings import Settings
from uavrt.errors import RecordingError
from uavrt.messages import FlightInfo, Tag


def share_tags(tags: tuple[Tag, ...], workers: int) -> tuple[tuple[Tag, ...], ...]:
    """Deal the tags out to the workers in turn; every worker gets at least one if it can."""
    return tuple(tags[worker::workers] for worker in range(workers))


def new_flight(
    settings: Settings,
    tags: tuple[Tag, ...],
    clock: Clock,
    *,
    center_frequency_hz: float,
    capture_s: float | None = None,
) -> FlightInfo:
    """Make the flight's directory; with `capture_s` it is a raw capture.

    Raises
    ------
    RecordingError
        The directory cannot be made.
    """
    start_ns = clock.now_ns()
    return FlightInfo(
        directory=str(_make_directory(Path(settings.recording.directory), start_ns)),
        start_time_ns=start_ns,
        clock_offset_ns=clock.offset_ns,
        center_frequency_hz=center_frequency_hz,
        sample_rate_hz=settings.radio.sample_rate_hz,
        tags=tags,
        capture_s=capture_s,
    )


def last_written_ns(directory: Path) -> int | None:
    """Get when a flight was written to last [ns, wall clock], None without one."""
    times = [path.stat().st_mtime_ns for path in directory.glob("*") if path.is_file()]
    return max(times, default=None)


def _make_directory(parent: Path, start_ns: int) -> Path:
    """Make ``flight_log_<UTC>``; two flights in one second get a number."""
    for attempt in range(1, 100):
        suffix = "" if attempt == 1 else f"_{attempt}"
        directory = parent.resolve() / f"flight_log_{flight_stamp(start_ns)}{suffix}"
        try:
            directory.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise RecordingError(
                f"cannot make {directory}: {error.strerror}",
                remedy="Free some space, or set recording.directory to a writable place",
            ) from error
        return directory
    raise RecordingError(f"cannot make a new flight directory in {parent}")
