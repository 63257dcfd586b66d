"""Search several flights for one tag together, as in ``uavrt integrate``.

Half of the false-alarm probability is used for all flights together. The other half is divided
equally among the single flights. A resting tag has one position in all flights.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from uavrt.analysis.inputs.flown_with import antenna_poses
from uavrt.analysis.whole_flights.judged_flights import IntegratedTag, hills_under
from uavrt.core.earth.tangent_plane import plane_around
from uavrt.core.errors import ConfigError, UsageError
from uavrt.core.messages import WHOLE_FLIGHT_FALSE_ALARM, Tag
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.estimates.heard import PoseColumns
from uavrt.localization.terrain.elevation import Elevation
from uavrt.localization.whole_flight.flight_judgement import FoldedTrain, pulse_weights
from uavrt.localization.whole_flight.heard_train import HeardTrain, train_pulses
from uavrt.localization.whole_flight.tag_places import (
    Places,
    common_gains,
    distinct,
    places_around,
)
from uavrt.localization.whole_flight.together import JointTrain, Listened, search_together
from uavrt.localization.whole_flight.train_place import (
    PlaceBelief,
    place_belief,
    tag_share,
    train_evidence,
)

_Floats = NDArray[np.float64]
MOST_APART_M = 2000.0
"""Largest distance of a flight from the middle of all flights at which a common position is
estimated [m]."""
_TOGETHER = 0.5
"""Share of the false-alarm probability used for the decision by all flights together."""
_LISTED = 0.9
"""Probability that a flight's pulse train is the tag's from which its pulses are listed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagOfFlights:
    """Result of searching several flights together for one tag."""

    tag: Tag
    false_alarm_probability: float
    """Probability that noise alone gives such a result, in all flights together or in any
    single flight."""
    found: bool
    together: bool
    """True if all flights together show the tag; False if only single flights do."""
    names: tuple[str, ...]
    alone: tuple[float, ...]
    """False-alarm probability of each flight's separate result, in the order of the flights."""
    place: PlaceBelief | None
    """Position from all flights; None if not found or moved between flights."""
    flights: tuple[IntegratedTag, ...]
    """Result of each flight, in order, with the tag's pulses in it and the common position."""


def share_alone(false_alarm_probability: float, flights: int) -> float:
    """Share of the overall false-alarm probability that each single flight may use."""
    return false_alarm_probability * (1.0 - _TOGETHER) / flights


def common_tags(flights: Sequence[Flight], listed: Sequence[Tag] | None = None) -> list[Tag]:
    """Return the tags that all flights list, or `listed` if given. Raises `UsageError` if there
    is none or entries differ.
    """
    for before, after in pairwise(sorted(flights, key=lambda one: one.info.start_time_ns)):
        if before.info.start_time_ns == after.info.start_time_ns:
            raise UsageError(
                f"{before.info.directory} and {after.info.directory} are the same flight",
                remedy="Name each flight once; otherwise its noise counts twice",
            )
    if listed is not None:
        return list(listed)
    own = [{tag.tag_id: tag for tag in one.info.tags} for one in flights]
    ids = sorted(set(own[0]).intersection(*own[1:]))
    if not ids:
        raise UsageError(
            "no tag is listed in all of these flights", remedy="Name the tag file with --tags"
        )
    for tag_id in ids:
        first = own[0][tag_id]
        for flight, tags in zip(flights[1:], own[1:], strict=True):
            if _nature(tags[tag_id]) != _nature(first):
                raise UsageError(
                    f"tag {tag_id} has another frequency, pulse width, interval or gap in "
                    f"{flight.info.directory} than in {flights[0].info.directory}",
                    remedy="Name one tag file for all flights with --tags",
                )
    return [own[0][tag_id] for tag_id in ids]


def _nature(tag: Tag) -> tuple[float, float, tuple[float, ...], tuple[float, ...]]:
    return tag.frequency_hz, tag.pulse_width_s, tag.pulse_intervals_s, tag.gaps_s


