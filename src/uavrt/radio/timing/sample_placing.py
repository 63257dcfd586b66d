"""Assign index and time to a live stream's samples, and find the gaps between them.

A source collects samples into blocks and reports every arrival. If an arrival is so late that
samples may be lost, the block ends before it. The next few arrivals then show whether there is
a gap or only a delay; until then, later samples are held back.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.radio.timing.arrival_rate import ArrivalRate
from uavrt.radio.timing.losses import HALVED_S
from uavrt.radio.timing.sample_times import NominalTimes, TimeKeeper

HOLD_S: Final = 0.13
"""Maximum time for which samples beyond a full block are held back until it is certain whether
samples were lost [s]: two transfers."""
_LOG_S: Final = 10.0
_BURST_NS: Final = 1_000_000
"""Maximum time between arrivals that belong to one write of the radio's program [ns]."""
_LONG_WRITE_S: Final = 0.040
"""Length of a write above which a loss is placed in the middle of the write [s]. In a shorter
write the loss is placed at the end, so that the times of samples before the loss are
correct."""
_LEAST_S: Final = 0.001
"""Minimum duration of the samples before a late arrival that are passed on as a separate block
[s]."""

log = get_logger()


@dataclass(frozen=True, slots=True)
class _Arrival:
    held: int
    time_ns: int


