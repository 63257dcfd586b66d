"""The list of tags being uploaded, and the last complete list on disk."""

from collections.abc import Sequence
from pathlib import Path

from uavrt.config.tags.code_rules import same_codes
from uavrt.config.tags.tag_files import faults_of_tags
from uavrt.core.errors import UavrtError
from uavrt.core.log import get_logger
from uavrt.core.messages import Tag
from uavrt.core.units import counted
from uavrt.flight.kept_file import KeptFile

log = get_logger()

LAST_TAGS_NAME = "last_tags.json"
"""Name of the file with the last complete tag list, with which parameter `DET_RUN` starts."""
_MOST_TAGS = 1000
"""Largest number of tags in a list unless `detection.maximum_tags` is set."""


class TagUpload:
    """Receives the next flight's tag list; methods raise `UavrtError` to refuse a command."""

    def __init__(self, directory: Path) -> None:
        self._last = KeptFile(directory / LAST_TAGS_NAME, tuple[Tag, ...], "last tags")
        self.tags: dict[int, Tag] = {}
        """The received tags by tag number."""
        self.sent = 0
        """Number of tags that the sender announced for this upload; 0 if unknown."""

    def begin(self, tags: Sequence[Tag] = (), sent: int = 0) -> None:
        """Begin a list, or resume an interrupted upload with its `tags` and
        the number `sent`.
        """
        self.tags = {tag.tag_id: tag for tag in tags}
        self.sent = sent

    def add(self, tag: Tag | None, maximum_tags: int | None) -> None:
        """Add a tag; adding an equal tag again has no effect.

        At most `maximum_tags` tags are allowed (None: 1000).
        """
        if tag is None:
            raise UavrtError("the command contains no tag")
        if self.tags.get(tag.tag_id, tag) != tag:
            raise UavrtError(
                f"tag {tag.tag_id} was already sent with other values: send "
                "START_TAGS to begin again"
            )
        check_tag(tag)
        most = maximum_tags or _MOST_TAGS
        if tag.tag_id not in self.tags and len(self.tags) >= most:
            raise UavrtError(
                f"the list has more than {most} tags: send fewer, or raise "
                "detection.maximum_tags"
            )
        self.tags[tag.tag_id] = tag

    def end(self, tag_count: int | None) -> str:
        """End the upload and store a complete list; return a text with its size."""
        if not self.tags:
            raise UavrtError("no tag was sent: send TAG before END_TAGS")
        for one, two in same_codes(tuple(self.tags.values())):
            raise UavrtError(
                f"tags {one.tag_id} and {two.tag_id} have the same code: leave one of them out"
            )
        self.sent = max(self.sent, tag_count or 0)
        if len(self.tags) < self.sent:
            return f"{len(self.tags)} of {self.sent} tags"
        self._last.keep((*self.tags.values(),))
        return counted(len(self.tags), "tag")

    def check_complete(self, tag_count: int | None) -> None:
        """Raise `UavrtError` if fewer tags were received than the sender announced."""
        sent = max(self.sent, tag_count or 0)
        if len(self.tags) < sent:
            raise UavrtError(
                f"only {len(self.tags)} of {sent} tags arrived: send them all again"
            )

    def correct(self, tag: Tag) -> None:
        """Replace the values of a tag, both in the list and in the stored file."""
        self.tags[tag.tag_id] = tag
        self._last.keep(tuple(self.tags.values()))

    def load_last(self, maximum_tags: int | None) -> None:
        """Load the last complete list from the disk."""
        tags = self._last.read() or ()
        if not tags:
            raise UavrtError("no tags stored: send them once with uavrt ground")
        self.begin()
        try:
            for tag in tags:
                self.add(tag, maximum_tags)
        except UavrtError:
            self.begin()
            raise
        log.info("last tags loaded", tags=len(self.tags))


def check_tag(tag: Tag) -> None:
    """Raise `UavrtError` if a tag has values that a tag file may not contain."""
    faults = faults_of_tags([tag])
    if faults:
        raise UavrtError(faults[0])
