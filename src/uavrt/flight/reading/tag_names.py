"""Read the names of a flight's tags from the ground station's tag list.

The thesis's tag message contains no name, so the drone's flight records only ids and
frequencies of tags. The ground station stores the operator's list, ``tags.toml``, in its
directory.
"""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Tag

_SAME_HZ = 500.0
"""Maximum difference between the recorded and the listed frequency of one tag [Hz]."""


def tags_with_names(tags: Iterable[Tag], directory: Path) -> tuple[Tag, ...]:
    """Name unnamed tags according to ``tags.toml`` or ``ground/tags.toml`` next to a flight."""
    listed = tuple(tags)
    if all(tag.name for tag in listed):
        return listed
    known = {tag.tag_id: tag for tag in _near(directory) if tag.name}
    return tuple(tag if tag.name else _named(tag, known) for tag in listed)


def _named(tag: Tag, known: dict[int, Tag]) -> Tag:
    other = known.get(tag.tag_id)
    if other is None or abs(other.frequency_hz - tag.frequency_hz) > _SAME_HZ:
        return tag
    return replace(tag, name=other.name)


def _near(directory: Path) -> tuple[Tag, ...]:
    """Tags in ``tags.toml`` or ``ground/tags.toml`` next to a flight; empty if unreadable."""
    above = os.path.dirname(os.path.abspath(directory))
    for path in (f"{above}/tags.toml", f"{above}/ground/tags.toml"):
        if os.path.isfile(path):
            try:
                return read_tags(Path(path))
            except (UavrtError, OSError):
                continue
    return ()
