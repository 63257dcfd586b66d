"""Convert whole-flight results to stored records and to pulses with the status *integrated*."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from uavrt.analysis.covered.silence import SilentMap
from uavrt.analysis.inputs.flown_with import flight_settings
from uavrt.analysis.inputs.listening_times import listened_in
from uavrt.analysis.integrated.fold_pictures import best_place, fold_of
from uavrt.analysis.whole_flights.judged_flights import LEAST_PART, IntegratedTag
from uavrt.config.settings import AntennaSettings
from uavrt.core.clock import iso_intervals
from uavrt.core.messages import Pulse, PulsePose
from uavrt.core.units import db_from_power, ns_from_s
from uavrt.drone.processes.recording.missing_poses import REACH_NS, pose_from_records
from uavrt.flight.integrated import IntegratedPart, IntegratedVerdict, Ring, write_integrated
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.whole_flight.heard_train import HeardTrain
from uavrt.localization.whole_flight.single_slots import SlotEvidence, slot_evidence
from uavrt.localization.whole_flight.train_place import PlaceBelief

PLACE_FIELDS = (
    *("level_db", "bearing_deg", "arc50_deg", "arc95_deg"),
    *("latitude_deg", "longitude_deg", "radius50_m", "radius95_m"),
)
"""Names of the fields that describe a tag's position in result records."""
_DECIMALS = 7
"""Number of decimals of stored coordinates in degrees; the seventh decimal is 1 cm."""
_SAME = 0.25
"""Largest time between an expected pulse and the same pulse as detected in flight, as a share
of the pulse interval.

After lost samples, times recorded in flight are off by tens of milliseconds."""


def save_integrated(
    flight: Flight,
    results: Sequence[IntegratedTag],
    silent: Mapping[int, SilentMap] | None = None,
) -> Path:
    """Write a flight's whole-flight results and pulses into its folder ``integrated/``.

    Pulses that are already in the flight's log are excluded. `silent` contains maps of tags
    that were not found.
    """
    pulses: list[PulsePose] = []
    verdicts = []
    for one in results:
        own = integrated_pulses(flight, one)
        verdict, found = _verdict(flight, one, len(own)), (silent or {}).get(one.tag.tag_id)
        verdicts.append(replace(verdict, silent=None if found is None else found.around))
        pulses += own
    folds = [fold_of(one) for one in results]
    return write_integrated(flight.info.directory, verdicts, pulses, folds)


