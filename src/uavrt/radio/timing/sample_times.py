"""Estimate the times of samples [UTC] from their index and their arrival times.

A radio has its own clock (an RTL dongle is up to 50 ppm off: 180 ms in an hour). Arrivals are
delayed by USB, the radio's program, the pipe and the scheduler, mostly by a few milliseconds
and sometimes by hundreds. But no sample arrives *before* it was taken. So only the earliest
arrivals count: the line through the lower envelope of (arrival time - index / rate) is the
radio's clock.

::

    arrival - index/rate
      |      .        :  .       . late: scheduler, USB
      |  .   :  . .   :  :  .  . :
      |__:_._:__:_:_._:__:__:_.__:___ lower envelope: slope = rate error, height = delay
      +-------------------------------> index

Lost samples raise the envelope by a step, which `uavrt.radio.timing.losses` finds. The constant
part of the delay cannot be measured: it stays in the times (about 10 to 20 ms with an Airspy's
USB transfers) and is the same for every tag.
"""

import math

import numpy as np

from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.radio.timing.losses import SLOWEST_RATE, Loss, LossFinder

_BIN_S = 0.5
"""Length of the periods in which the earliest arrival of samples is stored [s]."""
_BINS = 600
"""Number of stored periods of arrivals: 5 min, in which the rate of a clock changes by less
than 1 ppm."""
_FIT_BINS = 8
"""Minimum number of periods of arrivals from which a clock's rate is estimated."""
_MEASURED_AFTER_S = 30.0
"""Time from the start in which the nominal sample rate is reported, because jitter dominates
the measured rate [s]."""
_MAX_RATE_ERROR = 500e-6
"""Maximum relative error of a radio's clock; above it the nominal rate is wrong."""
_PRIOR_RATE_ERROR = 30e-6
"""Standard deviation of the relative clock errors of radios, assumed before measuring (Airspy
0.5, HackRF 20, RTL 50 ppm)."""
_FAST_SLEW = 1000e-6
_SLEW = 200e-6
"""Maximum rate at which sample times are corrected [s/s]; an interval of 1.25 s is then wrong
by at most 0.25 ms."""
_FAST_SLEW_UNTIL_S = 10.0
_SETTLE_S = 2.0
"""Time from the start of a stream [s] in which samples that arrive at once count as delayed by
the writer; later they count as a replay."""
_NOT_LIVE_S = 0.5
"""Earliness of samples [s] above which the stream counts as a replay and not as live."""
_REPORT_DELAY_S = 3.0
"""Maximum time between the detection of a loss from arrival times and the radio program's
report of that loss [s]; a later report is another loss."""
_SLOPE_PAUSE_S = 1.0
"""Time after a loss in which the measured clock rate is not updated [s]."""
_FAR_S = 0.005
_FAR_IN_S = 0.5
_DOUBT_S = 10.0
"""Time after a loss [s] in which sample times that are wrong by more than `_FAR_S` are
corrected more quickly than by `_SLEW`, with the time constant `_FAR_IN_S`."""


class NominalTimes:
    """Computes the times of samples from a start time [ns, UTC] and the nominal rate."""

    def __init__(self, start_time_ns: int, sample_rate_hz: float) -> None:
        self._start_ns = start_time_ns
        self.sample_rate_hz = sample_rate_hz

    def time_ns(self, index: int) -> int:
        """Time of a sample [ns, UTC]; exact for any index (integer arithmetic)."""
        return self._start_ns + _duration_ns(index, self.sample_rate_hz)


