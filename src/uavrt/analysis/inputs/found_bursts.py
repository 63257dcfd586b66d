"""Group pulses that another program found into bursts of listed coded tags, for logs without
samples; with samples, `uavrt.detection.coded` is 3 dB more sensitive.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.config.tags.code_rules import GAP_TOLERANCE_S
from uavrt.core.errors import UsageError
from uavrt.core.messages import PulsePose, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.detection.coded.identity import in_step, likeliest

FREQUENCY_REACH_HZ = 10_000.0
"""Largest frequency error of receiver's and tag's crystals [Hz]: 67 ppm at 150 MHz."""
SAME_BURST_HZ = 500.0
"""Largest frequency difference of a burst's pulses [Hz]; each is measured to 100 Hz."""
_MOST_APART = 20
"""Largest number of burst intervals between two bursts that still confirm each other."""
_SAME_PULSE_S = 1e-3
"""Time within which two records at one frequency are one pulse at two antennas [s]."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    off_s: float
    """Sum of the deviations of a burst's measured gaps from the code's gaps [s]."""
    tag: Tag
    pulses: tuple[int, ...]


def bursts_of_pulses(pulse_poses: Sequence[PulsePose], tags: Sequence[Tag]) -> list[PulsePose]:
    """Find the bursts of listed codes among pulses; the pulses' tag numbers are ignored.

    Each pulse is used in only one burst: the one whose gaps fit best or, if equal, whose burst
    interval fits best. A burst is confirmed if another burst of its tag is a whole number of
    burst intervals away. A pulse that several antennas of a station received is counted once,
    where it is strongest.
    """
    coded = [tag for tag in tags if tag.coded]
    if not coded:
        raise UsageError(
            "the tag list contains no coded tag",
            remedy="Add a coded tag and its gaps to the list",
        )
    ordered = _of_one_antenna(sorted(pulse_poses, key=lambda one: one.pulse.start_time_ns))
    if not ordered:
        return []
    first_ns = ordered[0].pulse.start_time_ns
    times_s = np.array(
        [(one.pulse.start_time_ns - first_ns) / NANOSECONDS_PER_SECOND for one in ordered]
    )
    frequencies_hz = np.array([one.pulse.frequency_hz for one in ordered])
    found = [c for tag in coded for c in _candidates(tag, times_s, frequencies_hz)]
    taken: dict[int, int] = {}
    chosen: list[list[_Candidate]] = []
    for one in sorted(found, key=lambda each: (each.off_s, each.tag.tag_id)):
        owners = {taken[place] for place in one.pulses if place in taken}
        if owners:
            if len(owners) == 1 and chosen[owner := owners.pop()][0].pulses == one.pulses:
                chosen[owner].append(one)
            continue
        taken |= dict.fromkeys(one.pulses, len(chosen))
        chosen.append([one])
    named = _named(chosen, times_s)
    bursts = [_burst(ordered, *one) for one in named]
    return sorted(bursts, key=lambda one: one.pulse.start_time_ns)


def _of_one_antenna(ordered: Sequence[PulsePose]) -> list[PulsePose]:
    """Keep the strongest of pulses that antennas received at one time and frequency."""
    kept: list[PulsePose] = []
    for one in ordered:
        for place in range(len(kept) - 1, -1, -1):
            other = kept[place].pulse
            apart_s = (one.pulse.start_time_ns - other.start_time_ns) / NANOSECONDS_PER_SECOND
            if apart_s > _SAME_PULSE_S:
                kept.append(one)
                break
            if abs(one.pulse.frequency_hz - other.frequency_hz) <= SAME_BURST_HZ:
                if one.pulse.snr_db > other.snr_db:
                    kept[place] = one
                break
        else:
            kept.append(one)
    return kept


def _named(
    chosen: Sequence[Sequence[_Candidate]], times_s: NDArray[np.float64]
) -> list[tuple[_Candidate, list[int], bool]]:
    """Decide by the burst intervals which tag sent each burst.

    Returns for each burst the match with its tag's code, the ids of other possible tags, and
    whether it is confirmed.
    """
    starts_s = np.array([times_s[fits[0].pulses[0]] for fits in chosen])
    of_tag: dict[int, NDArray[np.float64]] = {
        tag_id: np.array(
            [
                start_s
                for fits, start_s in zip(chosen, starts_s.tolist(), strict=True)
                if any(fit.tag.tag_id == tag_id for fit in fits)
            ]
        )
        for tag_id in {fit.tag.tag_id for fits in chosen for fit in fits}
    }
    named = []
    for fits, start_s in zip(chosen, starts_s.tolist(), strict=True):
        # The gaps did not decide between these tags: only their intervals do.
        of_any_s = np.unique(np.concatenate([of_tag[fit.tag.tag_id] for fit in fits]))
        of_any_s = of_any_s[of_any_s != start_s]
        tags = [fit.tag for fit in fits]
        searched_s = float(starts_s.min()), float(starts_s.max())
        places = likeliest(
            *(start_s, tags, [of_any_s] * len(tags)),
            searched_s=searched_s,
            timing_s=GAP_TOLERANCE_S,
        )
        best = places[0]
        _, gains, _ = in_step(
            *(start_s, of_any_s, tags[best], GAP_TOLERANCE_S), most=_MOST_APART
        )
        confirmed = len(places) == 1 and bool(gains.any())
        named.append((fits[best], [tags[place].tag_id for place in places[1:]], confirmed))
    return named


def _candidates(
    tag: Tag, times_s: NDArray[np.float64], frequencies_hz: NDArray[np.float64]
) -> list[_Candidate]:
    """Find all sets of pulses whose spacing matches the gaps of a listed code."""
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


def _burst(
    ordered: Sequence[PulsePose], one: _Candidate, others: Sequence[int], confirmed: bool
) -> PulsePose:
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
        detection_status="confirmed" if confirmed else "detected",
        confirmed=confirmed,
        also_possible_tag_ids=tuple(others),
        burst_starts_ns=tuple(pulse.start_time_ns for pulse in inside),
        burst_snrs_db=tuple(pulse.snr_db for pulse in inside),
    )
    return PulsePose(pulse=pulse, pose=ordered[one.pulses[0]].pose)
