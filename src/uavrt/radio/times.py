"""From sample index to UTC: pure arithmetic, fed with what others read from the clock.

A radio has its own crystal (an RTL dongle is up to 50 ppm off: 180 ms in an hour), and what
reaches us has been delayed by USB, the radio's program, the pipe and the scheduler, by a few
milliseconds most of the time and by hundreds now and then. But nothing arrives *before* it was
sampled. So the earliest arrivals tell the truth and the late ones nothing: the line through the
lower envelope of (arrival time - index / rate) is the radio's clock.

::

    arrival - index/rate
      |      .        :  .       . late: scheduler, USB
      |  .   :  . .   :  :  .  . :
      |__:_._:__:_:_._:__:__:_.__:___ lower envelope: slope = rate error, height = delay
      +-------------------------------> index

What the envelope cannot show is the constant part of the delay: it stays in the times (about
10 to 20 ms with an Airspy's USB transfers) and is the same for every tag.
"""

import numpy as np

from uavrt.units import NANOSECONDS_PER_SECOND

_BIN_S = 0.5
"""One lowest arrival is kept for each stretch of this length."""
_BINS = 600
"""Bins remembered: 5 min, over which a crystal's rate is constant to well under 1 ppm."""
_MEASURED_AFTER_S = 30.0
"""Before this the envelope's slope is mostly jitter, and the nominal rate is reported."""
_MAX_RATE_ERROR = 500e-6
"""No crystal is further off; more means a wrong nominal rate."""
_PRIOR_RATE_ERROR = 30e-6
"""One standard deviation of crystals in these radios (Airspy 0.5, HackRF 20, RTL 50 ppm)."""
_FAST_SLEW = 1000e-6
_SLEW = 200e-6
"""Fastest correction of the time, so that an interval of 1.25 s stays right to 0.25 ms."""
_FAST_SLEW_UNTIL_S = 10.0
_SETTLE_S = 2.0
"""Within this a writer that had to wait for us has caught up, or it is a replay."""
_GAP_BINS = 4
_GAP_THRESHOLD_S = 0.025
_GAP_FLATNESS_S = 0.004
_NOT_LIVE_S = 0.5
"""Arrivals so much before their time show that the stream is replayed, not sampled now."""


class NominalTimes:
    """Times of a recording: the start, and the nominal rate.

    Parameters
    ----------
    start_time_ns : int
        Time of sample 0 [ns, UTC].
    sample_rate_hz : float
        Nominal rate.
    """

    def __init__(self, start_time_ns: int, sample_rate_hz: float) -> None:
        self._start_ns = start_time_ns
        self._rate_hz = sample_rate_hz

    @property
    def sample_rate_hz(self) -> float:
        """The nominal rate."""
        return self._rate_hz

    def time_ns(self, index: int) -> int:
        """Time of a sample [ns, UTC]; exact for any index (integers, no rounding drift)."""
        return self._start_ns + _duration_ns(index, self._rate_hz)


