"""Determine the noise that the drone itself causes in a flight, from its detectors'
measurements.

A receiver does not measure watts. So the noise is relative to the receiver's quietest time in
the same flight: on the ground with motors off or, without such a time, the quietest tenth of
the values.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.core.errors import RecordingError
from uavrt.flight.reading.flight_reader import Flight, read_flight, read_search_reports
from uavrt.localization.estimates.heard import PoseColumns

_ON_GROUND_M = 2.0
_LEAST = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightNoise:
    """Noise density with motors running, relative to the receiver's noise in a quiet time."""

    tag_id: NDArray[np.int64]
    """Id of the tag at whose frequency each noise value was measured, shape (n,)."""
    time_ns: NDArray[np.int64]
    rise_db: NDArray[np.float64]
    """Noise above the quiet reference at that frequency [dB], shape (n,)."""
    in_the_air: NDArray[np.bool_]
    quiet: str
    """Text that describes the quiet time which is the reference for the noise."""

    @property
    def median_db(self) -> float:
        """Median noise above the quiet reference, measured in the air [dB]."""
        return float(np.median(self.rise_db[self.in_the_air]))

    def at(self, tag_id: int, time_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Noise above the quiet reference for a tag at given times [dB], shape (n,); the median
        if it was not measured at the tag's frequency.
        """
        own = self.tag_id == tag_id
        if not own.any():
            return np.full(len(time_ns), self.median_db)
        known = self.time_ns[own].astype(np.float64)
        return np.asarray(np.interp(time_ns.astype(np.float64), known, self.rise_db[own]))


def flight_noise_of(directory: Path, flight: Flight | None = None) -> FlightNoise:
    """Read the noise measured in a flight. Raises `FormatError`, or `RecordingError` if none
    was measured in the air.
    """
    flight = read_flight(directory) if flight is None else flight
    measured = [
        (one.tag_id, one.time_ns, one.noise_psd) for one in read_search_reports(directory)
    ] + [
        (one.pulse.tag_id, one.pulse.start_time_ns, one.pulse.noise_psd)
        for one in flight.pulse_poses
    ]
    measured = sorted({one for one in measured if np.isfinite(one[2]) and one[2] > 0.0})
    poses = PoseColumns.of(flight.poses)
    if not measured or not len(poses.time_ns):
        raise RecordingError(
            f"{directory} has no noise measurements",
            remedy="Choose a flight recorded by uavrt with poses and a running detector",
        )
    tag_id = np.array([one[0] for one in measured], np.int64)
    time_ns = np.array([one[1] for one in measured], np.int64)
    psd_db = 10.0 * np.log10(np.array([one[2] for one in measured]))
    height = np.interp(
        time_ns.astype(np.float64), poses.time_ns.astype(np.float64), poses.height_m
    )
    flying = poses.time_ns[poses.height_m > _ON_GROUND_M]
    taken_off = flying[0] if len(flying) else np.iinfo(np.int64).max
    before = time_ns < taken_off
    air = height > _ON_GROUND_M
    if not air.any():
        raise RecordingError(
            f"{directory} has no noise measurements from the time in the air",
            remedy="Choose another flight",
        )
    tags = np.unique(tag_id)
    on_ground = all(np.count_nonzero(before & (tag_id == one)) >= _LEAST for one in tags)
    rise_db = np.empty(len(psd_db))
    for one in tags:
        own = tag_id == one
        quiet_db = (
            np.median(psd_db[own & before]) if on_ground else np.quantile(psd_db[own], 0.1)
        )
        rise_db[own] = np.maximum(psd_db[own] - quiet_db, 0.0)
    return FlightNoise(
        tag_id=tag_id,
        time_ns=time_ns,
        rise_db=rise_db,
        in_the_air=air,
        quiet="the noise before take-off" if on_ground else "the quietest tenth of the flight",
    )
