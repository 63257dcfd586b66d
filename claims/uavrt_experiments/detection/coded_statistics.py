"""False identities near unlisted coded tags, for hundreds of hours: statistics, no samples.

Times and strengths of the pulses present are drawn, and from them the energies at the places of
each listed code that some of them hit. The detector's own code evaluates these energies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from uavrt.config.tags.code_rules import GAP_TOLERANCE_S
from uavrt.core.messages import Tag
from uavrt.core.units import ns_from_s
from uavrt.detection.coded.code_evidence import evidence, evidence_of_sums, required_evidence
from uavrt.detection.coded.code_judging import least_pulses, may_suffice, scores_of
from uavrt.detection.coded.identity import Sighting, Sightings
from uavrt.detection.coded.limits import amplitude_limit, sum_limit
from uavrt.detection.coded.tuning import IDENTITY, LIKELIHOOD, LIMITS, SHAPE, SUMS

WIDTH_S = 0.0025
_WINDOW_HZ = 1000.0
_CHOICES = 7
"""Number of independent cells of noise among which the search chooses at each place."""
_SHIFTS_S = (-6e-4, 0.0, 6e-4)
"""Time offsets tried around that of a pulse [s]."""
_LOOKS = 20
"""Number of independent choices for several bursts, whose interval is searched too."""
_COLUMN_S = 1.4e-4
"""Largest common offset of all pulses from the cells, half of a column [s]."""
_LEAST = 0.2
"""Least share of a pulse's amplitude at which other pulses are counted with it."""
_ALIKE = 0.3
"""Minimum ratio of energies at a burst's weakest and second weakest pulse for it to be
searched."""
_ROW_HZ = 125.0
_CLIPS = {3: 15.75, 10: 10.0}
"""Limit of a cell [noise powers] in sums of this number of bursts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stranger:
    """A coded tag that sends but is not listed."""

    tag: Tag
    enr_db: float
    offset_hz: float
    first_s: float


def codes_and_strangers(
    rng: np.random.Generator, codes: int = 50, strangers: int = 10
) -> tuple[list[Tag], list[Stranger]]:
    """Draw listed codes at least 5 ms apart, and unlisted tags whose codes are 9 ms from all of
    them.
    """
    listed: list[NDArray[np.float64]] = []
    others: list[NDArray[np.float64]] = []
    while len(listed) < codes:
        gaps_ms = np.round(rng.uniform(17.0, 75.0, 3) * 4.0) / 4.0
        if all(np.abs(gaps_ms - other).sum() >= 5.0 for other in listed):
            listed.append(gaps_ms)
    while len(others) < strangers:
        gaps_ms = np.round(rng.uniform(17.0, 75.0, 3) * 4.0) / 4.0
        if all(np.abs(gaps_ms - other).sum() >= 9.0 for other in listed):
            others.append(gaps_ms)
    tags = [
        Tag(
            tag_id=number + 1,
            frequency_hz=166_380_000.0,
            pulse_width_s=WIDTH_S,
            pulse_intervals_s=(float(np.round(rng.uniform(4.5, 9.5), 3)),),
            interval_uncertainty_s=0.004,
            k=10,
            gaps_s=tuple(float(gap) / 1e3 for gap in gaps_ms),
        )
        for number, gaps_ms in enumerate([*listed, *others])
    ]
    return tags[:codes], [
        Stranger(
            tag=tag,
            enr_db=rng.uniform(8.0, 30.0),
            offset_hz=rng.uniform(-400.0, 400.0),
            first_s=rng.uniform(0.0, 5.0),
        )
        for tag in tags[codes:]
    ]


def _places_s(tag: Tag) -> NDArray[np.float64]:
    return np.concatenate(((0.0,), np.cumsum(tag.gaps_s)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _OnAir:
    """Pulses of the unlisted tags, in order of time, and pairs of them within a
    burst's length.
    """

    times_s: NDArray[np.float64]
    amplitudes: NDArray[np.float64]
    offsets_hz: NDArray[np.float64]
    apart_s: NDArray[np.float64]
    """Time from the first to the second pulse of each pair [s], sorted."""
    pairs: NDArray[np.intp]


def _on_air(strangers: Sequence[Stranger], seconds: float, length_s: float) -> _OnAir:
    parts = []
    for one in strangers:
        interval_s = one.tag.pulse_intervals_s[0]
        starts_s = np.arange(one.first_s, seconds - 1.0, interval_s)
        times_s = (starts_s[:, None] + _places_s(one.tag)).ravel()
        level = np.full(len(times_s), 10.0 ** (0.05 * one.enr_db))
        parts.append(np.stack((times_s, level, np.full(len(times_s), one.offset_hz))))
    pulses = np.concatenate(parts, axis=1)
    times_s, amplitudes, offsets_hz = pulses[:, pulses[0].argsort()]
    pairs = []
    for step in range(1, 40):
        first = np.flatnonzero(times_s[step:] - times_s[:-step] <= length_s)
        if not len(first):
            break
        second = first + step
        level = amplitudes[second] * np.abs(
            np.sinc((offsets_hz[second] - offsets_hz[first]) * WIDTH_S)
        )
        loud = level > _LEAST * amplitudes[first]
        pairs.append(np.stack((first[loud], second[loud])))
    both = np.concatenate(pairs, axis=1)
    apart_s = times_s[both[1]] - times_s[both[0]]
    order = apart_s.argsort()
    return _OnAir(
        times_s=times_s,
        amplitudes=amplitudes,
        offsets_hz=offsets_hz,
        apart_s=apart_s[order],
        pairs=both[:, order],
    )


def _complex_noise(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.complex128]:
    parts = rng.standard_normal((*shape, 2)) * np.sqrt(0.5)
    return np.asarray(parts[..., 0] + 1j * parts[..., 1])


@dataclass(slots=True, kw_only=True)
class _Found:
    """Energies at a code's places, in order of time."""

    times_s: NDArray[np.float64]
    alone: NDArray[np.float64]
    own: NDArray[np.bool_]
    unlisted: NDArray[np.float64]
    rows: NDArray[np.intp]


