"""A bounded run of timed samples with strictly rising times."""

from array import array
from bisect import bisect_left
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class Timed(Protocol):
    """Anything with a time."""

    @property
    def time_ns(self) -> int:
        """Time [ns, UTC]."""
        ...


S = TypeVar("S", bound=Timed)
Four = tuple[float, float, float, float]

REBOOT_NS = 500_000_000
"""A time that falls by this much is a new count, not a late message: at 10 Hz and over a link
of 57 600 baud messages are late by tens of milliseconds, never by half a second."""


class Series(Generic[S]):
    """Samples by time, oldest dropped first.

    They are kept as bare numbers, 40 bytes each: as records they take 330, and memory would
    grow by 24 kB a second until the run is full.

    Parameters
    ----------
    capacity : int
        Most samples kept.
    pack : callable
        Gets a sample's four numbers.
    unpack : callable
        Makes a sample of a time and its four numbers.
    """

    def __init__(
        self, capacity: int, pack: Callable[[S], Four], unpack: Callable[[int, Four], S]
    ) -> None:
        self._capacity = capacity
        self._pack, self._unpack = pack, unpack
        self._times = array("q")
        self._values = array("d")

    def __len__(self) -> int:
        return len(self._times)

    def add(self, sample: S) -> bool:
        """Append a sample; False when it is late and left out.

        Raises
        ------
        OverflowError
            Time fell by `REBOOT_NS` or more; the caller forgets what was before and adds again.
        """
        time_ns = sample.time_ns
        if self._times:
            fall_ns = self._times[-1] - time_ns
            if fall_ns >= REBOOT_NS:
                raise OverflowError(f"time fell by {fall_ns} ns")
            if fall_ns >= 0:
                return False
        self._times.append(time_ns)
        self._values.extend(self._pack(sample))
        # In batches: taking the first off a list moves all the others.
        surplus = len(self._times) - self._capacity
        if surplus > self._capacity // 4:
            del self._times[:surplus]
            del self._values[: 4 * surplus]
        return True

    def clear(self) -> None:
        """Forget everything."""
        del self._times[:]
        del self._values[:]

    def _sample(self, index: int) -> S:
        a, b, c, d = self._values[4 * index : 4 * index + 4]
        return self._unpack(self._times[index], (a, b, c, d))

    @property
    def first_ns(self) -> int | None:
        """Time of the oldest sample, None when empty."""
        return self._times[0] if self._times else None

    @property
    def last_ns(self) -> int | None:
        """Time of the newest sample, None when empty."""
        return self._times[-1] if self._times else None

    def bracket(self, time_ns: int) -> tuple[S, S] | None:
        """Get the samples just before and after; twice the same on an exact hit.

        None when the time lies outside the run.
        """
        index = bisect_left(self._times, time_ns)
        if index == len(self._times):
            return None
        if self._times[index] == time_ns:
            sample = self._sample(index)
            return sample, sample
        if index == 0:
            return None
        return self._sample(index - 1), self._sample(index)

    def first(self) -> S:
        """Get the oldest sample of a run that is not empty."""
        return self._sample(0)

    def last(self) -> S:
        """Get the newest sample of a run that is not empty."""
        return self._sample(len(self._times) - 1)

    def before_last(self, baseline_ns: int) -> S:
        """Get the oldest sample within `baseline_ns` of the newest; the newest if alone."""
        return self._sample(bisect_left(self._times, self._times[-1] - baseline_ns))
