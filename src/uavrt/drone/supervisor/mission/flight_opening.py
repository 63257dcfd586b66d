"""Create a flight's directory and assign tags to detector processes."""

import itertools
import math
from collections.abc import Sequence
from pathlib import Path

from uavrt.config.ghost_places import Receiver
from uavrt.config.settings import Settings
from uavrt.config.tags.tag_bands import tags_by_band
from uavrt.core.clock import Clock, flight_stamp
from uavrt.core.errors import RecordingError
from uavrt.core.messages import FlightInfo, Tag

_CHEAP_SHARE_TAGS = 16
"""Number of tags that one detector process may get even if another gets none; they use 2 % of a
core."""


def share_tags(
    tags: Sequence[Tag], workers: int, *, window_hz: float, receiver: Receiver | None = None
) -> tuple[tuple[Tag, ...], ...]:
    """Distribute the tags evenly over the detector processes.

    Tags with overlapping bands must be compared, because they may show the same pulse; one
    process gets them all. Tags that may be spurious signals of each other in the receiver are
    kept together too, up to an equal share or 16 tags.
    """
    together = tags_by_band(tags, window_hz)
    if receiver is not None and workers > 1:
        most = max(_CHEAP_SHARE_TAGS, math.ceil(len(tags) / workers))
        together = _with_ghosts(together, receiver, window_hz, most)
    shares: list[list[Tag]] = [[] for _ in range(max(1, min(workers, len(together))))]
    for some in together:
        min(shares, key=len).extend(some)
    return tuple(tuple(share) for share in shares)


def _with_ghosts(
    together: list[list[Tag]], receiver: Receiver, window_hz: float, most: int
) -> list[list[Tag]]:
    """Join groups whose tags may be spurious signals of each other, up to `most` tags."""
    group_of = {tag.tag_id: group for group in together for tag in group}
    multiples = (
        (receiver.multiple(ghost.frequency_hz, tag.frequency_hz, window_hz), tag, ghost)
        for tag in itertools.chain(*together)
        for ghost in itertools.chain(*together)
        if group_of[tag.tag_id] is not group_of[ghost.tag_id]
    )
    pairs = [(abs(multiple), tag, ghost) for multiple, tag, ghost in multiples if multiple]
    for _, tag, ghost in sorted(pairs, key=lambda pair: pair[0]):
        one, other = group_of[tag.tag_id], group_of[ghost.tag_id]
        if one is not other and len(one) + len(other) <= most:
            joined = [*one, *other]
            group_of |= {each.tag_id: joined for each in joined}
    found = {id(group): group for group in group_of.values()}
    return sorted(found.values(), key=lambda group: -len(group))


def new_flight(
    settings: Settings,
    tags: tuple[Tag, ...],
    clock: Clock,
    *,
    center_frequency_hz: float,
    capture_s: float | None = None,
) -> FlightInfo:
    """Create a directory for a flight or raw capture (`capture_s`); return its description."""
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
    """Return when a flight's files were last changed [ns, wall clock]; None without files."""
    times = [path.stat().st_mtime_ns for path in directory.glob("*") if path.is_file()]
    return max(times, default=None)


def _make_directory(parent: Path, start_ns: int) -> Path:
    """Create ``flight_log_<UTC>``; if it exists, append a number to the name."""
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
                remedy="Free some space, or set recording.directory to a writable path",
            ) from error
        return directory
    raise RecordingError(
        f"{parent} has 99 flights that began in the same second",
        remedy="Wait a second, then start again",
    )