def _single(rng: np.random.Generator, air: _OnAir, tag: Tag, foreign_per_hour: float) -> _Found:
    """Candidate bursts for one code: at least two of the pulses present are at its places."""
    places_s = _places_s(tag)
    stretch_s = GAP_TOLERANCE_S * places_s / places_s[-1]
    limits = {
        count: sum_limit(
            tag,
            bandwidth_hz=_WINDOW_HZ,
            bursts=1,
            pulses=count,
            false_per_hour=LIMITS.false_per_hour,
        )
        for count in range(least_pulses(len(places_s)), len(places_s) + 1)
    }
    parts = []
    for one, other in combinations(range(len(places_s)), 2):
        reach_s = stretch_s[other] - stretch_s[one] + 0.5 * WIDTH_S
        gap_s = places_s[other] - places_s[one]
        low, high = np.searchsorted(air.apart_s, (gap_s - reach_s, gap_s + reach_s))
        aligned = air.pairs[0, low:high]
        begin_s = air.times_s[aligned] - places_s[one]
        levels, away_s = _levels(air, aligned, begin_s, places_s, stretch_s)
        # Each coincidence once: by the first two of its pulses.
        loud = levels > _LEAST * air.amplitudes[aligned][:, None]
        first = loud[:, one] & loud[:, other] & (loud[:, :other].sum(axis=1) == 1)
        columns = begin_s, air.offsets_hz[aligned], levels, away_s
        parts.append([column[first] for column in columns])
    begin_s, offset_hz, levels, away_s = map(np.concatenate, zip(*parts, strict=True))
    noise = _complex_noise(rng, (*levels.shape, _CHOICES))
    most = (np.abs(levels[:, :, None] + noise) ** 2).max(axis=2).astype(np.float32)
    able = may_suffice(most, limits)
    begin_s, offset_hz = begin_s[able], offset_hz[able]
    energies, straight = _searched(levels[able], away_s[able], noise[able], stretch_s)
    judged = evidence(
        energies, np.ones(energies.shape, np.bool_), foreign_per_hour=foreign_per_hour
    )
    taken = straight & (judged.over_unlisted >= LIKELIHOOD.least_log)
    taken &= scores_of(energies, judged.own, limits) >= 1.0
    order = np.flatnonzero(taken)[begin_s[taken].argsort()]
    return _Found(
        times_s=begin_s[order],
        alone=judged.alone[order],
        own=judged.own[order],
        unlisted=judged.over_unlisted[order],
        rows=np.rint(offset_hz[order] / _ROW_HZ).astype(np.intp),
    )