class Placer:
    """Assigns index and time to the samples of a live stream.

    `start_time_ns`: time of the first sample [ns, UTC]; times then follow from the nominal
    rate, and only losses reported by the sender are counted. `start_moves`: correct the start
    time if the first arrivals were delayed; False where times must not jump. `may_be_slow`: the
    sender may be slower than real time; False for a radio. `rate_remedy`: remedy in the text
    about a wrong sample rate.
    """

    def __init__(
        self,
        sample_rate_hz: float,
        *,
        start_time_ns: int | None = None,
        start_moves: bool = True,
        may_be_slow: bool = False,
        rate_remedy: str = "",
    ) -> None:
        self._start_moves = start_moves
        self.index = 0
        """Index of the next sample to be passed on; lost samples are included in the count."""
        self.lost = 0
        self.unsure = 0
        """Number of samples counted as lost that may be due to a wrong clock rate instead."""
        self._inferred = 0
        self._rate_hz = sample_rate_hz
        self._arrival_rate = ArrivalRate(sample_rate_hz)
        self._may_be_slow, self._rate_remedy = may_be_slow, rate_remedy
        self._rate_reported: str | None = None
        self._keeper = TimeKeeper(sample_rate_hz, may_be_slow=may_be_slow)
        self._nominal = (
            None if start_time_ns is None else NominalTimes(start_time_ns, sample_rate_hz)
        )
        self.paced = True
        """True if arrivals show a sample rate; False for a file on standard input."""
        self._before = 0
        """Number of samples lost just before the samples that are held back."""
        self.cut = 0
        """Number of waiting samples to pass on as a block before a possible loss; 0 if none."""
        self._after_cut = 0
        self._burst: _Arrival | None = None
        self._last: tuple[int, int] | None = None
        self._suspect_cut = False
        self._unlogged = 0
        self._next_log_index = 0

    @property
    def sample_rate_hz(self) -> float:
        """Sample rate measured against UTC so far [Hz]."""
        times = self._nominal or self._keeper
        return times.sample_rate_hz

    @property
    def unseen(self) -> str | None:
        """Reason why arrival times cannot be used to find losses; None if they can."""
        return self._keeper.unseen if self._nominal is None else "--start-time was given"

    @property
    def withdrawn(self) -> int:
        """Number of samples counted as lost by arrival times that later proved unusable."""
        return 0 if self._keeper.unseen is None else self._inferred

    @property
    def rate_fault(self) -> str | None:
        """Text with the measured sample rate and a remedy; None if the rate is as requested.

        A pipe may deliver a recording much quicker than real time: more than three times the
        requested rate is not a fault there.
        """
        wrong_hz = self._arrival_rate.wrong_hz
        if (
            wrong_hz is None
            or not self.paced
            or (self._may_be_slow and wrong_hz > 3.0 * self._rate_hz)
        ):
            return None
        return (
            f"{float(f'{wrong_hz:.3g}'):.0f} samples a second arrive, not {self._rate_hz:.0f}. "
            f"{self._rate_remedy}"
        )

    def begin(self, now_ns: int) -> None:
        """Set the time at which the wait for samples began [ns, UTC]."""
        if self._last is None:
            self._last = (0, now_ns)

    def arrived(self, held: int, now_ns: int, *, full: bool = False) -> None:
        """Register that `held` samples have arrived by a time [ns, UTC].

        `full`: the buffer is full and the sender has to wait, so its rate cannot be measured.
        """
        self._arrival_rate.arrived(self.index - self.lost + held, now_ns, full=full)
        if self._nominal is not None:
            return
        if full and self.index > 2.0 * self._rate_hz:
            self._burst, self._last = None, (self._place(held), now_ns)
            return
        burst, self._burst = self._burst, _Arrival(held, now_ns)
        if burst is not None and now_ns - burst.time_ns >= _BURST_NS:
            self._learn(burst, full)
        if not self._keeper.started:
            self._learn(self._burst, full)
            self._burst = None

    def settle(self) -> bool:
        """True if waiting samples can be passed on, because no loss is suspected."""
        if self._keeper.undecided and self._burst is not None:
            burst, self._burst = self._burst, None
            self._learn(burst, False)
        return not (self._keeper.undecided or self._keeper.may_suspect)

    def add_lost(self, samples: int, held: int = 0) -> None:
        """Add a number of lost samples that the radio reports.

        `held`: number of waiting samples that arrived before the loss.
        """
        left = self._keeper.skip(samples)
        if left <= 0:
            return
        if held > 0 and not self.cut:
            self.cut = held
        if self.cut:
            self._after_cut += left
        else:
            self._before += left

    def expect_losses(self) -> None:
        """Register that the radio reported a loss without the number of lost samples."""
        self._keeper.expect_losses()

    def place(self, samples: NDArray[np.complex64]) -> IQBlock:
        """Make a block of samples with its index, its time and the number of samples lost."""
        lost, unsure = self._before, self._keeper.unsure_samples - self.unsure
        self._before, self._after_cut, self.cut = self._after_cut, 0, 0
        self.index += lost
        if lost:
            unsure = min(unsure, lost)
            self.lost += lost
            self.unsure += unsure
            self._log(lost)
        else:
            unsure = 0
        if (fault := self.rate_fault) is not None and fault != self._rate_reported:
            log.warning(fault)
        self._rate_reported = fault
        times = self._nominal or self._keeper
        block = IQBlock(
            samples=samples,
            sample_index=self.index,
            time_ns=times.time_ns(self.index),
            sample_rate_hz=times.sample_rate_hz,
            lost_before=lost,
            unsure_before=unsure,
        )
        self.index += len(samples)
        if self._burst is not None:
            self._burst = _Arrival(self._burst.held - len(samples), self._burst.time_ns)
        return block

    def _log(self, lost: int) -> None:
        self._unlogged += lost
        if self.index >= self._next_log_index:
            log.info(
                "samples lost",
                count=self._unlogged,
                seconds=round(self._unlogged / self._rate_hz, 3),
                total=self.lost,
                before_sample=self.index,
                **({"perhaps_clock_error": self.unsure} if self.unsure else {}),
            )
            self._unlogged = 0
            self._next_log_index = self.index + round(_LOG_S * self._rate_hz)

    def _place(self, held: int) -> int:
        return self.index + self._before + self._after_cut + held

    def _learn(self, arrival: _Arrival, full: bool) -> None:
        end = self._place(arrival.held)
        last_end, last_ns = self._last or (0, arrival.time_ns)
        took_s = (arrival.time_ns - last_ns) * 1e-9
        self._last = (end, arrival.time_ns)
        keeper = self._keeper
        keeper.arrived(
            end,
            arrival.time_ns,
            catching_up=self._start_moves
            and (full or took_s < 0.5 * (end - last_end) / self._rate_hz),
        )
        lost = keeper.lost_samples()
        self._inferred += lost
        if lost and self._suspect_cut and not self.cut and keeper.inside < arrival.held:
            self.cut = keeper.inside
            if self.cut and lost < HALVED_S * self._rate_hz:
                self._before += lost // 2
                self._after_cut -= lost // 2
            elif self.cut > _LONG_WRITE_S * self._rate_hz:
                self.cut //= 2
        if self.cut:
            self._after_cut += lost
        else:
            self._before += lost
        if lost:
            self._last = (end + lost, arrival.time_ns)
        if not keeper.undecided:
            self._suspect_cut = False
        elif not self._suspect_cut:
            self._suspect_cut = True
            before = keeper.suspect_index - self.index - self._before
            if before > _LEAST_S * self._rate_hz and not self.cut:
                self.cut = min(before, arrival.held)
