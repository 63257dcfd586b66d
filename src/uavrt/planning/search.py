"""Search for all tags, from the first pulse to the return flight."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from uavrt.core.errors import PlanError
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import TrackEstimate
from uavrt.planning.area import check_reach
from uavrt.planning.beliefs import Beliefs
from uavrt.planning.common_fall import ExponentSharing
from uavrt.planning.drone_model.drone_motion import VehicleState, Wind, flown, headwind
from uavrt.planning.drone_model.energy import Battery, EnergyModel
from uavrt.planning.drone_model.other_drones import OtherDrones
from uavrt.planning.drone_model.planner_actions import FlyTo, Return
from uavrt.planning.situation import Decision, Planner, SearchSettings, Situation


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A found tag: the time, the estimated position and the reason why it counts as found."""

    time_s: float
    estimate: TrackEstimate
    reason: str


class Search:
    """Search for all tags: holds their beliefs, the planner and its random numbers, and applies
    stop rule and return.
    """

    def __init__(
        self, settings: SearchSettings, beliefs: Beliefs, planner: Planner, rng: Generator
    ) -> None:
        self.settings, self.beliefs = settings, beliefs
        self._planner, self._rng = planner, rng
        self.found: dict[int, Found] = {}
        self.decisions: list[tuple[float, Decision]] = []
        self._fall = ExponentSharing()

    def check(self, state: VehicleState, battery: Battery | None = None) -> None:
        """Raise `PlanError` for a search that cannot be flown, before the drone moves.

        Reasons are a tag without an expected signal strength, a start outside the fence or the
        height limits, or an area beyond the battery's reach.
        """
        for belief in self.beliefs.values():
            prior = belief.prior
            if not (np.isfinite(prior.level_db) and np.isfinite(prior.level_sigma_db)):
                raise PlanError(
                    f"the signal strength expected of tag {belief.tag_id} is missing",
                    remedy="Give its level_db and level_sigma_db (large if unknown)",
                )
        area = self.settings.area
        here = np.array([state.east_m]), np.array([state.north_m])
        reason = area.refusal(*here, state.height_m)
        if reason is not None:
            raise PlanError(
                f"the search cannot begin here: {reason}",
                remedy="Fly to a place within the geofence and the permitted heights first",
            )
        if battery is not None and self.settings.energy is not None:
            vehicle, energy = self.settings.vehicle, self.settings.energy
            usable = battery.remaining_wh - battery.reserve_wh
            per_m = energy.used_wh(1.0 / vehicle.speed_m_s, vehicle.speed_m_s)
            check_reach(area, max(0.0, usable) / (2.0 * per_m))

    def listen(self, tag_id: int, time_s: float, heard: Listening) -> None:
        """Update a tag's belief with a received or a missed pulse."""
        belief = self.beliefs[tag_id]
        belief.advance_to(time_s)
        belief.listen(heard)

    def judge(self, time_s: float) -> list[int]:
        """Apply the stop rule to each tag; return the ids of newly found tags."""
        new = []
        for tag_id, belief in self.beliefs.items():
            if tag_id in self.found:
                continue
            verdict = self.settings.stop.verdict(belief)
            if verdict.found:
                self.found[tag_id] = Found(
                    time_s=time_s, estimate=belief.estimate(), reason=verdict.reason
                )
                new.append(tag_id)
        return new

    @property
    def finished(self) -> bool:
        """True if every tag is found."""
        return len(self.found) == len(self.beliefs)

    def decide(
        self,
        state: VehicleState,
        *,
        wind: Wind | None = None,
        battery: Battery | None = None,
        others: OtherDrones | None = None,
    ) -> Decision:
        """Next action: the flight home when it is due, otherwise the planner's choice."""
        self._fall.share(self.beliefs.values())
        decision = self._home(state, wind, battery)
        if decision is None:
            situation = self.situation(state, wind or Wind(), others)
            decision = self._planner.decide(situation)
            decision = self._affordable(decision, situation, wind, battery) or decision
        self.decisions.append((state.time_s, decision))
        return decision

    def near(self, state: VehicleState) -> float:
        """Probability that an animal comes too close if the drone stays for
        one planner cycle.
        """
        rule = self.settings.keep_away
        if rule is None:
            return 0.0
        place = np.array([state.east_m]), np.array([state.north_m])
        kept = rule.kept(
            self.beliefs,
            (state.east_m, state.north_m),
            *place,
            speed_m_s=self.settings.vehicle.speed_m_s,
            stays_s=self.settings.cycle_s,
        )
        return 1.0 - float(kept.min())

    def situation(
        self, state: VehicleState, wind: Wind, others: OtherDrones | None = None
    ) -> Situation:
        """Return the planner's input for the next decision."""
        return Situation.of(
            self.settings,
            state=state,
            beliefs=self.beliefs,
            found=frozenset(self.found),
            rng=self._rng,
            wind=wind,
            others=others,
        )

    def _way_home_wh(
        self, energy: EnergyModel, state: VehicleState, wind: Wind | None
    ) -> float:
        settings, home_m = self.settings, self.settings.area.home_m
        air = headwind(state, home_m, settings.worst_wind_m_s) if wind is None else wind
        return energy.way_home_wh(
            settings.vehicle, state, home_m, air, return_height_m=settings.return_height_m
        )

    def _home(
        self, state: VehicleState, wind: Wind | None, battery: Battery | None
    ) -> Decision | None:
        if self.finished:
            return Decision(action=Return(), reason="every tag is found")
        energy = self.settings.energy
        if battery is None or energy is None:
            return None
        needed = self._way_home_wh(energy, state, wind)
        if not battery.must_return(needed):
            return None
        return Decision(
            action=Return(),
            reason=(
                f"{battery.remaining_wh:.0f} Wh left; the return takes {needed:.0f} Wh, "
                f"the reserve is {battery.reserve_wh:.0f} Wh"
            ),
        )

    def _affordable(
        self,
        decision: Decision,
        situation: Situation,
        wind: Wind | None,
        battery: Battery | None,
    ) -> Decision | None:
        """Flight home if an action would use energy needed for the return; otherwise None."""
        energy = self.settings.energy
        if battery is None or energy is None or isinstance(decision.action, Return):
            return None
        vehicle = self.settings.vehicle
        path = flown(vehicle, situation.state, decision.action, wind=situation.wind)
        last = min(len(path.time_s), max(1, int(np.ceil(self.settings.cycle_s)))) - 1
        end = path.state(last)
        moves = isinstance(decision.action, FlyTo)
        airspeed = (vehicle.speed_m_s if moves else 0.0) + situation.wind.speed_m_s
        used = energy.used_wh(end.time_s - situation.state.time_s, airspeed)
        home = self._way_home_wh(energy, end, wind)
        if not battery.must_return(home, used):
            return None
        return Decision(
            action=Return(),
            reason=(
                f"{battery.remaining_wh:.0f} Wh left; {decision.action} takes {used:.0f} Wh "
                f"and the return from there {home:.0f} Wh"
            ),
        )

    def set_energy(self, energy: EnergyModel) -> None:
        """Replace the energy model by one updated from the battery's readings."""
        if self.settings.energy is not None:
            self.settings = replace(self.settings, energy=energy)
