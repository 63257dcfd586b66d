"""Sort detected pulses (points) into trains; a train consists of the pulses of one sender.

A train is refused if its pulses do not agree in frequency, because voice and chance form such
trains. It is doubtful if most points at its frequency belong to no train.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.config.ghost_places import Receiver
from uavrt.detection.beeps.beats import FoundBeat, find_beats
from uavrt.detection.beeps.beep_points import Points
from uavrt.detection.beeps.chains import tolerance_s
from uavrt.detection.beeps.tuning import INTERVALS, LISTENING, TRAINS


@dataclass(frozen=True, slots=True, eq=False)
class Train:
    """Pulses of one sender, with its frequency and intervals."""

    points: Points
    beats: tuple[FoundBeat, ...]
    """Interval of each part of the train; its `members` are indices of pulses in `points`."""
    frequency_hz: float
    level_db: float
    doubt: str | None = None
    """Reason why the train may not be from a tag; None if there is none."""
    image_of_hz: float | None = None
    """Frequency of a stronger train with simultaneous pulses, whose image this train is [Hz];
    None if it is not an image."""
    together: int = 1
    """Number of frequencies with simultaneous pulses of equal strength, including that of this
    train."""

    def moved(self, center_hz: float) -> "Train":
        """Copy of the train at absolute frequencies."""
        image_hz = self.image_of_hz
        return replace(
            self,
            points=self.points.moved(self.points.times_s, center_hz),
            frequency_hz=self.frequency_hz + center_hz,
            image_of_hz=None if image_hz is None else image_hz + center_hz,
        )

    @property
    def interval_s(self) -> float:
        """Interval of the part of the train that has the most pulses [s]."""
        return self._longest.beat.interval_s

    @property
    def interval_sigma_s(self) -> float:
        """Standard deviation of the interval, including the error of the pulses' times [s]."""
        beat = self._longest.beat
        return max(beat.sigma_s, 0.002 / max(int(beat.numbers[-1]), 1))

    @property
    def jitter_s(self) -> float:
        """Scatter of the pulses about the interval [s]."""
        return self._longest.beat.scatter_s

    @property
    def _longest(self) -> FoundBeat:
        return max(self.beats, key=lambda one: one.members.size)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Searched:
    """Search result for one frequency of a live stream, used until enough new pulses follow."""

    frequency_hz: float
    until_s: float
    """Time of the last pulse at this frequency that was searched for trains [s]."""
    points: int
    """Number of pulses at this frequency that were searched for trains."""
    trains: list[Train]
    burst: tuple[float, float] | None
    """Share of the pulses at this frequency that are in bursts, and frequency of these bursts
    [Hz]; None if there are no bursts."""

    def holds(self, times_s: NDArray[np.float64]) -> bool:
        """True if the pulses at this frequency, with times `times_s`, need no new search.

        New pulses that continue known trains require a search only if they are several times as
        many as the old pulses. A few pulses outside the known trains require a search at once.
        """
        new_s = times_s[times_s > self.until_s].tolist()
        ends_s = [
            [float(train.points.times_s[-1]), one.beat.interval_s]
            for train in self.trains
            for one in train.beats
            if one.members.size >= TRAINS.fewest_held
        ]
        others = 0
        for time_s in new_s:
            for end_s in ends_s:
                away_s = time_s - end_s[0]
                off_s = away_s - round(away_s / end_s[1]) * end_s[1]
                if abs(off_s) <= tolerance_s(end_s[1]):
                    end_s[0] = time_s
                    break
            else:
                others += 1
        most = TRAINS.renewing_ratio * self.points if self.points >= TRAINS.fewest_held else 1
        return others <= TRAINS.renewing_share * self.points and len(new_s) < most


