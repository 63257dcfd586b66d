"""Ring buffer of samples whose times strictly increase."""

from array import array
from bisect import bisect_left
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class Timed(Protocol):
    """Interface of a record that has a time."""

    @property
    def time_ns(self) -> int:
        """Time of the record [ns, UTC]."""
        ...


S = TypeVar("S", bound=Timed)
Four = tuple[float, float, float, float]

REBOOT_NS = 500_000_000
"""Step back in time that indicates a restarted clock and not a late message [ns]. At 10 Hz and
over a link of 57 600 baud, messages are late by tens of milliseconds, never by half a
second."""


class Series(Generic[S]):
    """Stores samples in order of time; when it is full, the oldest are removed first.

    Samples are stored as numbers in memory that is allocated at the start, 40 bytes each (330
    bytes as records), so that memory does not grow in flight. `pack` converts a sample to its
    four numbers, and `unpack` converts a time and four numbers to a sample.
    """

    def __init__(
        self, capacity: int, pack: Callable[[S], Four], unpack: Callable[[int, Four], S]
    ) -> None:
        self._capacity = capacity
        self._pack, self._unpack = pack, unpack
        # A quarter more: removing the first sample moves all others, so it is done in batches.
        self._room = capacity + capacity // 4 + 1
        self._times = array("q", bytes(8 * self._room))
        self._values = array("d", bytes(32 * self._room))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, sample: S) -> bool:
        """Append a sample; return False if it is late. Raises `OverflowError` after a reset of
        the clock.
        """
        time_ns = sample.time_ns
        if self._count:
            fall_ns = self._times[self._count - 1] - time_ns
            if fall_ns >= REBOOT_NS:
                raise OverflowError(f"the clock of the poses was set back by {fall_ns} ns")
            if fall_ns >= 0:
                return False
        if self._count == self._room:
            self._drop_oldest(self._room - self._capacity + 1)
        number = self._count
        self._times[number] = time_ns
        self._values[4 * number : 4 * number + 4] = array("d", self._pack(sample))
        self._count += 1
        return True

    def _drop_oldest(self, surplus: int) -> None:
        self._count -= surplus
        self._times[: self._count] = self._times[surplus:]
        self._values[: 4 * self._count] = self._values[4 * surplus :]

    def clear(self) -> None:
        """Remove all samples from the buffer."""
        self._count = 0

    def _sample(self, index: int) -> S:
        a, b, c, d = self._values[4 * index : 4 * index + 4]
        return self._unpack(self._times[index], (a, b, c, d))

    def _index_from(self, time_ns: int) -> int:
        """Index of the first sample at or after a time."""
        return bisect_left(self._times, time_ns, 0, self._count)

    @property
    def first_ns(self) -> int | None:
        """Time of the oldest sample [ns]; None if empty."""
        return self._times[0] if self._count else None

    @property
    def last_ns(self) -> int | None:
        """Time of the newest sample [ns]; None if empty."""
        return self._times[self._count - 1] if self._count else None

    def bracket(self, time_ns: int) -> tuple[S, S] | None:
        """Return the samples before and after a time, or twice the sample at exactly this time;
        None outside the series.
        """
        index = self._index_from(time_ns)
        if index == self._count:
            return None
        if self._times[index] == time_ns:
            sample = self._sample(index)
            return sample, sample
        if index == 0:
            return None
        return self._sample(index - 1), self._sample(index)

    def first(self) -> S:
        """Oldest sample of a series that is not empty."""
        return self._sample(0)

    def last(self) -> S:
        """Newest sample of a series that is not empty."""
        return self._sample(self._count - 1)

    def before_last(self, baseline_ns: int) -> S:
        """Return the oldest sample within `baseline_ns` of the newest one; if there is no
        other, the newest.
        """
        return self._sample(self._index_from(self._times[self._count - 1] - baseline_ns))
