"""Tag files: read either format with all its faults at once, write either."""

import os
import re
from collections.abc import Sequence
from pathlib import Path

from uavrt.config.tag_info import format_tag_info, parse_tag_info
from uavrt.config.tag_rules import Fault, tags_from_drafts
from uavrt.config.tags_toml import format_tags_toml, parse_tags_toml
from uavrt.config.text_files import decode_text, write_text_atomically
from uavrt.errors import ConfigError, TagFileError
from uavrt.messages import Tag

_TOML_LINE = re.compile(r"^\s*\[", re.M)


def read_tags(path: str | os.PathLike[str]) -> tuple[Tag, ...]:
    """Read the tags of a ``TagInfo.txt`` or ``tags.toml``.

    Raises
    ------
    TagFileError
        The file has faults; all are listed, each with its line. Its writer mends them.
    ConfigError
        There is no such file, or it cannot be read.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise ConfigError(
            f"cannot read the tag file {os.fspath(path)}: {error.strerror}",
            remedy="Check the name; `uavrt tags --help` shows how a tag file is made",
        ) from error
    return parse_tags(content, name=os.fspath(path))


def parse_tags(content: bytes, *, name: str) -> tuple[Tag, ...]:
    """Read tags from a file's bytes; `name` is for messages and tells the format.

    A name that ends in ``.toml`` is TOML; in another file a line that begins with ``[`` tells.

    Raises
    ------
    TagFileError
        The file has faults.
    """
    try:
        text = decode_text(content)
    except ValueError as error:
        raise TagFileError(name, [str(error)]) from None
    faults: list[Fault] = []
    toml = name.lower().endswith(".toml") or _TOML_LINE.search(text) is not None
    drafts = parse_tags_toml(text, faults) if toml else parse_tag_info(text, faults)
    tags = tags_from_drafts(drafts, faults)
    if faults:
        ordered = sorted(faults, key=lambda fault: fault.line)
        raise TagFileError(name, list(dict.fromkeys(str(fault) for fault in ordered)))
    if not tags:
        raise TagFileError(name, ["line 1: there is no tag in this file"])
    return tags


def write_tags(path: str | os.PathLike[str], tags: Sequence[Tag]) -> None:
    """Write tags: as ``tags.toml`` when the name ends in ``.toml``, else as ``TagInfo.txt``.

    Raises
    ------
    ConfigError
        ``TagInfo.txt`` cannot hold a tag with two intervals, or the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() == ".toml":
        text = format_tags_toml(tags)
    else:
        double = [tag.tag_id for tag in tags if len(tag.pulse_intervals_s) > 1]
        if double:
            raise ConfigError(
                f"TagInfo.txt has no column for a second interval (tags {double})",
                remedy="Write a file whose name ends in .toml",
            )
        text = format_tag_info(tags)
    try:
        write_text_atomically(target, text)
    except OSError as error:
        raise ConfigError(
            f"cannot write the tag file {target}: {error.strerror}",
            remedy="Choose a directory that exists and can be written",
        ) from error