def judge_together(
    flights: Sequence[Flight],
    judged: Sequence[IntegratedTag],
    pattern: AntennaPattern,
    *,
    false_alarm_probability: float = WHOLE_FLIGHT_FALSE_ALARM,
    moves: bool = False,
    elevation: Elevation | None = None,
) -> TagOfFlights:
    """Decide whether several flights together show a tag, and estimate where it is.

    `judged` contains each flight's separate result at the probability `share_alone`. With
    `moves` the tag may be at another position in each flight.
    """
    if len(flights) < 2:
        raise ConfigError("only one flight was given", remedy="Name two or more flights")
    views = _views(flights, judged, pattern, elevation, moves=moves)
    joint = search_together([one.listened for one in views], judged[0].tag, moves=moves)
    alone = tuple(one.train.false_alarm_probability for one in judged)
    by_all = joint.false_alarm_probability / _TOGETHER
    chance = min(1.0, by_all, min(alone) / share_alone(1.0, len(judged)))
    together = by_all <= false_alarm_probability
    heard = [one.heard(joint, number) for number, one in enumerate(views)]
    with_tag = [number for number, one in enumerate(judged) if one.found or together]
    common = None
    if with_tag and not moves:
        common = place_belief([heard[number] for number in with_tag])
    results = [
        view.found(one, joint.trains[number], common, chance, len(views))
        if number in with_tag
        else view.silent(one, joint.trains[number], chance, len(views))
        for number, (view, one) in enumerate(zip(views, heard, strict=True))
    ]
    return TagOfFlights(
        tag=judged[0].tag,
        false_alarm_probability=chance,
        found=chance <= false_alarm_probability,
        together=together,
        names=tuple(Path(one.info.directory).resolve().name for one in flights),
        alone=alone,
        place=common,
        flights=tuple(results),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _View:
    judged: IntegratedTag
    places: Places
    gain: _Floats
    """Pulse energy relative to the strongest pulse from the same position, shape (places,
    times); over all flights if they share one position."""
    chosen: NDArray[np.intp]
    """Indices of the few candidate positions that represent all of them in the search."""

    @property
    def listened(self) -> Listened:
        return Listened(
            energies=self.judged.energies,
            gain=self.gain[self.chosen],
            time_s=self.places.time_s,
        )

    def heard(self, joint: JointTrain, number: int) -> HeardTrain:
        """Return the pulse train in this flight, found in it alone or, if not, in all flights
        together.
        """
        one, train = self.judged, joint.trains[number]
        rates = len(one.tag.pulse_intervals_s)
        if one.found:
            return HeardTrain.among(one.energies, one.pulses, self.places, rates=rates)
        gain = self.gain[self.chosen[train.place]]
        pulses = train_pulses(one.energies, train, gain, self.places.time_s)
        trains = joint.log_trains[number]
        return HeardTrain.among(
            one.energies, pulses, self.places, rates=rates, log_trains=trains
        )

    def found(
        self,
        heard: HeardTrain,
        train: FoldedTrain,
        common: PlaceBelief | None,
        chance: float,
        flights: int,
    ) -> IntegratedTag:
        """Return the result of this flight for a tag that is found in all flights together.

        The flight counts as showing the tag if its pulse train is the tag's with a probability
        of 0.9 or more.
        """
        if common is None:
            place = place_belief([replace(heard, log_trains=None)])
            odds = train_evidence(heard) - (heard.log_trains or 0.0)
            sure = heard.log_trains is None or odds >= math.log(_LISTED / (1.0 - _LISTED))
        else:
            place, sure = common, tag_share(heard, self.gain, common) >= _LISTED
        silent = self.silent(heard, train, chance, flights)
        return replace(silent, found=sure, place=place if sure else None)

    def silent(
        self, heard: HeardTrain, train: FoldedTrain, chance: float, flights: int
    ) -> IntegratedTag:
        one = self.judged
        kept = one.train if one.found else train
        return replace(
            one,
            found=False,
            flights=flights,
            train=replace(kept, false_alarm_probability=chance),
            pulses=heard.pulses,
            places=self.places,
            searched_place=int(self.chosen[train.place]),
        )


def _views(
    flights: Sequence[Flight],
    judged: Sequence[IntegratedTag],
    pattern: AntennaPattern,
    elevation: Elevation | None,
    *,
    moves: bool,
) -> list[_View]:
    if moves:
        return [
            _View(
                judged=one,
                places=one.places,
                gain=one.places.gain,
                chosen=distinct(pulse_weights(one.places.gain)),
            )
            for one in judged
        ]
    places = _common_places(flights, judged, pattern, elevation)
    gains = common_gains(places)
    chosen = distinct(np.concatenate([pulse_weights(gain) for gain in gains], axis=1))
    return [
        _View(judged=one, places=own, gain=gain, chosen=chosen)
        for one, own, gain in zip(judged, places, gains, strict=True)
    ]


def _common_places(
    flights: Sequence[Flight],
    judged: Sequence[IntegratedTag],
    pattern: AntennaPattern,
    elevation: Elevation | None,
) -> list[Places]:
    """Candidate positions of the tag for each flight, around the middle of all flights."""
    middles = [one.places.plane for one in judged]
    latitude = np.array([one.latitude_deg for one in middles])
    longitude = np.array([one.longitude_deg for one in middles])
    plane = plane_around(latitude, longitude)
    away_m = np.hypot(*plane.to_local(latitude, longitude))
    if away_m.max() > MOST_APART_M:
        farthest = flights[int(np.argmax(away_m))].info.directory
        raise UsageError(
            f"{farthest} lies {away_m.max() / 1000:.1f} km from the middle of all flights: too "
            f"far for one position (at most {MOST_APART_M / 1000:g} km)",
            remedy="Combine only flights near each other, or give --moves for one "
            "position per flight",
        )
    found = []
    for flight, one in zip(flights, judged, strict=True):
        hills = hills_under(flight, elevation)
        found.append(
            places_around(
                PoseColumns.of(antenna_poses(flight)),
                pattern,
                start_ns=one.energies.start_ns,
                end_ns=one.energies.end_ns,
                hills=None if hills is None else hills.at(one.tag.frequency_hz),
                plane=plane,
            )
        )
    return found
