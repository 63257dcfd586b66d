"""What a whole flight showed of a tag, as pulses among the others, marked *integrated*."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavrt.analysis.fold_pictures import fold_of
from uavrt.analysis.measure import flight_settings
from uavrt.analysis.whole_flight import LEAST_PART, IntegratedTag
from uavrt.config import AntennaSettings
from uavrt.integration import PlaceBelief
from uavrt.messages import Pulse, PulsePose
from uavrt.processes import REACH_NS, made_up
from uavrt.recording import Flight, IntegratedVerdict, write_integrated
from uavrt.units import db_from_power, ns_from_s

_SAME_S = 0.01
"""Beside pulse width and jitter: a pulse of the train and one heard in flight are the same."""


def save_integrated(flight: Flight, results: Sequence[IntegratedTag]) -> Path:
    """Write verdicts and pulses seen in hindsight beside a flight, as ``integrated/``.

    Pulses that the flight's own log has are not written again, so nothing is counted twice.

    Parameters
    ----------
    flight : Flight
        With `info.directory` where it lies.
    results : sequence of IntegratedTag
        Of `integrate_flight` or `integrate_kept`.

    Returns
    -------
    Path
        The directory that was written.

    Raises
    ------
    RecordingError
        It cannot be written.
    FormatError
        What is there already cannot be read.
    """
    pulses: list[PulsePose] = []
    verdicts = []
    for one in results:
        own = integrated_pulses(flight, one)
        verdicts.append(_verdict(one, len(own)))
        pulses += own
    folds = [fold_of(one) for one in results]
    return write_integrated(flight.info.directory, verdicts, pulses, folds)


def integrated_pulses(flight: Flight, result: IntegratedTag) -> list[PulsePose]:
    """Pulses of a train that was found, without those that were heard in flight.

    `snr_db` is the energy in the pulse's slot less the mean of noise, unknown where the noise
    has more: single values are rough, and too great by up to 2 dB where the jitter leaves a
    choice. Score, group and noise density are those of no group, hence unknown.

    Parameters
    ----------
    flight : Flight
        Its poses and pulses.
    result : IntegratedTag
        None are made of a tag that was not found.
    """
    if not result.found:
        return []
    settings = flight_settings(flight)
    antenna = AntennaSettings() if settings is None else settings.antenna
    tag, train = result.tag, result.pulses
    live_ns = np.sort(_live_ns(flight, tag.tag_id))
    same_ns = ns_from_s(tag.pulse_width_s + tag.interval_jitter_s + _SAME_S)
    pose_times_ns = [pose.time_ns for pose in flight.poses]
    level_db = math.nan if result.place is None else result.place.level_db
    found = []
    for number, (time_ns, energy) in enumerate(
        zip(result.pulse_times_ns.tolist(), train.energy.tolist(), strict=True), start=1
    ):
        if _near(live_ns, time_ns, same_ns):
            continue
        pulse = Pulse(
            tag_id=tag.tag_id,
            frequency_hz=tag.frequency_hz + train.offset_hz,
            start_time_ns=time_ns,
            end_time_ns=time_ns + ns_from_s(tag.length_s),
            snr_db=db_from_power(energy - 1.0) if energy > 1.0 else math.nan,
            group_snr_db=level_db,
            score=math.nan,
            group_index=number,
            group_sequence=0,
            noise_psd=math.nan,
            detection_status="integrated",
            confirmed=False,
            rate=result.train.rate,
            predicted_next_start_ns=None,
            predicted_next_end_ns=None,
        )
        first = bisect_left(pose_times_ns, time_ns - REACH_NS)
        last = bisect_right(pose_times_ns, time_ns + REACH_NS)
        found.append(made_up(pulse, flight.poses[first:last], antenna))
    return found


def verdict_of(flight: Flight, one: IntegratedTag) -> IntegratedVerdict:
    """Sum up what a flight shows of a tag."""
    return _verdict(one, len(integrated_pulses(flight, one)))


def _verdict(one: IntegratedTag, pulses: int) -> IntegratedVerdict:
    place = one.place
    train = len(one.pulses.time_s) if one.found else 0
    return IntegratedVerdict(
        tag_id=one.tag.tag_id,
        found=one.found,
        false_alarm_probability=float(one.train.false_alarm_probability),
        interval_s=float(one.pulses.interval_s),
        frequency_hz=float(one.tag.frequency_hz + one.pulses.offset_hz),
        level_db=None if place is None else float(place.level_db),
        bearing_deg=None if place is None else float(place.bearing_deg),
        arc50_deg=None if place is None else float(place.arc50_deg),
        arc95_deg=None if place is None else float(place.arc95_deg),
        latitude_deg=None if place is None else float(place.latitude_deg),
        longitude_deg=None if place is None else float(place.longitude_deg),
        radius50_m=None if place is None else float(place.radius50_m),
        radius95_m=None if place is None else float(place.radius95_m),
        places=1 if place is None else _places(place),
        pulses=pulses,
        flights=one.flights,
        heard_live=train - pulses,
        remarks="; ".join(one.limitations),
    )


def _places(place: PlaceBelief) -> int:
    """How many places the flight cannot tell apart."""
    return max(1, sum(part.probability >= LEAST_PART for part in place.cells.parts()))


def _live_ns(flight: Flight, tag_id: int) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Beginnings of a tag's pulses in the flight's own log."""
    own = [one.pulse for one in flight.pulse_poses if one.pulse.tag_id == tag_id]
    return np.array([pulse.start_time_ns for pulse in own], np.int64)


def _near(
    times_ns: "np.ndarray[tuple[int], np.dtype[np.int64]]", time_ns: int, reach_ns: int
) -> bool:
    low, high = np.searchsorted(times_ns, (time_ns - reach_ns, time_ns + reach_ns))
    return bool(high > low)