class TimeKeeper:
    """The time of each sample of a live radio, from when the samples arrived.

    The first arrival stamps the start (see `arrived` for writers who were early). From then on
    the time of a sample follows the envelope by slewing, at most 0.2 ms a second (1 ms in the
    first 10 s): it never jumps, except over a gap of which `lost_samples` tells.

    Parameters
    ----------
    sample_rate_hz : float
        Nominal rate.
    follow_arrivals : bool
        False for a start stamped once and the nominal rate ever after.
    """

    def __init__(self, sample_rate_hz: float, *, follow_arrivals: bool = True) -> None:
        self._nominal_hz = sample_rate_hz
        self._follow = follow_arrivals
        self._settled = False
        self._start_ns: int | None = None
        # Rows of nominal seconds and delay, in room taken at the beginning.
        self._bins = np.zeros((_BINS, 2))
        self._bin_count = 0
        self._bin: tuple[int, float, float] | None = None
        self._fit_in = 0
        # Model: delay(s) = offset + slope * (s - pivot), s = nominal seconds since the start.
        self._offset_s = 0.0
        self._slope = 0.0
        self._pivot_s = 0.0
        # What was given out last: nominal seconds, and its correction [s].
        self._given_s = 0.0
        self._correction_s = 0.0

    @property
    def started(self) -> bool:
        """True after the first arrival."""
        return self._start_ns is not None

    @property
    def live(self) -> bool:
        """False once the arrivals have shown that the stream is a replay."""
        return self._follow

    @property
    def rate_error(self) -> float:
        """Measured rate over nominal rate, minus one; 0 in the first seconds."""
        if not self._follow or self._span_s() < _MEASURED_AFTER_S:
            return 0.0
        return -self._slope

    @property
    def sample_rate_hz(self) -> float:
        """Rate against UTC as measured so far."""
        return self._nominal_hz * (1.0 + self.rate_error)

    def arrived(self, end_index: int, now_ns: int, *, catching_up: bool = False) -> None:
        """Learn that all samples before `end_index` had arrived at `now_ns`.

        Parameters
        ----------
        end_index : int
            Index after the newest sample, lost ones counted.
        now_ns : int
            Time [ns, UTC].
        catching_up : bool
            They came faster than a radio samples: the writer had been waiting for us. If that
            is so in the first 2 s, the start is stamped anew, once, when the writer is level.
        """
        if self._start_ns is None:
            self._start_ns = now_ns - _duration_ns(end_index, self._nominal_hz)
            self._settled = not catching_up
            return
        if not self._follow:
            return
        nominal_s = end_index / self._nominal_hz
        delay_s = (now_ns - self._start_ns) / NANOSECONDS_PER_SECOND - nominal_s
        if not self._settled:
            if catching_up and nominal_s < _SETTLE_S:
                return
            self._settled = True
            if not catching_up:
                self._offset_s = self._correction_s = min(delay_s, 0.0)
        if delay_s < self._model_s(nominal_s) - _NOT_LIVE_S:
            self._forget()
            return
        number = int(nominal_s / _BIN_S)
        if self._bin is None or self._bin[0] == number:
            if self._bin is None or delay_s < self._bin[2]:
                self._bin = (number, nominal_s, delay_s)
            return
        self._keep(self._bin[1:])
        self._bin = (number, nominal_s, delay_s)
        self._fit()

    def _keep(self, bin_: tuple[float, float]) -> None:
        """Remember a bin; forget the oldest when there is no room."""
        if self._bin_count == _BINS:
            self._bins[:-1] = self._bins[1:]
            self._bin_count -= 1
        self._bins[self._bin_count] = bin_
        self._bin_count += 1

    def lost_samples(self) -> int:
        """Tell how many samples must have been lost, judging by arrivals; then forget them.

        Samples that a radio drops silently shift all later arrivals by a constant. That is
        told from a slow machine by its shape: the lowest arrivals of two seconds all late by
        more than 25 ms, and by the same amount within 4 ms.

        The caller adds the number to its index, and shows it as a gap.
        """
        if not self._follow or self._bin_count < 2 * _GAP_BINS:
            return 0
        newest: list[list[float]]
        newest = self._bins[self._bin_count - _GAP_BINS : self._bin_count].tolist()
        late = [delay - self._model_s(at) for at, delay in newest]
        step_s = min(late)
        if step_s < _GAP_THRESHOLD_S or max(late) - step_s > _GAP_FLATNESS_S:
            return 0
        self._bin_count -= _GAP_BINS
        self._bin = None
        lost = round(step_s * self._nominal_hz)
        self.skip(lost)
        return lost

    def skip(self, samples: int) -> None:
        """Leave out samples that are known to be lost; the caller's index skips them too."""
        # Time goes on where the gap ends: the correction at the new index is the old one.
        self._given_s += samples / self._nominal_hz

    def time_ns(self, index: int) -> int:
        """Time of a sample [ns, UTC]; to be asked in rising order of `index`.

        Raises
        ------
        ValueError
            Nothing has arrived yet.
        """
        if self._start_ns is None:
            raise ValueError("no samples have arrived yet, so there is no start time")
        nominal_s = index / self._nominal_hz
        step_s = max(nominal_s - self._given_s, 0.0)
        if self._follow and step_s > 0.0:
            fast = nominal_s < _FAST_SLEW_UNTIL_S
            reach_s = step_s * (_FAST_SLEW if fast else _SLEW)
            drift_s = self._slope * step_s
            wanted_s = self._model_s(nominal_s) - (self._correction_s + drift_s)
            self._correction_s += drift_s + min(max(wanted_s, -reach_s), reach_s)
            self._given_s = nominal_s
        return (
            self._start_ns
            + _duration_ns(index, self._nominal_hz)
            + round(self._correction_s * NANOSECONDS_PER_SECOND)
        )

    def _model_s(self, nominal_s: float) -> float:
        return self._offset_s + self._slope * (nominal_s - self._pivot_s)

    def _span_s(self) -> float:
        if not self._bin_count:
            return 0.0
        return float(self._bins[self._bin_count - 1, 0] - self._bins[0, 0])

    def _forget(self) -> None:
        """Fall back to the start and the nominal rate."""
        self._follow = False
        self._bin_count = 0
        self._bin = None

    def _fit(self) -> None:
        """Fit the lower envelope: least squares in which a late point loses its weight.

        The slope has the prior of real crystals, so the fit is sane from the second bin on.
        While a gap may be showing, its late bins weigh next to nothing.
        """
        if self._fit_in > 0:
            self._fit_in -= 1
            return
        count = self._bin_count
        # Twice a second at first, then every 5 s: it costs about 0.1 ms.
        self._fit_in = 0 if count < 20 else 9
        if count < 8:
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
            slope = min(max(slope, -_MAX_RATE_ERROR), _MAX_RATE_ERROR)
            offset = mean_d - slope * mean_x
        self._offset_s, self._slope, self._pivot_s = offset, slope, pivot


def _duration_ns(samples: int, rate_hz: float) -> int:
    """Duration of so many samples at a rate, exact where the rate is a whole number [ns]."""
    if rate_hz == int(rate_hz):
        rate = int(rate_hz)
        return (samples * NANOSECONDS_PER_SECOND + rate // 2) // rate
    return round(samples * (NANOSECONDS_PER_SECOND / rate_hz))
