"""Decide whether a pulse train is the listed tag's, or an alias of another train.

Another tag can look like the listed one: pulses with interval T also fit T p/q, with some
pulses missing or with others in between. So all intervals from T/3 to 3 T that the list does
not allow are also searched. If a train at such an interval explains the same frequency better,
its slots are removed, and the flight is searched again.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.localization.whole_flight.drifting import even_order, search_drifting, train_times_s
from uavrt.localization.whole_flight.energies.coded_bursts_over_flight import (
    Sender,
    colliding_starts_s,
    sender_of,
)
from uavrt.localization.whole_flight.energies.energy_grid import SlotEnergies
from uavrt.localization.whole_flight.flight_judgement import (
    FoldedTrain,
    Weights,
    intervals_searched,
    log_tail,
    loud_tail,
    low_rank_weights,
    peaks,
    plain_weights,
)
from uavrt.localization.whole_flight.tuning import SEARCH


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherTrain:
    """Pulse train at a tag's frequency with an interval that the tag list does not allow."""

    interval_s: float
    phase_s: float
    offset_hz: float
    drift: float
    loud: bool
    ratio: tuple[int, int] | None
    """Ratio of the train's interval to the tag's, as small integers, if the pulse times fit
    both; None without a simple ratio."""
    other_code: bool = False
    """True if the bursts lack some pulses of the tag's code."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judgement:
    """Most likely train of a tag after other trains were removed."""

    train: FoldedTrain
    energies: SlotEnergies
    """Slot energies without the slots of other pulse trains."""
    others: tuple[OtherTrain, ...]

    @property
    def ambiguous(self) -> OtherTrain | None:
        """The first other train whose interval has a simple ratio, such as 1:2, to the tag's;
        None if there is none.
        """
        return next((one for one in self.others if one.ratio is not None), None)


def judge(
    energies: SlotEnergies,
    gain: NDArray[np.float64],
    gain_time_s: NDArray[np.float64],
    tag: Tag,
    *,
    false_alarm_probability: float = WHOLE_FLIGHT_FALSE_ALARM,
    most_drift: float = 0.0,
) -> Judgement:
    """Search for a tag, and repeat the search without each other train that explains the found
    one better.

    `gain` (places, times at `gain_time_s`) is the relative energy of a pulse from each
    position.
    """
    others: list[OtherTrain] = []
    while True:
        weights = low_rank_weights(gain, gain_time_s, energies, tag.pulse_intervals_s[0])
        train = search_drifting(energies, weights, tag, most_drift)
        found = train.false_alarm_probability <= false_alarm_probability
        if found and energies.single is not None:
            sender = _sender(energies, weights, train)
            if sender.shift_s is None:
                others.append(_other_code(train))
                if sum(one.other_code for one in others) > SEARCH.most_codes:
                    train = replace(train, false_alarm_probability=1.0)
                    return Judgement(train=train, energies=energies, others=tuple(others))
                energies = _without_code(energies, train, sender)
                continue
            train = replace(train, phase_s=train.phase_s + sender.shift_s)
        other = better_elsewhere(energies, weights, train, tag) if found else None
        trains = sum(not one.other_code for one in others)
        if other is None or trains == SEARCH.most_others:
            return Judgement(train=train, energies=energies, others=tuple(others))
        others.append(other)
        span_s = len(energies.heard) * energies.slot_s
        energies = energies.without(
            train_times_s(other.phase_s, other.interval_s, other.drift, span_s)
        )


def _sender(energies: SlotEnergies, weights: Weights, train: FoldedTrain) -> Sender:
    span_s = len(energies.heard) * energies.slot_s
    time_s = train_times_s(train.phase_s, train.interval_s, train.drift, span_s)
    at = np.clip(np.floor(time_s / energies.slot_s).astype(np.intp), 0, len(energies.heard) - 1)
    weight = np.ones(len(at))
    if not train.loud:
        weight = (weights.mixing[train.place] @ weights.basis[:, at]).astype(np.float64)
        weight = np.maximum(weight, 0.0)
    row = int(np.argmin(np.abs(energies.offsets_hz - train.offset_hz)))
    assert energies.single is not None
    return sender_of(energies.single, energies.slot_s, row, time_s, weight)


def _without_code(energies: SlotEnergies, train: FoldedTrain, sender: Sender) -> SlotEnergies:
    assert energies.single is not None
    span_s = len(energies.heard) * energies.slot_s
    time_s = train_times_s(train.phase_s, train.interval_s, train.drift, span_s)
    hidden_s = colliding_starts_s(sender.pulses_s, energies.single.starts_s)
    if not len(hidden_s):
        hidden_s = np.zeros(1)
    return energies.without(np.add.outer(time_s, hidden_s).ravel())


def _other_code(train: FoldedTrain) -> OtherTrain:
    return OtherTrain(
        interval_s=train.interval_s,
        phase_s=train.phase_s,
        offset_hz=train.offset_hz,
        drift=train.drift,
        loud=train.loud,
        ratio=None,
        other_code=True,
    )


def better_elsewhere(
    energies: SlotEnergies, weights: Weights, train: FoldedTrain, tag: Tag
) -> OtherTrain | None:
    """Find a train at an interval other than the tag's that explains a found train better; None
    if there is none.
    """
    middle = int(np.argmin(np.abs(energies.offsets_hz - train.offset_hz)))
    rows = np.arange(max(0, middle - 1), min(len(energies.energy), middle + 2))
    if train.loud:
        alone, values = plain_weights(energies), energies.loud.astype(np.float32)
    else:
        values = energies.energy
        alone = weights.only(train.place)
    if train.drift:
        order = even_order(energies, train.drift)
        values = values[:, order]
        alone = replace(alone, basis=alone.basis[:, order])
    best, other = train.log_probability - SEARCH.explains_log, None
    for between in _elsewhere(energies, train, tag):
        found = peaks(values, rows, alone, energies.slot_s, between)
        if train.loud:
            logs = loud_tail(energies, found, alone)
        else:
            logs = log_tail(found, alone, energies)
        at = int(np.argmin(logs)) if len(logs) else 0
        if len(logs) and logs[at] < best:
            best, interval_s = float(logs[at]), float(found.interval[at]) * energies.slot_s
            other = OtherTrain(
                interval_s=interval_s,
                phase_s=(float(found.phase[at]) + 0.5) * energies.slot_s,
                offset_hz=float(energies.offsets_hz[found.row[at]]),
                drift=train.drift,
                loud=train.loud,
                ratio=_ratio(interval_s / train.interval_s),
            )
    return other


def _elsewhere(
    energies: SlotEnergies, train: FoldedTrain, tag: Tag
) -> list[tuple[float, float]]:
    cell_s = energies.slot_s * train.interval_s / max(float(energies.time_s[-1]), 1e-9)
    shortest = max(SEARCH.shortest_ratio * train.interval_s, 8.0 * energies.slot_s)
    edges = [shortest]
    for low_s, high_s in sorted(intervals_searched(tag)):
        edges += [low_s - 2.0 * cell_s, high_s + 2.0 * cell_s]
    edges.append(SEARCH.longest_ratio * train.interval_s)
    stretches = zip(edges[::2], edges[1::2], strict=True)
    return [(low, high) for low, high in stretches if high - low > energies.slot_s]


def _ratio(value: float) -> tuple[int, int] | None:
    """Small integers p and q for which p/q is within 1 % of a value; None if there are none."""
    for below in range(1, SEARCH.small_number + 1):
        above = round(value * below)
        if (
            above
            and math.gcd(above, below) == 1
            and abs(value * below / above - 1.0) < SEARCH.same_ratio
        ):
            return above, below
    return None
