"""Cache values read from flights until the flights' files change."""

from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from uavrt.flight.flight_layout import Stamp, stamp_of

T = TypeVar("T")


class FlightCache(Generic[T]):
    """Cache of a value for each flight, which is valid until the flight's files change."""

    def __init__(
        self, read: Callable[[str], T], kept: Mapping[str, tuple[Stamp, T]] | None = None
    ) -> None:
        self._read = read
        self.kept = dict(kept or {})

    def get(self, directory: str) -> T:
        """Value of a flight; it is read again only if the flight's files have changed.

        Raises the errors of the function `read`.
        """
        stamp = stamp_of(directory)
        found = self.kept.get(directory)
        if found is None or found[0] != stamp:
            found = self.kept[directory] = (stamp, self._read(directory))
        return found[1]
