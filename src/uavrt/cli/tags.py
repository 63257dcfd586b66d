"""``uavrt tags``: check a tag file, or write it in the other format."""

from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import App

from uavrt.errors import ConfigError

if TYPE_CHECKING:
    from uavrt.messages import Tag

tags = App(name="tags", help="Check and convert tag files (TagInfo.txt, tags.toml).")


@tags.command
def check(file: Path) -> None:
    """Say what a tag file holds, or everything that is wrong with it.

    Parameters
    ----------
    file
        A TagInfo.txt or tags.toml.
    """
    from uavrt.config.tag_files import read_tags

    found = read_tags(file)
    for tag in found:
        print(_sentence(tag))
    print(f"{file}: {len(found)} tag(s), no fault")


@tags.command
def convert(source: Path, target: Path, *, overwrite: bool = False) -> None:
    """Write the tags of one file in the format of another; the name tells: .toml or .txt.

    Parameters
    ----------
    source
        A tag file.
    target
        The file to write.
    overwrite
        Replace the target if it exists.
    """
    from uavrt.config.tag_files import read_tags, write_tags

    found = read_tags(source)
    if target.exists() and not overwrite:
        raise ConfigError(
            f"{target} exists already", remedy="Choose another name, or add --overwrite"
        )
    write_tags(target, found)
    named = sum(tag.name is not None for tag in found)
    print(f"{target}: {len(found)} tag(s) written")
    if named and target.suffix.lower() != ".toml":
        print(f"The names of {named} tag(s) are left out: TagInfo.txt has no place for them")


def _sentence(tag: "Tag") -> str:
    intervals = " and ".join(f"{interval * 1000:.10g}" for interval in tag.pulse_intervals_s)
    name = "" if tag.name is None else f" {tag.name}"
    return (
        f"tag {tag.tag_id}{name}: {tag.frequency_hz / 1e6:.6f} MHz, "
        f"{tag.pulse_width_s * 1000:.10g} ms every {intervals} ms "
        f"(± {tag.interval_uncertainty_s * 1000:.10g} ms, "
        f"jitter {tag.interval_jitter_s * 1000:.10g} ms), K = {tag.k}, "
        f"false alarms {tag.false_alarm_probability * 100:.10g} %"
    )
