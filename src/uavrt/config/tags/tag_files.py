"""Read tag files of any format, reporting all faults at once; write two formats."""

import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from uavrt.config.tags.tag_drafts import Entry, Fault, Quantity, TagDraft
from uavrt.config.tags.tag_info import format_tag_info, parse_tag_info
from uavrt.config.tags.tag_lists import is_tag_csv, parse_code_yaml, parse_tag_csv
from uavrt.config.tags.tag_rules import tags_from_drafts
from uavrt.config.tags.tags_toml import format_tags_toml, parse_tags_toml
from uavrt.config.text_files import decode_text
from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import ConfigError, TagFileError, os_errors_as
from uavrt.core.foreign import TAGS, read_file, shortened
from uavrt.core.messages import Tag

_TOML_LINE = re.compile(r"^[ \t]*\[", re.M)


def read_tags(path: str | os.PathLike[str]) -> tuple[Tag, ...]:
    """Read ``TagInfo.txt`` or ``tags.toml``; raises `TagFileError` with all faults."""
    with os_errors_as(
        ConfigError,
        f"cannot read the tag file {os.fspath(path)}",
        "Check the name; docs/reference/tag-files.md shows how a tag file is written",
    ):
        content = read_file(path, TAGS)
    return parse_tags(content, name=os.fspath(path))


def parse_tags(content: bytes, *, name: str) -> tuple[Tag, ...]:
    """Read tags from a file's bytes; `name` appears in messages and helps to select the format.

    A name that ends in ``.toml`` means TOML, one that ends in ``.yaml`` a list of codes. Any
    other file is recognised by a heading of a list, or by a line that begins with ``[``.
    """
    try:
        text = decode_text(content)
    except ValueError as error:
        raise TagFileError(name, [str(error)]) from None
    faults: list[Fault] = []
    drafts = _reader(text, name.lower())(text, faults)
    tags = tags_from_drafts(drafts, faults)
    if faults:
        ordered = sorted(faults, key=lambda fault: fault.line)
        listed = list(dict.fromkeys(str(fault) for fault in ordered))
        raise TagFileError(name, shortened(listed))
    if not tags:
        raise TagFileError(name, ["line 1: this file contains no tag"])
    return tags


def _reader(text: str, name: str) -> Callable[[str, list[Fault]], list[TagDraft]]:
    """Return the function that reads a tag file, selected by the file's name or by a line that
    only one format has.
    """
    if name.endswith((".yaml", ".yml")):
        return parse_code_yaml
    if not name.endswith(".toml") and is_tag_csv(text):
        return parse_tag_csv
    toml = name.endswith(".toml") or _TOML_LINE.search(text) is not None
    return parse_tags_toml if toml else parse_tag_info


def faults_of_tags(tags: Sequence[Tag]) -> list[str]:
    """Check tags that were not read from a file by the rules of tag files; return the faults as
    texts.
    """
    faults: list[Fault] = []
    tags_from_drafts([_draft(tag, place) for place, tag in enumerate(tags)], faults)
    # Report the same fault of a tag only once.
    return list(
        dict.fromkeys(f"tag {tags[fault.line].tag_id}: {fault.text}" for fault in faults)
    )


def _draft(tag: Tag, place: int) -> TagDraft:
    numbers: list[tuple[Quantity, str, float, str]] = [
        ("id", "id", tag.tag_id, ""),
        ("frequency", "frequency", tag.frequency_hz, "Hz"),
        ("interval", "interval_ms", 1e3 * tag.pulse_intervals_s[0], ""),
        ("pulse_width", "pulse_width_ms", 1e3 * tag.pulse_width_s, ""),
        (
            "interval_uncertainty",
            "interval_uncertainty_ms",
            1e3 * tag.interval_uncertainty_s,
            "",
        ),
        ("interval_jitter", "interval_jitter_ms", 1e3 * tag.interval_jitter_s, ""),
        ("k", "k", tag.k, ""),
        ("false_alarm_probability", "false_alarm_probability", tag.false_alarm_probability, ""),
        ("frequency_slide", "frequency_slide_hz", tag.frequency_slide_hz, ""),
    ]
    numbers += [
        ("second_interval", "second_interval_ms", 1e3 * interval_s, "")
        for interval_s in tag.pulse_intervals_s[1:2]
    ]
    entries = {
        quantity: Entry(
            number=number, label=f"{name} {number:.10g} {unit}".rstrip(), line=place, unit=unit
        )
        for quantity, name, number, unit in numbers
    }
    gaps = [Entry(number=1e3 * gap, label="gaps_ms", line=place) for gap in tag.gaps_s]
    return TagDraft(
        line=place, entries=entries, name=tag.name, gaps=tuple(gaps) if gaps else None
    )


def check_tag_file_name(path: str | os.PathLike[str]) -> None:
    """Raise `ConfigError` if a tag file's name ends neither in ``.toml`` nor in ``.txt``."""
    target = Path(path)
    if target.name.lower() == "detectorconfig.txt":
        raise ConfigError(
            f"uavrt does not write {target}, a file of the original detector",
            remedy="Choose a name that ends in .toml, or TagInfo.txt. uavrt writes "
            "detectorConfig.txt only into flight directories, one for each tag",
        )
    if target.suffix.lower() not in (".toml", ".txt"):
        raise ConfigError(
            f"{target} ends in neither .toml nor .txt, so its format is unknown",
            remedy="Choose a name that ends in .toml, or in .txt for the TagInfo format "
            "of the original UAV-RT",
        )


def tags_as_text(tags: Sequence[Tag], suffix: str) -> str:
    """Format tags as ``tags.toml`` or ``TagInfo.txt``, depending on `suffix`. Raises
    `ConfigError` if ``TagInfo.txt`` cannot hold them.
    """
    if suffix.lower() == ".toml":
        return format_tags_toml(tags)
    remedy = "Write a file whose name ends in .toml"
    if sliding := [tag.tag_id for tag in tags if tag.frequency_slide_hz]:
        raise ConfigError(
            f"TagInfo.txt has no column for a frequency slide (tags {sliding})", remedy=remedy
        )
    if double := [tag.tag_id for tag in tags if len(tag.pulse_intervals_s) > 1]:
        raise ConfigError(
            f"TagInfo.txt has no column for a second interval (tags {double})", remedy=remedy
        )
    if coded := [tag.tag_id for tag in tags if tag.coded]:
        raise ConfigError(
            f"TagInfo.txt has no columns for coded tags (tags {coded})", remedy=remedy
        )
    return format_tag_info(tags)


def write_tags(path: str | os.PathLike[str], tags: Sequence[Tag]) -> None:
    """Write ``tags.toml`` or ``TagInfo.txt``, depending on the name; raises `ConfigError`."""
    check_tag_file_name(path)
    target = Path(path)
    text = tags_as_text(tags, target.suffix)
    with os_errors_as(
        ConfigError,
        f"cannot write the tag file {target}",
        "Choose a directory that exists and can be written",
    ):
        write_atomically(target, text)