class TimeKeeper:
    """Estimates the times of a live radio's samples from their arrivals.

    The first arrival sets the start time (see `arrived` for writers that had been waiting).
    Times are then corrected towards the earliest arrivals, by at most 0.2 ms a second (1 ms a
    second in the first 10 s). They never jump, except over the gap of `lost_samples`.

    `sample_rate_hz`: nominal rate. `may_be_slow`: the sender may be slower than real time;
    False for a radio.
    """

    def __init__(self, sample_rate_hz: float, *, may_be_slow: bool = False) -> None:
        self._nominal_hz = sample_rate_hz
        self._follow = True
        self.unseen: str | None = None
        """Why arrivals no longer give times and losses; None while they do."""
        self._settled = False
        self._kept_pace = False
        self._start_ns: int | None = None
        # Rows of nominal seconds and delay, in memory allocated at the start.
        self._finder = LossFinder(may_be_slow=may_be_slow)
        self._lost_s = 0.0
        """Duration of found losses that `lost_samples` has not returned yet [s]."""
        self._unsure_s = 0.0
        self.unsure_samples = 0
        """Number of samples returned as lost that may be due to a wrong clock rate instead."""
        self.inside = 0
        """Length of the late transfer with the last loss [samples]; 0 if the loss is before
        it."""
        self._loss_at_s = -math.inf
        self._credit_s = 0.0
        self._bins = np.zeros((_BINS, 2))
        self._bin_count = 0
        self._bin: tuple[int, float, float] | None = None
        self._fit_in = 0
        # Model: delay(s) = offset + slope * (s - pivot), s = nominal seconds since the start.
        self._offset_s = 0.0
        self._slope = 0.0
        self._pivot_s = 0.0
        # Last time returned: nominal seconds, and the correction [s].
        self._asked = False
        self._given_s = 0.0
        self._correction_s = 0.0

    @property
    def started(self) -> bool:
        """True after the first arrival of samples."""
        return self._start_ns is not None

    @property
    def rate_error(self) -> float:
        """Measured sample rate relative to the nominal rate, minus one; 0 in the first 30 s."""
        if not self._follow or self._span_s() < _MEASURED_AFTER_S:
            return 0.0
        return -self._slope

    @property
    def sample_rate_hz(self) -> float:
        """Sample rate measured against UTC so far [Hz]."""
        return self._nominal_hz * (1.0 + self.rate_error)

    def arrived(self, end_index: int, now_ns: int, *, catching_up: bool = False) -> None:
        """Register that all samples before `end_index` had arrived at `now_ns`.

        `catching_up`: the writer had been waiting and delivers samples more quickly than in
        real time. In the first 2 s, the start time is then corrected once, when the writer has
        caught up.
        """
        if self._start_ns is None:
            self._start_ns = now_ns - _duration_ns(end_index, self._nominal_hz)
            self._settled = not catching_up
            return
        if not self._follow:
            return
        nominal_s = end_index / self._nominal_hz + self._lost_s
        delay_s = (now_ns - self._start_ns) / NANOSECONDS_PER_SECOND - nominal_s
        if catching_up and not self._kept_pace and nominal_s < _SETTLE_S:
            # The first arrival was delayed: the following samples come at once.
            self._settled = False
        self._kept_pace = self._kept_pace or not catching_up
        if not self._settled:
            if catching_up and nominal_s < _SETTLE_S:
                return
            self._settled = True
            if not catching_up:
                self._offset_s = self._correction_s = min(delay_s, 0.0)
        elif not self._asked and delay_s < self._offset_s:
            # No time has been returned yet: the start can still move.
            self._offset_s = self._correction_s = delay_s
        if delay_s < self._model_s(nominal_s) - _NOT_LIVE_S:
            self._forget("the samples came faster than a radio takes them, as from a recording")
            return
        loss = self._finder.put(
            nominal_s, nominal_s + delay_s, delay_s - self._model_s(nominal_s)
        )
        if self._finder.pace is not None and self._finder.pace.slow:
            self._forget("the samples came slower than a radio takes them, as from a slow disk")
            return
        if loss is not None:
            self._apply_loss(loss, nominal_s)
            return
        early_s = self._finder.early_s()
        if early_s:
            self._offset_s += early_s
            self._finder.shift(early_s)
        number = int(nominal_s / _BIN_S)
        if self._bin is None or self._bin[0] == number:
            if self._bin is None or delay_s < self._bin[2]:
                self._bin = (number, nominal_s, delay_s)
            return
        self._keep(self._bin[1:])
        self._bin = (number, nominal_s, delay_s)
        self._fit()

    @property
    def undecided(self) -> bool:
        """True if the next few arrivals will show whether samples were lost."""
        return self._follow and self._finder.undecided

    @property
    def may_suspect(self) -> bool:
        """True if the newest arrivals are late but still too few to indicate a loss."""
        return self._follow and self._finder.may_suspect

    @property
    def suspect_index(self) -> int:
        """Index of the sample before which samples may be lost, while `undecided`."""
        return round((self._finder.suspect_s or 0.0) * self._nominal_hz)

    def expect_losses(self) -> None:
        """Register that the radio reported a loss without the number of lost samples."""
        self._finder.expect(self._given_s)

    def _apply_loss(self, loss: Loss, nominal_s: float) -> None:
        self._lost_s += loss.duration_s
        if not loss.sure:
            self._unsure_s += loss.duration_s
        self.inside = round(loss.inside_s * self._nominal_hz)
        self._credit_s += loss.duration_s
        self._finder.skip(loss.duration_s)
        self._bin = None
        # A drift that is counted as losses must not be attributed to the crystal as well.
        clean_s = loss.since_s if loss.sharp else self._loss_at_s
        while self._bin_count and self._bins[self._bin_count - 1, 0] >= clean_s:
            self._bin_count -= 1
        if not loss.sharp and self._bin_count < _FIT_BINS:
            self._offset_s, self._slope = self._model_s(nominal_s), 0.0
            self._pivot_s = nominal_s
        self._fit_in = 0
        self._loss_at_s = nominal_s + loss.duration_s

    def _keep(self, bin_: tuple[float, float]) -> None:
        if bin_[0] < self._loss_at_s + _SLOPE_PAUSE_S:
            return
        if self._bin_count == _BINS:
            self._bins[:-1] = self._bins[1:]
            self._bin_count -= 1
        self._bins[self._bin_count] = bin_
        self._bin_count += 1

    def lost_samples(self) -> int:
        """Number of lost samples found from arrival times since the last call.

        The caller must add this number to its sample index.
        """
        lost = round(self._lost_s * self._nominal_hz)
        if lost:
            self._given_s += lost / self._nominal_hz
            self.unsure_samples += min(lost, round(self._unsure_s * self._nominal_hz))
            self._lost_s = self._unsure_s = 0.0
        return lost

    def skip(self, samples: int) -> int:
        """Skip samples that the radio reports as lost; return the number still to be counted.

        A loss that arrival times have already shown is not counted twice.
        """
        seconds = samples / self._nominal_hz
        if self._given_s > self._loss_at_s + _REPORT_DELAY_S:
            self._credit_s = 0.0
        known_s = min(seconds, self._credit_s)
        self._credit_s -= known_s
        # Times continue where the gap ends: the correction at the new index is the old one.
        left = samples - round(known_s * self._nominal_hz)
        self._given_s += left / self._nominal_hz
        self._finder.skip(left / self._nominal_hz)
        return left

    def time_ns(self, index: int) -> int:
        """Time of a sample [ns, UTC]; `index` must not decrease from call to call.

        Raises `ValueError` before the first arrival.
        """
        if self._start_ns is None:
            raise ValueError("no samples have arrived yet, so there is no start time")
        self._asked = True
        nominal_s = index / self._nominal_hz
        step_s = max(nominal_s - self._given_s, 0.0)
        if self._follow and step_s > 0.0:
            fast = nominal_s < _FAST_SLEW_UNTIL_S
            reach_s = step_s * (_FAST_SLEW if fast else _SLEW)
            drift_s = self._slope * step_s
            wanted_s = self._model_s(nominal_s) - (self._correction_s + drift_s)
            far_s = 0.0
            if nominal_s < self._loss_at_s + _DOUBT_S:
                far_s = max(-wanted_s - _FAR_S, 0.0) * min(step_s / _FAR_IN_S, 1.0)
            self._correction_s += drift_s + min(max(wanted_s, -reach_s - far_s), reach_s)
            self._given_s = nominal_s
        return (
            self._start_ns
            + _duration_ns(index, self._nominal_hz)
            + ns_from_s(self._correction_s)
        )

    def _model_s(self, nominal_s: float) -> float:
        return self._offset_s + self._slope * (nominal_s - self._pivot_s)

    def _span_s(self) -> float:
        if not self._bin_count:
            return 0.0
        return float(self._bins[self._bin_count - 1, 0] - self._bins[0, 0])

    def _forget(self, why: str) -> None:
        """Stop using arrival times; the nominal rate then determines later times."""
        self.unseen = why
        self._follow = False

    def _fit(self) -> None:
        """Estimate rate and offset of the radio's clock from the earliest arrivals."""
        if self._fit_in > 0:
            self._fit_in -= 1
            return
        count = self._bin_count
        # Twice a second at first, then every 5 s: it costs about 0.1 ms.
        self._fit_in = 0 if count < 20 else 9
        if count < _FIT_BINS:
            if self._loss_at_s < 0.0:
                self._offset_s = float(self._bins[:count, 1].min())
            return
        at, delay = self._bins[:count].T
        pivot = float(at[-1])
        x = at - pivot
        offset = self._offset_s + self._slope * (pivot - self._pivot_s)
        slope = self._slope
        for _ in range(4):
            residual = delay - (offset + slope * x)
            scatter = max(float(np.partition(np.abs(residual), count // 4)[count // 4]), 1e-4)
            late = np.maximum(residual, 0.0) / scatter
            weight = 1.0 / (1.0 + late * late)
            total = float(weight.sum())
            mean_x = float(weight @ x) / total
            mean_d = float(weight @ delay) / total
            centred = weight * (x - mean_x)
            spread = float(centred @ (x - mean_x)) + (scatter / _PRIOR_RATE_ERROR) ** 2
            slope = float(centred @ (delay - mean_d)) / spread
            slope = min(max(slope, -_MAX_RATE_ERROR), SLOWEST_RATE)
            offset = mean_d - slope * mean_x
        # No crystal changes the delay suddenly: the source is slow, or samples are lost.
        offset = min(offset, self._model_s(pivot) + _FAR_S)
        self._offset_s, self._slope, self._pivot_s = offset, slope, pivot


def _duration_ns(samples: int, rate_hz: float) -> int:
    """Duration of a number of samples [ns]; exact if the sample rate is an integer."""
    if rate_hz == int(rate_hz):
        rate = int(rate_hz)
        return (samples * NANOSECONDS_PER_SECOND + rate // 2) // rate
    return round(samples * (NANOSECONDS_PER_SECOND / rate_hz))