def find_trains(
    points: Points, span_s: float, receiver: Receiver, searched: list[Searched] | None = None
) -> tuple[list[Train], list[float]]:
    """Find all trains among detected pulses.

    `receiver`: the radio's centre, on the scale of the points' frequencies, and its rate.
    `searched`: results of the last call for the same live stream, which this call replaces;
    None for a whole recording. Returns (trains, bursts_hz). The strongest train is first;
    images have `Train.image_of_hz`. `bursts_hz`: frequencies with bursts of pulses, as from
    coded tags; that with the largest share of bursts is first.
    """
    free = np.ones(len(points), dtype=bool)
    by_frequency = np.argsort(points.frequencies_hz, kind="stable")
    ordered = points.frequencies_hz[by_frequency]
    results: list[Searched] = []
    fewest = INTERVALS.fewest_pulses if searched is None else LISTENING.live_pulses
    for center_hz in _centers(points, fewest):
        low, high = np.searchsorted(
            ordered, (center_hz - TRAINS.gather_hz, center_hz + TRAINS.gather_hz)
        )
        near = np.sort(by_frequency[low:high])
        near = near[free[near]]
        if near.size < fewest:
            continue
        times_s = points.times_s[near]
        for result in searched or ():
            same = abs(result.frequency_hz - center_hz) <= 2.0 * TRAINS.step_hz
            if same and result.holds(times_s):
                used = np.full(near.size, fill_value=bool(result.trains))
                break
        else:
            result, used = _searched(points.take(near), span_s, center_hz)
        results.append(result)
        free[near[used]] = False
    if searched is not None:
        searched[:] = results
    trains = sorted(
        (train for one in results for train in one.trains), key=lambda one: -one.level_db
    )
    suspects = sorted((one.burst for one in results if one.burst), reverse=True)
    return _with_images(trains, receiver), [frequency_hz for _, frequency_hz in suspects]


def _searched(
    here: Points, span_s: float, center_hz: float
) -> tuple[Searched, NDArray[np.bool_]]:
    beats = find_beats(here.times_s, span_s, TRAINS.most_intervals)
    found = [
        (train, members)
        for group in _of_one_sender(beats, here)
        for train, members in [_train(group, here)]
        if _scatter_hz(train.points) <= TRAINS.most_scatter_hz
    ]
    used = np.zeros(len(here), dtype=bool)
    for _, members in found:
        used[members] = True
    share = _burst_share(here.times_s, span_s)
    result = Searched(
        frequency_hz=center_hz,
        until_s=float(here.times_s[-1]),
        points=len(here),
        trains=_with_doubt([train for train, _ in found], here, used) if found else [],
        burst=(share, float(np.median(here.frequencies_hz))) if share else None,
    )
    return result, used


