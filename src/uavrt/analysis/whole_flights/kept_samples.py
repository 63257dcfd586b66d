"""Find the radio channels that a flight recorded, and read each tag's samples from them."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from uavrt.analysis.whole_flights.judged_flights import (
    IntegratedTag,
    WholeFlightOptions,
    integrate_flight,
)
from uavrt.core.errors import FormatError, RecordingError, UsageError
from uavrt.core.messages import Tag
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.reading.flight_reader import Flight
from uavrt.radio.files.joined import JoinedRecording
from uavrt.radio.files.sigmf import sigmf_layout


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptChannel:
    """One radio channel that a flight recorded; it may be split into several files."""

    center_frequency_hz: float
    sample_rate_hz: float
    paths: tuple[Path, ...]
    """SigMF metadata files of the parts of a recorded channel, ordered by name."""
    samples: int
    bytes: int

    @property
    def length_s(self) -> float:
        """Duration of the recorded samples [s]."""
        return self.samples / self.sample_rate_hz

    def holds(self, tag: Tag) -> bool:
        """True if a tag's frequency lies inside the channel."""
        return abs(tag.frequency_hz - self.center_frequency_hz) < self.sample_rate_hz / 2


def kept_channels(
    flight: Path, on_fault: Callable[[str], None] | None = None
) -> tuple[KeptChannel, ...]:
    """Return the recorded channels of a flight, in order of frequency; `on_fault` is called
    with faults of files.
    """
    found: dict[tuple[float, float], list[tuple[Path, int, int]]] = {}
    for path in sorted(FlightLayout(flight).channels_directory.glob("*.sigmf-meta")):
        try:
            layout = sigmf_layout(path)
        except FormatError as error:
            if on_fault is not None:
                on_fault(error.message)
            continue
        key = (layout.center_frequency_hz, layout.sample_rate_hz)
        count = sum(segment.count for segment in layout.segments)
        size = count * layout.sample_format.bytes_per_sample
        found.setdefault(key, []).append((path, count, size))
    return tuple(
        KeptChannel(
            center_frequency_hz=center_hz,
            sample_rate_hz=rate_hz,
            paths=tuple(path for path, _, _ in pieces),
            samples=sum(count for _, count, _ in pieces),
            bytes=sum(size for _, _, size in pieces),
        )
        for (center_hz, rate_hz), pieces in sorted(found.items())
        if any(count for _, count, _ in pieces)
    )


def channel_of(channels: Iterable[KeptChannel], tag: Tag) -> KeptChannel | None:
    """Recorded channel nearest to a tag's frequency; None if no channel contains it."""
    holding = [one for one in channels if one.holds(tag)]
    return min(
        holding, key=lambda one: abs(tag.frequency_hz - one.center_frequency_hz), default=None
    )


def integrate_kept(
    flight: Flight, tags: Sequence[Tag], how: WholeFlightOptions
) -> list[IntegratedTag]:
    """Search a whole flight for each tag, in the channels that it recorded. Missing samples
    between files are gaps; unreadable files are listed as limitations.
    """
    unread: list[str] = []
    channels = kept_channels(Path(flight.info.directory), unread.append)
    channel_of_tag = {tag.tag_id: channel_of(channels, tag) for tag in tags}
    without = [tag for tag in tags if channel_of_tag[tag.tag_id] is None]
    if without:
        none = (
            f"{flight.info.directory} has no samples of tag {without[0].tag_id} at "
            f"{without[0].frequency_hz / 1e6:.4f} MHz"
        )
        raise RecordingError(
            "; ".join((none, *left_out_in_words(unread))),
            remedy="Name a recording with --recording, or give --tag only tags of this flight",
        )
    results: dict[int, IntegratedTag] = {}
    for channel in channels:
        some = [tag for tag in tags if channel_of_tag[tag.tag_id] is channel]
        if not some:
            continue
        with closing(JoinedRecording(channel.paths)) as source:
            try:
                done = _further(how.on_tag, len(results))
                judged = integrate_flight(flight, source, some, replace(how, on_tag=done))
            except (RecordingError, UsageError) as error:
                faults = left_out_in_words((*unread, *source.left_out))
                if not faults:
                    raise
                raise type(error)(
                    "; ".join((error.message, *faults)), remedy=error.remedy
                ) from error
            faults = left_out_in_words((*unread, *source.left_out))
        results |= {
            one.tag.tag_id: replace(one, limitations=(*one.limitations, *faults))
            for one in judged
        }
    return [results[tag.tag_id] for tag in tags]


def left_out_in_words(faults: Iterable[str]) -> tuple[str, ...]:
    """Sentences on unreadable files, each only once."""
    return tuple(
        f"part of the recorded samples was left out: {fault}" for fault in dict.fromkeys(faults)
    )


def _further(on_tag: Callable[[int], None] | None, before: int) -> Callable[[int], None] | None:
    """Return a progress callback that adds `before`, the number of tags finished in earlier
    channels.
    """
    return None if on_tag is None else lambda done: on_tag(before + done)
