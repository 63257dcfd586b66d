"""Limit the disk space for recorded channels of all flights; the oldest files are removed."""

from collections import deque
from pathlib import Path

from uavrt.core.log import get_logger
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order

log = get_logger()


class ChannelBudget:
    """Recorded channel files on the disk, oldest first, and their total size.

    Files of other flights that the user has starred (protected) are neither counted nor
    removed.
    """

    def __init__(self, flight: Path, most_bytes: float) -> None:
        self._flight = flight
        self._most_bytes = most_bytes
        self._pieces: deque[tuple[Path, int]] = deque()
        """Closed channel files, each with the path of the samples and the size [bytes]."""
        self.bytes = 0
        """Total size of all channel files, open ones included [bytes]."""
        self.removed_pieces = 0

    def find_files(self) -> None:
        """Find the channel files of earlier flights, and of this one before a restart."""
        found = sorted(self._found())
        self._pieces = deque((path, size) for _, _, path, size in found)
        self.bytes = sum(size for *_, size in found)

    def _found(self) -> list[tuple[int, int, Path, int]]:
        """List channel files: flight's number, modification time [ns], path, size [bytes]."""
        found = []
        flights = [
            path for path in flights_in_order(self._flight.parent) if path != self._flight
        ]
        for number, flight in enumerate((*flights, self._flight)):
            if flight != self._flight and FlightLayout(flight).star.exists():
                continue
            for path in FlightLayout(flight).channels_directory.glob("*.sigmf-data"):
                try:
                    about = path.stat()
                except OSError:  # removed just now
                    continue
                found.append((number, about.st_mtime_ns, path, about.st_size))
        return found

    def closed(self, path: Path, size: int) -> None:
        """Mark a complete channel file as removable; its size is already in the total."""
        self._pieces.append((path, size))

    def make_room(self, more: int) -> bool:
        """Remove the oldest files until `more` bytes fit, and reserve them; else False."""
        while self.bytes + more > self._most_bytes and self._pieces:
            self._remove(*self._pieces.popleft())
        if self.bytes + more > self._most_bytes:
            return False
        self.bytes += more
        return True

    def return_bytes(self, unused: int) -> None:
        """Subtract reserved bytes that were not written."""
        self.bytes -= unused

    def _remove(self, path: Path, size: int) -> None:
        flight = path.parents[2]
        self.bytes -= size
        if flight != self._flight and FlightLayout(flight).star.exists():
            return  # starred since
        try:
            # Metadata first: without it, samples are found again and removed.
            path.with_suffix(".sigmf-meta").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        except OSError as error:
            log.warning("cannot remove old channel samples", file=str(path), reason=str(error))
            return
        self.removed_pieces += 1