def integrated_pulses(flight: Flight, result: IntegratedTag) -> list[PulsePose]:
    """Pulses that whole-flight analysis found in addition to those detected in flight.

    These are the expected pulses whose energy is one that noise alone reaches in at most 5 % of
    cases. Their score, group and noise density are unknown.
    """
    if not result.found:
        return []
    settings = flight_settings(flight)
    antenna = AntennaSettings() if settings is None else settings.antenna
    tag, train = result.tag, result.pulses
    further = slots_of(result).supported & ~_heard_live(flight, result)
    pose_times_ns = [pose.time_ns for pose in flight.poses]
    level_db = math.nan if result.place is None else result.place.level_db
    found = []
    for number, (time_ns, energy) in enumerate(
        zip(result.pulse_times_ns.tolist(), train.energy.tolist(), strict=True), start=1
    ):
        if not further[number - 1]:
            continue
        pulse = Pulse(
            tag_id=tag.tag_id,
            frequency_hz=tag.frequency_hz + train.offset_hz,
            start_time_ns=time_ns,
            end_time_ns=time_ns + ns_from_s(tag.length_s),
            snr_db=db_from_power(energy - 1.0),
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
        found.append(pose_from_records(pulse, flight.poses[first:last], antenna))
    return found


def slots_of(result: IntegratedTag) -> SlotEvidence:
    """Two masks of a train's expected pulses: sent at its rate, and above the noise."""
    rates = len(result.tag.pulse_intervals_s)
    heard = HeardTrain.among(result.energies, result.pulses, result.places, rates=rates)
    places = result.places
    gain = np.interp(result.pulses.time_s, places.time_s, places.gain[best_place(result)])
    return slot_evidence(heard, gain)


def _heard_live(
    flight: Flight, result: IntegratedTag
) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Mask of a pulse train's expected pulses that were also detected in flight."""
    live_ns = np.sort(_live_ns(flight, result.tag.tag_id))
    reach_ns = ns_from_s(_SAME * result.pulses.interval_s)
    times_ns = result.pulse_times_ns
    low, high = np.searchsorted(live_ns, (times_ns - reach_ns, times_ns + reach_ns))
    return np.asarray(high > low)


def verdict_of(flight: Flight, one: IntegratedTag) -> IntegratedVerdict:
    """Record of a whole-flight result for one tag, as it is stored with the flight."""
    return _verdict(flight, one, len(integrated_pulses(flight, one)))


def _verdict(flight: Flight, one: IntegratedTag, pulses: int) -> IntegratedVerdict:
    live = 0
    if one.found:
        live = int(np.count_nonzero(slots_of(one).at_rate & _heard_live(flight, one)))
    return IntegratedVerdict(
        tag_id=one.tag.tag_id,
        found=one.found,
        false_alarm_probability=float(one.train.false_alarm_probability),
        interval_s=float(one.pulses.interval_s),
        frequency_hz=float(one.tag.frequency_hz + one.pulses.offset_hz),
        **_placed(one.place),
        pulses=pulses,
        flights=one.flights,
        heard_live=live,
        remarks="; ".join((*_ambiguity(one), *one.remarks)),
        ambiguous=one.ambiguous is not None,
        # None at all is a stretch of no length: empty, it would count as not known.
        listened=iso_intervals(listened_in(one.energies) or ((one.energies.start_ns,) * 2,)),
        searched=one.searched,
    )


def _placed(place: PlaceBelief | None) -> dict[str, Any]:
    """Fields of the stored record that describe the tag's position; empty if there is none."""
    if place is None:
        return {}
    parts = parts_of(place)
    return {
        **{name: float(getattr(place, name)) for name in PLACE_FIELDS},
        "places": max(1, len(parts)),
        "parts": parts,
        "region50": rings_of(place, 0.5),
        "region95": rings_of(place, 0.95),
    }


def _ambiguity(one: IntegratedTag) -> tuple[str, ...]:
    """Sentence about another pulse train that may be this tag's; empty if there is none."""
    other = one.ambiguous
    if other is None or other.ratio is None:
        return ()
    above, below = other.ratio
    return (
        f"ambiguous: pulses on the tag's frequency, every {other.interval_s:.4f} s "
        f"({above}/{below} of its interval), may come from this tag",
    )


def parts_of(
    place: PlaceBelief, least_probability: float = LEAST_PART
) -> tuple[IntegratedPart, ...]:
    """Separate regions in which the tag may be, with their probabilities, most likely first."""
    return tuple(
        IntegratedPart(
            latitude_deg=part.latitude_deg,
            longitude_deg=part.longitude_deg,
            radius95_m=part.radius95_m,
            probability=part.probability,
        )
        for part in place.cells.parts()
        if part.probability >= least_probability
    )


def rings_of(place: PlaceBelief, share: float) -> tuple[Ring, ...]:
    """Outlines (latitude, longitude) of the smallest region that contains the tag with
    probability `share`.
    """
    return tuple(
        tuple(
            (round(latitude, _DECIMALS), round(longitude, _DECIMALS))
            for latitude, longitude in ring
        )
        for ring in place.cells.outlines(share)
    )


def _live_ns(flight: Flight, tag_id: int) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    own = [one.pulse for one in flight.pulse_poses if one.pulse.tag_id == tag_id]
    return np.array([pulse.start_time_ns for pulse in own], np.int64)
