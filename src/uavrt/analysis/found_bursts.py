"""Put pulses that another program found together to bursts of listed codes.

Pulses first, then gaps: what is left where the samples are gone. With the samples the search
for whole bursts (`uavrt.detection.coded`) hears 3 dB more.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.config import GAP_TOLERANCE_S
from uavrt.errors import UsageError
from uavrt.messages import PulsePose, Tag
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

FREQUENCY_REACH_HZ = 10_000.0
"""A receiver's crystal and the tag's may be off by so much together, at 150 MHz 67 ppm."""
SAME_BURST_HZ = 500.0
"""Pulses of a burst are of one carrier, each measured to some 100 Hz."""
_MOST_APART = 20
"""Bursts between two that confirm each other."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    off_s: float
    """What the gaps differ from the code's, together."""
    tag: Tag
    pulses: tuple[int, ...]


def bursts_of_pulses(pulse_poses: Sequence[PulsePose], tags: Sequence[Tag]) -> list[PulsePose]:
    """Find the bursts of listed codes among pulses.

    Each pulse belongs to one burst at most, to that whose gaps fit best; another code that fits
    the same pulses is named in it. A burst is confirmed where another of its tag lies whole
    burst intervals away.

    Parameters
    ----------
    pulse_poses : sequence of PulsePose
        Pulses, whatever numbers they have.
    tags : sequence of Tag
        Those with codes are looked for.

    Raises
    ------
    UsageError
        No listed tag has a code.
    """
    coded = [tag for tag in tags if tag.coded]
    if not coded:
        raise UsageError("no tag of the list has a code", remedy="Give a list with gaps")
    ordered = sorted(pulse_poses, key=lambda one: one.pulse.start_time_ns)
    if not ordered:
        return []
    first_ns = ordered[0].pulse.start_time_ns
    times_s = np.array(
        [(one.pulse.start_time_ns - first_ns) / NANOSECONDS_PER_SECOND for one in ordered]
    )
    frequencies_hz = np.array([one.pulse.frequency_hz for one in ordered])
    found = [c for tag in coded for c in _candidates(tag, times_s, frequencies_hz)]
    taken: dict[int, int] = {}
    chosen: list[tuple[_Candidate, list[int]]] = []
    for one in sorted(found, key=lambda each: (each.off_s, each.tag.tag_id)):
        owners = {taken[place] for place in one.pulses if place in taken}
        if owners:
            if len(owners) == 1 and chosen[owner := owners.pop()][0].pulses == one.pulses:
                chosen[owner][1].append(one.tag.tag_id)
            continue
        taken |= dict.fromkeys(one.pulses, len(chosen))
        chosen.append((one, []))
    bursts = [_burst(ordered, one, others) for one, others in chosen]
    bursts.sort(key=lambda one: one.pulse.start_time_ns)
    return _confirmed(bursts, {tag.tag_id: tag for tag in coded})


def _candidates(
    tag: Tag, times_s: NDArray[np.float64], frequencies_hz: NDArray[np.float64]
) -> list[_Candidate]:
    """Find where all pulses of a code are, each where it should be after the first."""
    starts = np.flatnonzero(np.abs(frequencies_hz - tag.frequency_hz) <= FREQUENCY_REACH_HZ)
    places = [starts]
    for after_s in np.cumsum(tag.gaps_s):
        wanted_s = times_s[starts] + after_s
        right = np.clip(np.searchsorted(times_s, wanted_s), 1, len(times_s) - 1)
        nearer = wanted_s - times_s[right - 1] < times_s[right] - wanted_s
        places.append(np.where(nearer, right - 1, right))
    if len(times_s) < len(places):
        return []
    at = np.stack(places)
    gaps_s = np.diff(times_s[at], axis=0)
    off_s = np.abs(gaps_s - np.array(tag.gaps_s)[:, None]).sum(axis=0)
    apart_hz = np.ptp(frequencies_hz[at], axis=0)
    good = (off_s <= GAP_TOLERANCE_S) & (apart_hz <= SAME_BURST_HZ) & (gaps_s > 0).all(axis=0)
    return [
        _Candidate(float(off_s[k]), tag, tuple(map(int, at[:, k])))
        for k in np.flatnonzero(good)
    ]


def _burst(ordered: Sequence[PulsePose], one: _Candidate, others: Sequence[int]) -> PulsePose:
    inside = [ordered[place].pulse for place in one.pulses]
    snr_db = 10.0 * math.log10(
        sum(10.0 ** (pulse.snr_db / 10.0) for pulse in inside) / len(inside)
    )
    start_ns = inside[0].start_time_ns
    pulse = replace(
        inside[0],
        tag_id=one.tag.tag_id,
        frequency_hz=sum(pulse.frequency_hz for pulse in inside) / len(inside),
        end_time_ns=start_ns + ns_from_s(one.tag.length_s),
        snr_db=snr_db,
        group_snr_db=snr_db,
        detection_status="detected",
        confirmed=False,
        also_possible_tag_ids=tuple(others),
        burst_starts_ns=tuple(pulse.start_time_ns for pulse in inside),
        burst_snrs_db=tuple(pulse.snr_db for pulse in inside),
    )
    return PulsePose(pulse=pulse, pose=ordered[one.pulses[0]].pose)


def _confirmed(bursts: Sequence[PulsePose], tags: dict[int, Tag]) -> list[PulsePose]:
    """Confirm the bursts that others of their tag agree with."""
    of_tag: dict[int, list[int]] = {}
    for one in bursts:
        of_tag.setdefault(one.pulse.tag_id, []).append(one.pulse.start_time_ns)
    return [
        replace(one, pulse=replace(one.pulse, detection_status="confirmed", confirmed=True))
        if not one.pulse.also_possible_tag_ids
        and _in_step(one.pulse.start_time_ns, of_tag[one.pulse.tag_id], tags[one.pulse.tag_id])
        else one
        for one in bursts
    ]


def _in_step(time_ns: int, times_ns: Sequence[int], tag: Tag) -> bool:
    """Whether another burst lies whole intervals away, which are off by what is listed.

    The times of two bursts may be off by as much as the gaps of one.
    """
    interval_s = tag.pulse_intervals_s[0]
    for other_ns in times_ns:
        apart_s = abs(other_ns - time_ns) / NANOSECONDS_PER_SECOND
        count = round(apart_s / interval_s)
        if 1 <= count <= _MOST_APART and (
            abs(apart_s - count * interval_s)
            <= count * tag.interval_uncertainty_s + GAP_TOLERANCE_S
        ):
            return True
    return False
