"""Read tags and search settings from any kind of file that describes tags."""

import os
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import FormatError
from uavrt.core.messages import Tag
from uavrt.detection.modes import OperatingMode
from uavrt.dsp.plan import widest_half_span_hz
from uavrt.flight.logs.detector_configs import read_detector_config

_KEYS_OF_ITS_OWN = re.compile(rb"(?:^|[\r\n])[ \t]*(?:tagFreqMHz|channelCenterFreqMHz)[ \t]*:")


@dataclass(frozen=True, slots=True, kw_only=True)
class TagSource:
    """Tags to search for, with the search settings that their file contains."""

    tags: tuple[Tag, ...]
    operating_modes: dict[int, OperatingMode] = field(default_factory=dict)
    """Detector mode by tag id; others use soft lock, which searches the whole window."""
    excluded_hz: tuple[tuple[float, float], ...] = ()
    """Absolute frequency ranges in which no pulse is reported [Hz]."""
    sample_rate_hz: float | None = None
    """Sample rate of the tag's channel [Hz], if the file states it."""
    center_frequency_hz: float | None = None
    """Centre frequency of the tag's channel [Hz], if the file states it."""

    def within(self, sample_rate_hz: float, center_frequency_hz: float) -> "TagSource":
        """Copy with the tags inside a recording's band; all tags if none is inside."""
        reach_hz = widest_half_span_hz(sample_rate_hz)
        inside = tuple(
            tag for tag in self.tags if abs(tag.frequency_hz - center_frequency_hz) <= reach_hz
        )
        return replace(self, tags=inside or self.tags)


def read_tag_source(path: str | os.PathLike[str]) -> TagSource:
    """Read tags and settings from TagInfo.txt, tags.toml, or a detectorConfig.txt."""
    if not _is_detector_config(Path(path)):
        return TagSource(tags=read_tags(path))
    config = read_detector_config(path)
    try:
        mode = OperatingMode(config.operating_mode)
    except ValueError:
        raise FormatError(
            f"{os.fspath(path)}: opMode {config.operating_mode!r} is unknown",
            remedy=f"Choose from {', '.join(OperatingMode)}",
        ) from None
    center_hz = config.channel_center_frequency_hz
    return TagSource(
        tags=(config.tag,),
        operating_modes={config.tag.tag_id: mode},
        excluded_hz=tuple(
            (low + center_hz, high + center_hz) for low, high in config.excluded_hz
        ),
        sample_rate_hz=config.sample_rate_hz,
        center_frequency_hz=center_hz,
    )


def _is_detector_config(path: Path) -> bool:
    """True if a file can be read and has the keys of a detectorConfig.txt."""
    try:
        with path.open("rb") as file:
            return _KEYS_OF_ITS_OWN.search(file.read(65_536)) is not None
    except OSError:
        return False
