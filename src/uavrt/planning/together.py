"""Several drones search together: each decides in turn, and knows what the others will do.

All pulses feed one belief of each tag. Whoever decides is told the ways that the others have
announced: what will be heard there tells it less (sequential greedy), tags that others reach
sooner are left to them, and its way keeps away from theirs. A drone that is no longer heard of
gives its tags back; its way is kept away from as before, for it may still be flown.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from uavrt.errors import ConfigError, PlanError
from uavrt.localization import Listening
from uavrt.planning.actions import Action, Hold, Return
from uavrt.planning.beliefs import Beliefs
from uavrt.planning.beside import AHEAD, Beside, Separation
from uavrt.planning.division import Start
from uavrt.planning.energy import Battery
from uavrt.planning.search import Found, Search, SearchSettings
from uavrt.planning.shares import shared_out
from uavrt.planning.situation import Decision, Planner
from uavrt.planning.vehicle import Path, VehicleState, Wind, flown

_STANDS_S = 1.0


@dataclass(slots=True)
class _Member:
    search: Search
    state: VehicleState
    action: Action
    path: Path
    """What it is about to do, to its end."""
    announced: Path
    """The first part of that, after which it stands."""


class SearchTogether:
    """One search of several drones.

    Parameters
    ----------
    settings : SearchSettings
        Of each, except for its home and its height.
    beliefs : Beliefs
        What all have heard.
    starts : mapping
        Where each drone is, by its number. It is its home, and its height is kept.
    planner : callable
        Makes a planner for each.
    rngs : mapping
        Randomness of each.
    separation : Separation
    missing_s : float
        A drone not heard of for so long gives its share back.

    Raises
    ------
    PlanError
        Two start too near each other, or at too similar heights.
    """

    def __init__(
        self,
        settings: SearchSettings,
        beliefs: Beliefs,
        starts: Mapping[int, VehicleState],
        planner: Callable[[], Planner],
        rngs: Mapping[int, Generator],
        *,
        separation: Separation | None = None,
        missing_s: float = 10.0,
    ) -> None:
        if not starts:
            raise ConfigError("a search needs a drone", remedy="Name at least one")
        self.settings, self.beliefs = settings, beliefs
        self.separation, self._missing_s = separation or Separation(), missing_s
        self.found: dict[int, Found] = {}
        self._members: dict[int, _Member] = {}
        self._owners: dict[int, int] = {}
        """Who had each tag when they were last divided."""
        for number, state in starts.items():
            self._check_start(number, state)
            home = replace(settings.area, home_m=(state.east_m, state.north_m))
            search = Search(
                replace(settings, area=home), beliefs, planner(), rngs[number], found=self.found
            )
            stands = Hold(duration_s=_STANDS_S)
            path = _begun(state, flown(settings.vehicle, state, stands))
            self._members[number] = _Member(search, state, stands, path, path)

    def _check_start(self, number: int, state: VehicleState) -> None:
        apart = self.separation
        for other, member in self._members.items():
            there = member.state
            off = np.hypot(there.east_m - state.east_m, there.north_m - state.north_m)
            if off < apart.distance_m:
                raise PlanError(
                    f"drones {number} and {other} start {off:.0f} m from each other",
                    remedy=f"Start them {apart.distance_m:.0f} m apart or more",
                )
            if abs(there.height_m - state.height_m) < apart.height_m - 1e-6:
                raise PlanError(
                    f"drones {number} and {other} would fly at {state.height_m:.0f} m and "
                    f"{there.height_m:.0f} m",
                    remedy=f"Give heights {apart.height_m:.0f} m apart or more",
                )

    def announced(self, number: int) -> Path:
        """Way of a drone until it decides again; if it does not, it stays at its end."""
        return self._members[number].announced

    def report(self, number: int, state: VehicleState) -> None:
        """Tell where a drone is."""
        self._members[number].state = state

    def missing(self, time_s: float) -> set[int]:
        """Drones that are not heard of."""
        return {
            number
            for number, one in self._members.items()
            if time_s - one.state.time_s > self._missing_s
        }

    @property
    def finished(self) -> bool:
        """Whether every tag is found."""
        return len(self.found) == len(self.beliefs)

    def listen(self, tag_id: int, time_s: float, heard: Listening) -> None:
        """Update with a pulse that any drone heard, or that it heard none when one was due."""
        self._any.listen(tag_id, time_s, heard)

    def judge(self, time_s: float) -> list[int]:
        """Tags that have just been found."""
        return self._any.judge(time_s)

    @property
    def _any(self) -> Search:
        """All know the same."""
        return next(iter(self._members.values())).search

    def decide(
        self,
        number: int,
        state: VehicleState,
        *,
        wind: Wind | None = None,
        battery: Battery | None = None,
    ) -> Decision:
        """What a drone is to do now; from then on it is announced.

        A drone whose every other way comes too near to another flies on as it has announced.
        It flies home in any case: its height keeps it apart.
        """
        self.report(number, state)
        member = self._members[number]
        beside = self.beside(number, state.time_s)
        decision = member.search.decide(state, wind=wind, battery=battery, beside=beside)
        home = member.search.settings.area.home_m
        way = flown(
            self.settings.vehicle, state, decision.action, home_m=home, wind=wind or Wind()
        )
        path = _begun(state, way)
        announced = path if isinstance(decision.action, Return) else self._cut(path)
        near = beside.path_nearest_m(announced)
        limit = self.separation.distance_m - 1e-6
        if near < limit and not isinstance(decision.action, Return):
            return replace(
                decision,
                action=member.action,
                reason=f"goes on: another drone would be {near:.0f} m away; {decision.reason}",
            )
        member.action, member.path, member.announced = decision.action, path, announced
        return decision

    def _cut(self, path: Path) -> Path:
        """What is flown of a path before the next decision, and a little more."""
        return path.until(path.time_s[0] + AHEAD * self.settings.cycle_s)

    def beside(self, number: int, time_s: float) -> Beside:
        """What a drone is told of the others."""
        others = {other: one for other, one in self._members.items() if other != number}
        heard_of = {
            other: one
            for other, one in others.items()
            if other not in self.missing(time_s) and not isinstance(one.action, Return)
        }
        return Beside(
            separation=self.separation,
            announced=tuple(one.announced for one in others.values()),
            listening=tuple(one.path for one in heard_of.values()),
            left=self._left(number, time_s, heard_of),
        )

    def _left(self, number: int, time_s: float, others: dict[int, _Member]) -> frozenset[int]:
        """Tags that others reach sooner; none where nothing else would be left to do."""
        if not others:
            return frozenset()
        own = self._members[number].state
        starts = {number: Start(east_m=own.east_m, north_m=own.north_m)}
        starts |= {
            other: Start(
                east_m=float(one.path.east_m[-1]),
                north_m=float(one.path.north_m[-1]),
                after_s=max(0.0, float(one.path.time_s[-1]) - time_s),
            )
            for other, one in others.items()
        }
        rounds = shared_out(
            self.beliefs,
            self.found,
            starts,
            self._owners,
            speed_m_s=self.settings.vehicle.speed_m_s,
        )
        self._owners |= {tag: drone for drone, tags in rounds.items() for tag in tags}
        mine, known = rounds[number], sum(map(len, rounds.values()))
        if not mine and known + len(self.found) == len(self.beliefs):
            return frozenset()
        return frozenset(tag for tags in rounds.values() for tag in tags) - set(mine)


def _begun(state: VehicleState, path: Path) -> Path:
    """A path with the state that it begins at."""
    return Path(
        time_s=np.append(state.time_s, path.time_s),
        east_m=np.append(state.east_m, path.east_m),
        north_m=np.append(state.north_m, path.north_m),
        height_m=np.append(state.height_m, path.height_m),
        yaw_deg=np.append(state.yaw_deg, path.yaw_deg),
    )
