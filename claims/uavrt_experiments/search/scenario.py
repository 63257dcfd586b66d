"""Scenarios of searches, from published tables or of our own."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uavrt.planning.drone_model.drone_motion import Multirotor
from uavrt.planning.keep_away import KeepAway
from uavrt.planning.stopping import AccuracyStop, StopRule
from uavrt_experiments.search.reflection import Reflection

_Floats = NDArray[np.float64]
Ground = Callable[[_Floats, _Floats], _Floats]


Stop = Literal["paper", "ours"]
STOPS: tuple[Stop, ...] = ("paper", "ours")


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """The true world of a scenario. Levels are in the paper's unit, dBm or dB."""

    level_1m_db: float
    """Level received 1 m from a tag on boresight."""
    exponent: float
    sigma_db: float
    antenna: str = "yagi-2"
    reflection: Reflection | None = None
    """Ground that reflects; None: it does not."""
    tag_height_m: float = 0.0
    threshold_db: float = -1000.0
    """Level below which pulses are missed."""
    missed_share: float = 0.0
    chance_share: float = 0.0
    """Number of false pulses of any level for each due pulse."""
    strangers: int = 0
    """Number of interferers received under the first tags' numbers, each from its own place."""
    level_spread_db: float = 0.0
    """Half-width of a uniform spread of the tags' own levels."""
    exponent_range: tuple[float, float] | None = None
    """Range of the path loss exponent, drawn for each run; None: `exponent`."""
    walk_m_per_root_s: float = 0.0
    walk_speed_m_s: float = 0.0
    """Speed of the travelling tags [m/s]."""
    travellers: int = 0
    """Number of travelling tags; they come first."""
    vegetation_m: float = 0.0
    """Height of the plants above the tags [m] (ITU-R P.833)."""
    ground: Ground | None = None
    """Height of the ground, whose hills weaken signals (ITU-R P.526, knife edge);
    None: flat."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """The searcher's prior knowledge; None for a value means the true one."""

    each: bool = False
    """True: the strength of each tag and the exponent are known."""
    level_sigma_db: float = 0.0
    level_drift_db_per_root_s: float = 0.0
    exponent_sigma: float = 0.0
    sigma_db: float | None = None
    motion: tuple[float, float, float] = (0.0, 1.0, 0.0)
    walk_m_per_root_s: float | None = None
    travelling_m_s: float = 0.0
    missed_share: float | None = None
    chance_share: float | None = None
    map_of_heights: bool = False
    """True: the searcher has a map of the ground, with usual errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contender:
    """A planner with a filter and a stop rule, as compared in the tables."""

    planner: str
    filter: Literal["ours", "TrackerBots"] = "ours"
    """Filter of the estimates; TrackerBots' ignores missed pulses, and sometimes places
    particles at random."""
    stop: Stop = "paper"
    easier: bool = False
    """True: the planner flies the scenario's easier case, for comparison."""
    turn_s: float = 0.0
    """Duration of the turn at each point of Cliff's planner [s]; 0: single pulses instead."""
    drones: int = 1
    corners: bool = False
    """True: several drones start at several corners of the area; False: all at one."""

    @property
    def as_drones(self) -> bool:
        """True if the drones' own program flies it: our planner with our stop rule."""
        return self.planner == "mi_rate" and self.stop == "ours"

    def __str__(self) -> str:
        own = "" if self.filter == "ours" else ", authors' filter"
        stop = ", our stop" if self.stop == "ours" else ""
        turning = f", turns of {self.turn_s:g} s" if self.turn_s else ""
        several = "" if self.drones == 1 else f", {self.drones} drones"
        several += " from corners" if self.corners else ""
        easier = ", easier case" if self.easier else ""
        return f"{self.planner}{several}{own}{stop}{turning}{easier}"


PUBLISHED = Contender(planner="renyi", filter="TrackerBots")
"""Published planner and filter of TrackerBots."""
THAN_PUBLISHED = "time over that of renyi"
"""Name of the quantity: our time over that of `PUBLISHED`."""
FASTER = "times as fast as one, {} drones"
ERROR_THAN_ONE = "error over that of one drone"
APART = "drones kept apart, share"
FARTHEST = "straight to the farthest animal, mean, s"
"""Names of the quantities of searches by several drones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A requirement on our planner."""

    quantity: str
    most: float | None = None
    least: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One row of the tables."""

    name: str
    title: str
    east_m: float
    north_m: float
    """Size of the area to the north of the origin [m]."""
    tags: int
    truth: Truth
    vehicle: Multirotor
    paper_stop: StopRule
    our_stop: AccuracyStop
    places: tuple[tuple[float, float], ...] = ()
    """Places of the tags [m]; empty: anywhere, drawn for each run."""
    absent: int = 0
    """Number of searched tags that are absent."""
    known: Known = field(default_factory=Known)
    start_m: tuple[float, float] = (0.0, 0.0)
    start_yaw_deg: float = 0.0
    height_m: float = 20.0
    first_plan_s: int = 1
    cycle_s: int = 5
    stops_each_cycle: bool = False
    keep_away: KeepAway | None = None
    limit_s: int = 1800
    """Battery time of the table [s]; runs without success by then have failed."""
    easier: "Scenario | None" = None
    """The scenario with a simplification, for comparison; None: there is none."""
    bars: tuple[Bar, ...] = ()
    contenders: tuple[Contender, ...] = ()
    baseline_share: float = 0.12
    """Number of runs of a baseline per run of our planner; baselines take long."""

    def asks(self, quantity: str) -> bool:
        """True if there is a requirement on this quantity."""
        return any(bar.quantity == quantity for bar in self.bars)
