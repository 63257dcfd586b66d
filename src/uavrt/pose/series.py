"""A bounded run of timed samples with strictly rising times."""

from bisect import bisect_left
from typing import Generic, Protocol, TypeVar


class Timed(Protocol):
    """Anything with a time."""

    @property
    def time_ns(self) -> int:
        """Time [ns, UTC]."""
        ...


S = TypeVar("S", bound=Timed)

REBOOT_NS = 500_000_000
"""A time that falls by this much is a new count, not a late message: at 10 Hz and over a link
of 57 600 baud messages are late by tens of milliseconds, never by half a second."""


class Series(Generic[S]):
    """Samples by time, oldest dropped first.

    Parameters
    ----------
    capacity : int
        Most samples kept.
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._times: list[int] = []
        self._samples: list[S] = []

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
        self._samples.append(sample)
        # In batches: taking the first off a list moves all the others.
        surplus = len(self._times) - self._capacity
        if surplus > self._capacity // 4:
            del self._times[:surplus]
            del self._samples[:surplus]
        return True

    def clear(self) -> None:
        """Forget everything."""
        self._times.clear()
        self._samples.clear()

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
            return self._samples[index], self._samples[index]
        if index == 0:
            return None
        return self._samples[index - 1], self._samples[index]

    def first(self) -> S:
        """Get the oldest sample of a run that is not empty."""
        return self._samples[0]

    def last(self) -> S:
        """Get the newest sample of a run that is not empty."""
        return self._samples[-1]

    def before_last(self, baseline_ns: int) -> S:
        """Get the oldest sample within `baseline_ns` of the newest; the newest if alone."""
        return self._samples[bisect_left(self._times, self._times[-1] - baseline_ns)]
