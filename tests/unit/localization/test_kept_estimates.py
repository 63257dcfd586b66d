"""What a caller keeps from one estimate to the next never shows in an answer."""

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from depth import share
from turned import turned_flight

from uavrt.core.errors import UsageError
from uavrt.ground.store.estimates import LIVE_AT_ONCE
from uavrt.localization.antenna import MONOPOLE, PATTERNS
from uavrt.localization.estimates.estimate_cache import Cache
from uavrt.localization.estimates.flight_estimates import EstimationOptions, Found, estimate
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.position.levels.strengths import Strengths
from uavrt.localization.terrain.elevation import Elevation
from uavrt_experiments.search.terrain import elevation_of


def hills(wide_m: float) -> Elevation:
    return elevation_of(lambda east, north: 400.0 + 60.0 * np.sin((east + north) / wide_m))


HILLS = [hills(90.0), hills(70.0)]


@dataclass(frozen=True, kw_only=True)
class Given:
    """All that an estimate is made of."""

    heard: Heard
    how: EstimationOptions
    others: tuple[Found, ...] = ()

    def answer(self, kept: Cache | None = None) -> str:
        """Every digit and word of the estimate; the reason where there is none."""
        try:
            found = estimate(self.heard, self.how, others=self.others, cache=kept)
        except UsageError as error:
            return str(error)
        # Arrays by their bytes: in digits they take most of the time.
        with np.printoptions(override_repr=lambda array: f"{array.dtype}{array.tobytes()!r}"):
            return repr(found)


def heard_of(seed: int, tags: int = 1) -> Heard:
    flight = turned_flight(seed, tags=tags, turns=2)
    return Heard.of_records(
        flight.pulse_poses, flight.poses, tags=flight.tags, antenna=flight.antenna
    )


def mast() -> Heard:
    """The poses and pulses of a drone that has flown to one place and stands there."""
    flown = heard_of(0)
    (own,) = flown.pulses.values()
    still = own.chosen(np.argsort(own.time_ns)[:8])
    columns = {
        name: np.full_like(getattr(still, name), getattr(still, name)[0])
        for name in ("latitude_deg", "longitude_deg", "quaternion_wxyz")
    }
    return replace(flown, pulses={2: replace(still, **columns)})


@cache
def given(kind: str) -> Given:
    drone = Given(heard=heard_of(0), how=EstimationOptions())
    found = estimate(drone.heard).found
    level = Strengths(
        listener="mast",
        pulses=20,
        latitude_deg=np.array([46.5005]),
        longitude_deg=np.array([8.001]),
        height_m=np.array([6.0]),
        yaw_deg=np.array([40.0]),
        level_db=np.array([20.0]),
        sigma_db=np.array([1.0]),
        antenna=PATTERNS["RA-23K"],
    )
    return {
        "turns": replace(drone, others=(Found(strengths={2: level}),)),
        "turns over hills": replace(drone, how=EstimationOptions(elevation=HILLS[0])),
        "mast": replace(drone, heard=mast(), others=(found,)),
        "survey over hills": Given(
            heard=heard_of(5), how=EstimationOptions(elevation=HILLS[0])
        ),
        "survey": Given(heard=heard_of(5), how=EstimationOptions(height_m=30.0)),
    }[kind]


NAMED = {
    "antenna": ("RA-2A", MONOPOLE),
    "elevation": (HILLS[1], None),
    "method": ("mle", "track"),
    "bearing_method": ("pca",),
    "height_m": (20.0,),
}
"""Other values of fields that take some values only."""


def changes(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Change each thing that a value holds, one at a time."""
    part, named = name.rpartition(".")[2], isinstance(value, str | float | Elevation | None)
    if part in NAMED and named:
        yield from ((f"{name}={one}", one) for one in NAMED[part] if one != value)
    elif isinstance(value, np.ndarray):
        if not value.size:
            return
        other = value.copy()
        step = {"i": 10**6, "f": 1e-6 if part.endswith("itude_deg") else 2.0}
        other[len(value) // 2] += step[other.dtype.kind]
        yield name, other
    elif is_dataclass(value) and not isinstance(value, type):
        for one in fields(value):
            for path, other in changes(getattr(value, one.name), f"{name}.{one.name}"):
                yield path, replace(value, **{one.name: other})
    elif isinstance(value, Mapping):
        for key in value:
            for path, other in changes(value[key], f"{name}[{key}]"):
                yield path, {**value, key: other}
    elif isinstance(value, tuple | list):
        for at in range(min(len(value), 2)):
            for path, other in changes(value[at], f"{name}[{at}]"):
                yield path, (*value[:at], other, *value[at + 1 :])
    elif isinstance(value, bool):
        yield name, not value
    elif isinstance(value, float):
        yield name, value * 1.02 + 0.01
    elif isinstance(value, str):
        yield name, f"{value}."


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", share(["turns", "turns over hills", "survey over hills", "survey", "mast"], 2)
)
def test_a_change_of_any_input_changes_the_answer_as_if_nothing_were_kept(kind: str) -> None:
    before = given(kind)
    first = Cache()
    answer = before.answer(first)
    changed = 0
    for path, after in changes(before):
        fresh, kept = after.answer(), Cache()
        vars(kept).update({name: copy(one) for name, one in vars(first).items()})
        assert after.answer(kept) == fresh, path
        changed += fresh != answer
    # Most of what goes in shows in the answer, so that this test can fail.
    assert changed >= 10


def until(heard: Heard, pulses: int, tag_id: int = 2) -> Heard:
    """The flight as it was when a tag had been heard some times."""
    every = {**heard.pulses, tag_id: heard.pulses[tag_id].chosen(slice(pulses))}
    return replace(heard, pulses=every, goes_on=True)


def test_a_bearing_that_must_wait_has_the_count_of_its_own_pulses() -> None:
    heard, kept = heard_of(0), Cache()
    begin_ns = estimate(heard).found.bearings[0].start_time_ns
    begin = int(np.searchsorted(heard.pulses[2].time_ns, begin_ns))
    first, later = until(heard, begin + 12), until(heard, begin + 20)
    (before,) = estimate(first, cache=kept).found.bearings
    (waits,) = estimate(later, cache=kept, at_once={"bearing": 0}).found.bearings
    assert (waits.heard, waits.bearing) == (12, before.bearing)
    # The drone's bearing is of more pulses than that, if fewer than have arrived.
    own = replace(before, heard=16, from_drone=True)
    found = estimate(later, cache=kept, theirs=[own], at_once={"bearing": 0}).found
    assert [(one.heard, one.from_drone) for one in found.bearings] == [(16, True)]
    found = estimate(later, cache=kept, theirs=[own]).found
    assert [(one.heard, one.from_drone) for one in found.bearings] == [(20, False)]


def test_a_survey_that_goes_on_does_not_keep_a_joint_position_waiting() -> None:
    """A whip surveys tag 2, and has heard tag 3 twice, of which a drone has bearings."""
    flown, other = (heard_of(seed, tags=2) for seed in (5, 0))
    survey, others = until(flown, 2, 3), [estimate(other).found]
    kept, joint = Cache(), []
    for pulses in range(40, 46):
        given = until(survey, pulses)
        limit = LIVE_AT_ONCE if pulses > 40 else {}
        found = estimate(given, others=others[: pulses > 40], cache=kept, at_once=limit)
        joint += [one.tag_id for one in found.positions if one.tag_id == 3 and one.position]
    # That of tag 2 and it come in turn.
    assert len(joint) >= 4
