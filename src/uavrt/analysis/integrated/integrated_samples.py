"""Analyse a whole flight that is given as arrays of samples and poses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.integrated.integrated_records import IntegratedRecord, integrated_record
from uavrt.analysis.whole_flights.judged_flights import WholeFlightOptions, integrate_flight
from uavrt.core.errors import UsageError
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, FlightInfo, IQBlock, Pose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.antenna import AntennaPattern, pattern_named
from uavrt.localization.terrain.elevation import Elevation

_BLOCK = 262_144


class _Array:
    """Sample source that reads from an array; non-finite values are lost samples."""

    def __init__(
        self,
        samples: NDArray[np.complex64],
        *,
        time_ns: int,
        sample_rate_hz: float,
        center_frequency_hz: float,
    ) -> None:
        self._samples, self._time_ns = samples, time_ns
        self.sample_rate_hz = sample_rate_hz
        self.center_frequency_hz = center_frequency_hz
        there = np.isfinite(samples)
        edges = np.diff(np.concatenate(([False], there, [False])).astype(np.int8))
        self._runs = [
            (begin, min(begin + _BLOCK, end))
            for first, end in zip(
                np.flatnonzero(edges > 0).tolist(),
                np.flatnonzero(edges < 0).tolist(),
                strict=True,
            )
            for begin in range(first, end, _BLOCK)
        ][::-1]
        self._at = 0

    @property
    def total_samples(self) -> int:
        return len(self._samples)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        if not self._runs:
            raise EOFError
        begin, end = self._runs.pop()
        lost, self._at = begin - self._at, end
        after_ns = round(begin / self.sample_rate_hz * NANOSECONDS_PER_SECOND)
        return IQBlock(
            samples=self._samples[begin:end],
            sample_index=begin,
            time_ns=self._time_ns + after_ns,
            sample_rate_hz=self.sample_rate_hz,
            lost_before=lost,
        )

    def close(self) -> None:
        self._runs.clear()


def integrate(
    samples: NDArray[np.complex64],
    poses: Sequence[Pose],
    tag: Tag,
    antenna: AntennaPattern | str,
    *,
    time_ns: int,
    sample_rate_hz: float,
    center_frequency_hz: float,
    frequency_window_hz: float = 500.0,
    false_alarm_probability: float = WHOLE_FLIGHT_FALSE_ALARM,
    most_drift: float = 0.0,
    elevation: Elevation | None = None,
) -> IntegratedRecord:
    """Find a tag too weak for single groups of pulses, from all samples of a flight.

    All pulses are combined over interval, phase, frequency and position, as in ``uavrt
    integrate``.
    `samples`: shape (n,), of the band or of the tag's channel; lost samples are NaN.
    `poses`: of the antenna, in order of time. Samples more than 2 s from any pose are left out.
    `tag`: with its nominal interval and that interval's tolerance.
    `antenna`: pattern, or the name of a known one; ``"monopole"`` is an upright whip.
    `time_ns`: time of the first sample [ns, UTC].
    `sample_rate_hz`, `center_frequency_hz`: rate and centre frequency of the samples.
    `frequency_window_hz`: half-width of the search around the tag's frequency.
    `false_alarm_probability`: probability that noise alone passes for the tag in a flight.
    `most_drift`: largest relative change of the interval over the flight, up or down.
    `elevation`: terrain heights (`uavrt.localization.terrain.elevation_files.open_elevation`);
    None is level ground.
    Returns the record that ``uavrt integrate --json`` prints for a tag.
    Raises `UsageError` if the antenna is unknown, the samples have another shape, or samples
    and poses are of different times; `RecordingError` for too few samples or poses.
    """
    pattern = pattern_named(antenna)
    row = np.asarray(samples, np.complex64)
    if row.ndim != 1:
        raise UsageError(
            f"the samples have the shape {row.shape}, not (n,)", remedy="Use a 1-D array"
        )
    flight = Flight(
        info=FlightInfo(
            directory="the flight",
            start_time_ns=time_ns,
            clock_offset_ns=0,
            tags=(tag,),
            center_frequency_hz=center_frequency_hz,
            sample_rate_hz=sample_rate_hz,
        ),
        settings_json=None,
        pulse_poses=(),
        poses=tuple(poses),
        status_texts=(),
        notes=(),
    )
    source = _Array(
        row,
        time_ns=time_ns,
        sample_rate_hz=sample_rate_hz,
        center_frequency_hz=center_frequency_hz,
    )
    how = WholeFlightOptions(
        pattern=pattern,
        frequency_window_hz=frequency_window_hz,
        false_alarm_probability=false_alarm_probability,
        most_drift=most_drift,
        elevation=elevation,
    )
    (judged,) = integrate_flight(flight, source, [tag], how)
    return integrated_record(judged)
