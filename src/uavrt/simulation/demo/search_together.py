"""Run ``uavrt demo --search --drones``: several simulated drones search together."""

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from uavrt.core.clock import Clock
from uavrt.core.errors import UavrtError
from uavrt.core.units import ns_from_s
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt.simulation.demo.demo_search import START_LEAD_S, Among, SearchDemo, SearchSummary
from uavrt.simulation.demo.rig import Rig
from uavrt.simulation.demo.workplace import workplace
from uavrt.simulation.scene.flown_path import FlownPath
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.vehicle.airframe import Flavour

STEP_NS = ns_from_s(0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class TogetherSummary:
    """Result of ``uavrt demo --search --drones``, printed as the last line with ``--json``."""

    drones: dict[str, SearchSummary]
    apart_m: float
    """Smallest horizontal distance of two drones while both searched [m]."""
    duration_s: float
    """Time from the start until the last drone ended its search [s]."""

    @property
    def found(self) -> set[str]:
        """Ids of the tags that at least one drone found, as text."""
        return {
            tag
            for drone in self.drones.values()
            for tag, animal in drone.tags.items()
            if animal.found
        }

    @property
    def complete(self) -> bool:
        """True if every animal was found."""
        return self.found == {tag for drone in self.drones.values() for tag in drone.tags}


class TogetherDemo:
    """Runs one search by several drones on this computer, with the real programs."""

    def __init__(
        self,
        *,
        drones: int,
        scenario: Scenario,
        limit_s: float,
        flight_dir: Path,
        say: Callable[[str], None],
        autopilot: Flavour = "px4",
    ) -> None:
        self._autopilot: Flavour = autopilot
        self._drones, self._scenario, self._limit_s = drones, scenario, limit_s
        self._flight_dir, self._print = flight_dir.resolve(), say
        self._searches: dict[int, SearchDemo] = {}
        self._ended: dict[int, SearchSummary | UavrtError] = {}

    def run(self) -> TogetherSummary:
        """Run the search once and return its result; raises `UavrtError` if a program ends."""
        with workplace("uavrt-together-") as work, Rig() as rig:
            ground_port = free_udp_port()
            # The station that serves all orders nothing.
            rig.ground(
                work,
                ground_port,
                self._flight_dir / "ground",
                *("--page", "--no-browser", "--port", "0"),
                vehicles=self._drones,
            )
            start_ns = Clock.start().now_ns() + ns_from_s(START_LEAD_S)
            threads = [
                threading.Thread(target=self._one, args=(number, ground_port, start_ns))
                for number in range(1, 1 + self._drones)
            ]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        summaries = {}
        for number, one in sorted(self._ended.items()):
            if isinstance(one, UavrtError):
                raise one
            summaries[str(number)] = one
        return TogetherSummary(
            drones=summaries,
            apart_m=round(self._apart_m(summaries), 1),
            duration_s=max(one.duration_s for one in summaries.values()),
        )

    def _one(self, number: int, ground_port: int, start_ns: int) -> None:
        directory = self._flight_dir / f"drone-{number}"
        directory.mkdir(parents=True, exist_ok=True)
        search = self._searches[number] = SearchDemo(
            scenario=self._scenario,
            limit_s=self._limit_s,
            flight_dir=directory,
            say=lambda line: self._print(f"drone {number}: {line}"),
            autopilot=self._autopilot,
            among=Among(number=number, ground_port=ground_port, start_ns=start_ns),
        )
        try:
            self._ended[number] = search.run()
        except UavrtError as error:
            self._ended[number] = error

    def _apart_m(self, summaries: dict[str, SearchSummary]) -> float:
        paths = {
            number: FlownPath(
                Path(summaries[str(number)].flight_directory) / "flown.path",
                search.scenario.plane,
            )
            for number, search in self._searches.items()
        }
        least = math.inf
        for one, other in combinations(self._searches, 2):
            spans = [self._searches[number].searched_ns for number in (one, other)]
            begin, end = max(first for first, _ in spans), min(last for _, last in spans)
            for time_ns in range(begin, end, STEP_NS):
                states = [paths[number].state(time_ns) for number in (one, other)]
                a, b = (state.position_ned_m[:2] for state in states if state is not None)
                least = min(least, math.dist(a, b))
        return least
