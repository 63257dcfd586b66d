"""Names of tags that the drone was never told: those of the ground station's list.

The list that goes to the drone has numbers alone (the thesis's tag message has no room for a
name), so a flight as the drone recorded it knows its tags by id and frequency. The ground
station keeps the operator's list in its directory, ``tags.toml``.
"""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from uavrt.config.tag_files import read_tags
from uavrt.errors import UavrtError
from uavrt.messages import Tag

_SAME_HZ = 500.0
"""A list in which an id has since been given to another tag names nothing."""


def tags_with_names(tags: Iterable[Tag], directory: Path) -> tuple[Tag, ...]:
    """Name tags without a name as the ground station's list near their flight does.

    `tags`: as the flight has them.
    `directory`: of the flight: the list is beside it, or in ``ground`` beside it.
    """
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
    """The list that the ground station keeps; none where there is none that can be read."""
    above = os.path.dirname(os.path.abspath(directory))
    for path in (f"{above}/tags.toml", f"{above}/ground/tags.toml"):
        if os.path.isfile(path):
            try:
                return read_tags(Path(path))
            except (UavrtError, OSError):
                continue
    return ()
