"""Records that a planner gets as input and returns as output."""

from dataclasses import dataclass, field, fields
from typing import Any, Protocol

from numpy.random import Generator

from uavrt.planning.area import SearchArea
from uavrt.planning.beliefs import Beliefs, TagBelief
from uavrt.planning.drone_model.drone_motion import Vehicle, VehicleState, Wind
from uavrt.planning.drone_model.energy import EnergyModel
from uavrt.planning.drone_model.other_drones import OtherDrones
from uavrt.planning.drone_model.planner_actions import Action
from uavrt.planning.information import Listener
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.stopping import StopRule


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchSettings:
    """Settings that are constant during a search."""

    vehicle: Vehicle
    area: SearchArea
    stop: StopRule
    keep_away: KeepAway | None = None
    energy: EnergyModel | None = None
    """Energy model of the drone; None ignores the battery, as in some experiments."""
    worst_wind_m_s: float = 0.0
    """Headwind assumed on the return if the wind is unknown [m/s]."""
    return_height_m: float = 0.0
    """Height above the take-off to which the autopilot climbs before it returns [m]."""
    cycle_s: float = 5.0
    """Time until the planner's next decision [s], unless the action ends earlier."""
    pulse_s: float = 1.0
    """Interval between a tag's pulses [s]."""
    threshold_db: float = 10.0
    """SNR from which the drone detects a tag's pulse [dB]."""
    tag_height_m: float = 0.0
    """Height of the tags above the ground below them [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Situation(SearchSettings):
    """State of a search before a decision, which is the input of a planner."""

    state: VehicleState
    beliefs: Beliefs
    found: frozenset[int]
    """Ids of found tags, which are no longer searched for."""
    rng: Generator
    wind: Wind = field(default_factory=Wind)
    others: OtherDrones | None = None
    """Paths and tags of other drones in the same search; None if this drone searches alone."""

    @classmethod
    def of(cls, settings: SearchSettings, **now: Any) -> "Situation":
        """Create a situation from constant settings and present values (`now`)."""
        fixed = {one.name: getattr(settings, one.name) for one in fields(settings)}
        return cls(**fixed, **now)

    @property
    def wanted(self) -> list[TagBelief]:
        """Tags that are not yet found and not assigned to other drones."""
        left = frozenset() if self.others is None else self.others.left
        return [one for tag_id, one in self.beliefs.items() if tag_id not in self.found | left]

    @property
    def above_tags_m(self) -> float:
        """Height of the drone above the tags, at least 1 [m]."""
        return max(1.0, self.state.height_m - self.tag_height_m)

    @property
    def listener(self) -> Listener:
        """How pulses are received: height above the tags, pulse interval and threshold."""
        return Listener(
            above_tags_m=self.above_tags_m, pulse_s=self.pulse_s, threshold_db=self.threshold_db
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """Action that a planner rated, with its rating or the reason for refusing it."""

    action: Action
    duration_s: float
    nats_per_s: float | None = None
    """Expected information on tag positions per second [nats/s]; None if not computed."""
    refused: str | None = None
    """Reason why the action must not be flown; None if it may."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The next action, the reason for it, and the rated candidates."""

    action: Action
    reason: str
    """Reason for the action, in words for the operator; the figures are in `candidates`."""
    candidates: tuple[Candidate, ...] = ()


class Planner(Protocol):
    """Interface of a planner, which decides where to fly next.

    A planner may have state, such as its line in a survey. All its random numbers come from the
    situation's generator, so that equal flights give equal decisions.
    """

    def decide(self, situation: Situation) -> Decision:
        """Choose the next action; called after each action and each planner cycle."""
