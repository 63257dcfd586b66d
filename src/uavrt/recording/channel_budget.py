"""How much the kept channels of all flights may take: a ring, the oldest pieces go first."""

from collections import deque
from pathlib import Path

from uavrt.log import get_logger
from uavrt.recording.flight_order import flights_in_order
from uavrt.recording.layout import FlightLayout

log = get_logger()


class ChannelBudget:
    """The pieces of channels that are on the disk, oldest first.

    Those of starred flights are neither counted nor removed, but for the flight's own.

    `flight`: the flight that is being recorded; the others lie beside it.
    `most_bytes`: what all of them may take.
    """

    def __init__(self, flight: Path, most_bytes: float) -> None:
        self._flight = flight
        self._most_bytes = most_bytes
        self._pieces: deque[tuple[Path, int]] = deque()
        """Closed ones: the file of samples and its size."""
        self.bytes = 0
        """What they take, with those that are being written."""
        self.removed_pieces = 0
        self.removed_bytes = 0

    def look(self) -> None:
        """Find what earlier flights, and this one before a restart, have left."""
        found = sorted(self._found())
        self._pieces = deque((path, size) for _, _, path, size in found)
        self.bytes = sum(size for *_, size in found)

    def _found(self) -> list[tuple[int, int, Path, int]]:
        """Place of the flight among all, time of the last change, file and size."""
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
        """Count a piece as one that may go; its bytes have been counted as they came."""
        self._pieces.append((path, size))

    def make_room(self, more: int) -> bool:
        """Remove the oldest pieces until there is room for `more` bytes, and count it as taken.

        False if there is none.
        """
        while self.bytes + more > self._most_bytes and self._pieces:
            self._remove(*self._pieces.popleft())
        if self.bytes + more > self._most_bytes:
            return False
        self.bytes += more
        return True

    def give_back(self, unused: int) -> None:
        """Take back room that was not used."""
        self.bytes -= unused

    def _remove(self, path: Path, size: int) -> None:
        flight = path.parents[2]
        self.bytes -= size
        if flight != self._flight and FlightLayout(flight).star.exists():
            return  # starred since
        try:
            # In this order: what describes nothing is not found again, samples are.
            path.with_suffix(".sigmf-meta").unlink(missing_ok=True)
            path.unlink(missing_ok=True)
        except OSError as error:
            log.warning("samples not removed", file=str(path), reason=str(error))
            return
        self.removed_pieces += 1
        self.removed_bytes += size
