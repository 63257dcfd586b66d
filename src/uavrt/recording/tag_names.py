"""Names of a flight's tags, from the ground station's list.

The thesis's tag message has no name, so a drone's flight knows tags by id and frequency. The
ground station keeps the operator's list in its directory, ``tags.toml``.
"""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from uavrt.config.tag_files import read_tags
from uavrt.errors import UavrtError
from uavrt.messages import Tag

_SAME_HZ = 500.0
"""Largest difference of frequencies [Hz]; beyond it the id now belongs to another tag."""


def tags_with_names(tags: Iterable[Tag], directory: Path) -> tuple[Tag, ...]:
    """Name unnamed tags by the ground station's list in the flight's folder, or ``ground``."""
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
    """The ground station's list; empty without a readable one."""
    above = os.path.dirname(os.path.abspath(directory))
    for path in (f"{above}/tags.toml", f"{above}/ground/tags.toml"):
        if os.path.isfile(path):
            try:
                return read_tags(Path(path))
            except (UavrtError, OSError):
                continue
    return ()
