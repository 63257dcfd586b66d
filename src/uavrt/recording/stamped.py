"""Remember what was read of flights, and read it again only where their files have changed."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from uavrt.recording.layout import Stamp, stamp_of

T = TypeVar("T")


class Stamped(Generic[T]):
    """What was read of flights, with the state of their files then.

    `read`: reads the flight in a directory.
    `kept`: what was read in an earlier run, by directory.
    """

    def __init__(
        self, read: Callable[[str], T], kept: Mapping[str, tuple[Stamp, T]] | None = None
    ) -> None:
        self._read = read
        self.kept = dict(kept or {})

    def get(self, directory: str) -> T:
        """Get what was read of a flight; raises what `read` raises."""
        stamp = stamp_of(directory)
        found = self.kept.get(directory)
        if found is None or found[0] != stamp:
            found = self.kept[directory] = (stamp, self._read(directory))
        return found[1]
