"""Names of a flight's tags, taken from the ground station's tag list.

The thesis's tag message has no name, so a drone's flight records tags by id and frequency. The
ground station keeps the operator's list, ``tags.toml``, in its directory.
"""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import UavrtError
from uavrt.core.messages import Tag

_SAME_HZ = 500.0
"""Largest difference of recorded and listed frequency for the same tag [Hz]."""


def tags_with_names(tags: Iterable[Tag], directory: Path) -> tuple[Tag, ...]:
    """Name unnamed tags by ``tags.toml`` or ``ground/tags.toml`` next to the flight."""
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