def _levels(
    air: _OnAir,
    aligned: NDArray[np.intp],
    begin_s: NDArray[np.float64],
    places_s: NDArray[np.float64],
    stretch_s: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Amplitude of the strongest pulse at each place, and its time offset from the place."""
    levels = np.zeros((len(begin_s), len(places_s)))
    away_s = np.zeros(levels.shape)
    best = np.zeros(levels.shape)
    for place, wanted_s in enumerate((begin_s[:, None] + places_s).T):
        right = np.searchsorted(air.times_s, wanted_s)
        for near in (right - 1, right):
            at = np.clip(near, 0, len(air.times_s) - 1)
            off_s = air.times_s[at] - wanted_s
            over_s = np.maximum(np.abs(off_s) - stretch_s[place] - _SHIFTS_S[-1], 0.0)
            apart_hz = air.offsets_hz[at] - air.offsets_hz[aligned]
            level = air.amplitudes[at] * np.abs(np.sinc(apart_hz * WIDTH_S))
            heard = level * np.maximum(1.0 - over_s / WIDTH_S, 0.0)
            louder = heard > best[:, place]
            best[louder, place] = heard[louder]
            levels[louder, place], away_s[louder, place] = level[louder], off_s[louder]
    return levels, away_s


def _searched(
    levels: NDArray[np.float64],
    away_s: NDArray[np.float64],
    noise: NDArray[np.complex128],
    stretch_s: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Energies at the largest sum, as in the detector's search over stretch and time.

    Also returns True if no pulse is farther off its place than the others.
    """
    best = np.zeros(levels.shape)
    straight = np.zeros(len(levels), np.bool_)
    for part in SUMS.stretches:
        for shift_s in _SHIFTS_S:
            moved_s = shift_s + part * stretch_s
            off_s = away_s - moved_s
            heard = levels * np.maximum(1.0 - np.abs(off_s) / WIDTH_S, 0.0)
            which = np.rint(moved_s / _SHIFTS_S[-1]).astype(np.intp) + _CHOICES // 2
            which = np.clip(which, 0, _CHOICES - 1)
            energies = np.abs(heard + noise[:, np.arange(len(stretch_s)), which]) ** 2
            better = energies.sum(axis=1) > best.sum(axis=1)
            best[better] = energies[better]
            sent = (heard > 1.0)[better]
            usual_s = (off_s[better] * sent).sum(axis=1) / np.maximum(sent.sum(axis=1), 1)
            allowed_s = SHAPE.aside_s + SHAPE.aside_noise_s / np.maximum(levels[better], 1.0)
            aside = sent & (np.abs(off_s[better] - usual_s[:, None]) > allowed_s)
            straight[better] = ~aside.any(axis=1)
    return best, straight


def _confirmed(tag: Tag, found: _Found, foreign_per_hour: float) -> bool:
    """True if the detector would confirm a tag by such bursts."""
    required = required_evidence(foreign_per_hour, LIMITS.false_per_hour)
    open_ = found.unlisted >= required
    # Only bursts that others lie in step with can be confirmed by these.
    for step in range(1, IDENTITY.steps + 1):
        window_s = 1e-3 + step * tag.interval_uncertainty_s
        wanted_s = found.times_s + step * tag.pulse_intervals_s[0]
        low = np.searchsorted(found.times_s, wanted_s - window_s)
        high = np.searchsorted(found.times_s, wanted_s + window_s)
        open_ |= low < high
        for begin, end in zip(low[low < high], high[low < high], strict=True):
            open_[begin:end] = True
    sightings = Sightings()
    for place in np.flatnonzero(open_).tolist():
        start_ns = ns_from_s(float(found.times_s[place])) + 1
        sighting = Sighting(
            tags=(tag,),
            hit=(),
            start_ns=start_ns,
            starts_ns=[start_ns],
            energies=np.ones(1),
            offset_hz=0.0,
            noise=1.0,
            row=int(found.rows[place]),
            score=1.0,
            alone=found.alone[place],
            good=found.own[place],
            unlisted=float(found.unlisted[place]),
            required=required,
        )
        named = sightings.identify([sighting], start_ns, last=False)
        if any(one.tag_id is not None for one, _, _ in named):
            return True
    return False


def _summed(
    rng: np.random.Generator,
    tag: Tag,
    one: Stranger,
    *,
    bursts: int,
    windows: int,
    foreign_per_hour: float,
) -> bool:
    """True if sums of several bursts of an unlisted tag, in step with a code, are mistaken for
    it.
    """
    places_s, sent_s = _places_s(tag), _places_s(one.tag)
    clip = _CLIPS[bursts]
    least = amplitude_limit(
        tag,
        bandwidth_hz=_WINDOW_HZ,
        bursts=bursts,
        pulses=bursts * len(places_s),
        false_per_hour=LIMITS.false_per_hour,
    )
    in_step = 2.0 * (tag.interval_uncertainty_s + 1e-3) / tag.pulse_intervals_s[0]
    required = required_evidence(foreign_per_hour, LIMITS.false_per_hour)
    for aligned in range(len(places_s)):
        for sent in range(len(sent_s)):
            away_s = np.abs(
                (places_s - places_s[aligned])[:, None] - (sent_s - sent_s[sent])
            ).min(axis=1)
            reach_s = GAP_TOLERANCE_S * np.abs(places_s - places_s[aligned]) / places_s[-1]
            away_s = np.maximum(away_s - reach_s - _COLUMN_S, 0.0)
            levels = 10.0 ** (0.05 * one.enr_db) * np.maximum(1.0 - away_s / WIDTH_S, 0.0)
            if (levels > 0.0).sum() < 3:
                continue
            shape = windows, _LOOKS, len(places_s), bursts
            energies = np.abs(levels[:, None] + _complex_noise(rng, shape)) ** 2
            energies = np.minimum(energies, clip)
            # The three most alike places are one tag's; what the fourth is decides.
            looks = energies[np.sqrt(energies).sum(axis=(2, 3)) >= least]
            least_place = np.sort(looks.sum(axis=2), axis=1)
            looks = looks[least_place[:, 0] >= _ALIKE * least_place[:, 1]]
            if not len(looks):
                continue
            unlisted = evidence_of_sums(
                looks.transpose(0, 2, 1), foreign_per_hour=foreign_per_hour, in_step=in_step
            )
            if bool((unlisted >= required).any()):
                return True
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Confusions:
    """Counts of listed tags that were falsely confirmed in a number of hours."""

    code_hours: float
    claims: int
    """Number of bursts that match a listed code."""
    wrong: int
    """Number of falsely confirmed tags in each hour."""
    wrong_by_sums: int
    """Number of tags falsely confirmed by sums of several bursts."""


def confusions(
    rng: np.random.Generator,
    *,
    hours: float = 1.0,
    codes: int = 50,
    strangers: int = 10,
    foreign_per_hour: float | None = None,
) -> Confusions:
    """Count the listed tags that are confirmed while only unlisted ones send.

    `foreign_per_hour`: the detector's estimate of the rate of unlisted bursts; by default the
    true one.
    """
    listed, others = codes_and_strangers(rng, codes, strangers)
    seconds = 3600.0 * hours
    air = _on_air(others, seconds, max(tag.length_s for tag in listed))
    if foreign_per_hour is None:
        foreign_per_hour = sum(3600.0 / one.tag.pulse_intervals_s[0] for one in others)
    claims = wrong = by_sums = 0
    for tag in listed:
        found = _single(rng, air, tag, foreign_per_hour)
        claims += len(found.times_s)
        wrong += _confirmed(tag, found, foreign_per_hour)
        for one in others:
            ratio = tag.pulse_intervals_s[0] / one.tag.pulse_intervals_s[0]
            off_s = abs(ratio - round(ratio)) * one.tag.pulse_intervals_s[0]
            if round(ratio) < 1 or off_s > tag.interval_uncertainty_s:
                continue
            windows = max(1, round(seconds / tag.pulse_intervals_s[0]))
            by_sums += any(
                _summed(
                    *(rng, tag, one),
                    bursts=bursts,
                    windows=windows,
                    foreign_per_hour=foreign_per_hour,
                )
                for bursts in _CLIPS
            )
    return Confusions(
        code_hours=hours * codes, claims=claims, wrong=wrong, wrong_by_sums=by_sums
    )