def split_bursts(times_s: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Group pulse times into bursts of 2 to 8 pulses."""
    bursts = np.split(times_s, np.flatnonzero(np.diff(times_s) > TRAINS.burst_gap_s) + 1)
    return [one for one in bursts if 2 <= len(one) <= TRAINS.most_in_burst]


def _burst_share(times_s: NDArray[np.float64], span_s: float) -> float:
    """Share of the pulses in bursts; 0 if bursts are too frequent for a coded tag."""
    bursts = split_bursts(times_s)
    share = sum(one.size for one in bursts) / times_s.size
    rare = TRAINS.fewest_bursts <= len(bursts) <= TRAINS.most_bursts_per_s * span_s
    return share if rare and share >= TRAINS.burst_share else 0.0


def _centers(points: Points, fewest: int) -> list[float]:
    """Frequencies [Hz] with at least `fewest` pulses around them, the strongest first."""
    if len(points) < fewest:
        return []
    low_hz = float(points.frequencies_hz.min()) - 2.0 * TRAINS.gather_hz
    place = np.round((points.frequencies_hz - low_hz) / TRAINS.step_hz).astype(np.intp)
    reach = round(TRAINS.gather_hz / TRAINS.step_hz)
    size = int(place.max()) + 2 * reach + 1
    weight = np.bincount(place, np.maximum(points.levels_db, 0.1), size)
    count = np.bincount(place, minlength=size)
    half = reach // 2
    weights = np.convolve(weight, np.ones(2 * half + 1), mode="same")
    counts = np.convolve(count, np.ones(2 * reach + 1), mode="same")
    tops = np.flatnonzero((weights > 0.0) & (counts >= fewest))
    around = np.pad(weights, reach)[tops[:, None] + np.arange(2 * reach + 1)]
    tops = tops[weights[tops] >= around.max(axis=1)]
    # Equal neighbours are one maximum.
    tops = tops[np.diff(tops, prepend=-2) > 1]
    return [float(low_hz + TRAINS.step_hz * top) for top in tops[np.argsort(-weights[tops])]]


def _train(group: Sequence[FoundBeat], here: Points) -> tuple[Train, NDArray[np.intp]]:
    members = np.unique(np.concatenate([beat.members for beat in group]))
    own = here.take(members)
    beats = tuple(
        FoundBeat(beat.beat, np.searchsorted(members, beat.members)) for beat in group
    )
    frequency_hz = float(np.median(own.frequencies_hz))
    return Train(own, beats, frequency_hz, float(np.median(own.levels_db))), members


def _scatter_hz(points: Points) -> float:
    """Scatter of pulse frequencies about a line through them, without outliers [Hz].

    The frequency at which a pulse is found scatters if it changes within the pulse. The mean
    frequency of its energy does not.
    """
    time_s = points.times_s - points.times_s.mean()
    scatters_hz = []
    for values_hz in (points.frequencies_hz, points.middles_hz):
        if values_hz is not None:
            slope, value = np.polyfit(time_s, values_hz, 1)
            off_hz = np.abs(values_hz - value - slope * time_s)
            scatters_hz.append(float(1.4826 * np.median(off_hz)))
    return min(scatters_hz)


def _with_doubt(trains: list[Train], here: Points, used: NDArray[np.bool_]) -> list[Train]:
    weakest_db = min(train.level_db for train in trains)
    strong = here.levels_db >= weakest_db - 3.0
    explained = float((used & strong).sum()) / max(float(strong.sum()), 1.0)
    if explained >= TRAINS.least_explained:
        return trains
    doubt = (
        f"only {100.0 * explained:.0f} % of the pulses at this frequency repeat with the "
        "measured interval"
    )
    return [replace(train, doubt=doubt) for train in trains]


def _with_images(trains: list[Train], receiver: Receiver) -> list[Train]:
    """Mark trains that are images of stronger trains; drop those close to their original."""
    kept: list[Train] = []
    for train in trains:
        others = [one for one in kept if one.image_of_hz is None]
        originals_hz = [
            one.frequency_hz for one in others if _is_image(train, one, others, receiver)
        ]
        if not originals_hz:
            kept.append(train)
        elif abs(originals_hz[0] - train.frequency_hz) > TRAINS.flank_hz:
            kept.append(replace(train, image_of_hz=originals_hz[0]))
    return [replace(one, together=sum(_alike(one, other) for other in kept)) for one in kept]


def _alike(train: Train, other: Train) -> bool:
    return (
        abs(train.interval_s - other.interval_s) <= TRAINS.one_device_s
        and abs(train.level_db - other.level_db) <= TRAINS.one_device_db
        and _coincide(train, other)
        and _coincide(other, train)
    )


def _is_image(
    train: Train, other: Train, stronger: Sequence[Train], receiver: Receiver
) -> bool:
    below_db = other.level_db - train.level_db
    if below_db < TRAINS.image_db or not _coincide(train, other):
        return False
    partners_hz = [one.frequency_hz for one in stronger if one is not other]
    return below_db >= TRAINS.anywhere_db or receiver.makes(
        train.frequency_hz, other.frequency_hz, partners_hz
    )


def _coincide(train: Train, other: Train) -> bool:
    theirs_s, times_s = other.points.times_s, train.points.times_s
    place = np.clip(np.searchsorted(theirs_s, times_s), 1, theirs_s.size - 1)
    gap_s = np.minimum(np.abs(theirs_s[place - 1] - times_s), np.abs(theirs_s[place] - times_s))
    return bool(np.mean(gap_s <= TRAINS.same_time_s) >= TRAINS.image_share)


def _of_one_sender(beats: Sequence[FoundBeat], here: Points) -> list[list[FoundBeat]]:
    """Group intervals by sender: intervals of one sender do not overlap in time."""
    groups: list[list[FoundBeat]] = []
    for beat in beats:
        times_s = here.times_s[beat.members]
        for group in groups:
            if not any(_overlap(times_s, here.times_s[one.members]) for one in group):
                group.append(beat)
                break
        else:
            groups.append([beat])
    return groups


def _overlap(first_s: NDArray[np.float64], second_s: NDArray[np.float64]) -> bool:
    inside = (
        int(((one >= other[0]) & (one <= other[-1])).sum())
        for one, other in ((first_s, second_s), (second_s, first_s))
    )
    return min(inside) > TRAINS.strays
