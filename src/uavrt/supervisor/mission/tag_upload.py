"""The tags that the operator sent, and the last complete list of them on disk."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from uavrt.config.code_rules import same_codes
from uavrt.config.tag_files import faults_of_tags
from uavrt.errors import UavrtError
from uavrt.log import get_logger
from uavrt.messages import Tag
from uavrt.recording.kept_file import KeptFile

log = get_logger()

LAST_TAGS_NAME = "last_tags.json"
"""File of the last tags, for a ground station that cannot send tags (`DET_RUN`)."""
_MOST_TAGS = 1000
"""Most tags of a list, if `detection.maximum_tags` is not set."""


class TagUpload:
    """The list of tags. Its methods raise `UavrtError` with the reason of a refusal."""

    def __init__(self, directory: Path) -> None:
        self._last = KeptFile(directory / LAST_TAGS_NAME, tuple[Tag, ...], "last tags")
        self._tags: dict[int, Tag] = {}
        self.sent = 0
        """Number of tags in this upload by its sender; 0 if not sent."""

    @property
    def tags(self) -> Mapping[int, Tag]:
        """The tags by their numbers."""
        return self._tags

    def begin(self, tags: Sequence[Tag] = (), sent: int = 0) -> None:
        """Begin a list; `tags` and `sent` are those of an upload that goes on."""
        self._tags = {tag.tag_id: tag for tag in tags}
        self.sent = sent

    def add(self, tag: Tag | None, maximum_tags: int | None) -> None:
        """Add a tag; the same one may come again."""
        if tag is None:
            raise UavrtError("the tag is missing")
        if self._tags.get(tag.tag_id, tag) != tag:
            raise UavrtError(f"tag {tag.tag_id} was already sent with other values")
        check_tag(tag)
        most = maximum_tags or _MOST_TAGS
        if tag.tag_id not in self._tags and len(self._tags) >= most:
            raise UavrtError(f"{most} tags are the most: see detection.maximum_tags")
        self._tags[tag.tag_id] = tag

    def end(self, tag_count: int | None) -> str:
        """End the list, which is kept if it is complete; return its size in words."""
        if not self._tags:
            raise UavrtError("no tag was sent: send TAG before END_TAGS")
        for one, two in same_codes(tuple(self._tags.values())):
            raise UavrtError(f"tags {one.tag_id} and {two.tag_id} have the same code")
        self.sent = max(self.sent, tag_count or 0)
        if len(self._tags) < self.sent:
            return f"{len(self._tags)} of {self.sent} tags"
        self._last.keep((*self._tags.values(),))
        return f"{len(self._tags)} tags"

    def check_complete(self, tag_count: int | None) -> None:
        """Refuse to begin with a list whose tags have not all come."""
        sent = max(self.sent, tag_count or 0)
        if len(self._tags) < sent:
            raise UavrtError(f"only {len(self._tags)} of {sent} tags came: send them all again")

    def correct(self, tag: Tag) -> None:
        """Replace a tag's values, also in the list on disk."""
        self._tags[tag.tag_id] = tag
        self._last.keep(tuple(self._tags.values()))

    def take_last(self, maximum_tags: int | None) -> None:
        """Load the tags of the last upload, also before a restart."""
        tags = self._last.read() or ()
        if not tags:
            raise UavrtError("no tags are known: send them once, by uavrt ground")
        self.begin()
        try:
            for tag in tags:
                self.add(tag, maximum_tags)
        except UavrtError:
            self.begin()
            raise
        log.info("last tags", tags=len(self._tags))


def check_tag(tag: Tag) -> None:
    """Refuse, on any wire, what the tag files refuse."""
    faults = faults_of_tags([tag])
    if faults:
        raise UavrtError(faults[0])
