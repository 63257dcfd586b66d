"""Run ``uavrt demo --search``: a simulated drone finds animals autonomously."""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
from rich.table import Table

from uavrt.config.settings import GuidanceSettings, Settings
from uavrt.core.earth.geodesy import distance_m
from uavrt.core.errors import UavrtError
from uavrt.core.messages import ProcessStatus, SearchNote, SoughtTag, SystemStatus
from uavrt.core.terminal_tables import table_of
from uavrt.core.units import ns_from_s
from uavrt.flight.flight_layout import require_writable
from uavrt.simulation.demo.demo_programs import DemoPaths, Program, free_udp_port
from uavrt.simulation.demo.rig import Rig, starting_in
from uavrt.simulation.demo.telling import in_plain_words
from uavrt.simulation.demo.workplace import workplace
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.vehicle.airframe import Flavour

RADIUS_M = 260.0
ACCURACY_M = 35.0
"""Target accuracy of positions in the demo's search [m]; an animal that walks 30 m away is
seldom located better."""
BATTERY_WH = 120.0
SPEED_M_S = 8.0
START_LEAD_S = 2.0
READY_TIMEOUT_S = 30.0
SETTLES_S = 2.5
"""Waiting time after the end of a search, in which all counts are reported [s]."""
OTHERS_TIMEOUT_S = 60.0
RETURNS_WITHIN_S = 30.0
"""Longest duration of the return flight after a search has reached its time limit [s]."""
REFRESH_S = 0.25
FIRST_HEIGHT_M, ABOVE_M, BESIDE_M = 40.0, 12.0, 40.0
"""Search height of the first drone; upward and eastward step to each further drone [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SoughtAnimal:
    """Result of the demo's search for one animal."""

    name: str
    found: bool
    found_s: float | None
    """Time from the start of the search to the find [s]; None if not found."""
    error_m: float | None
    """Distance of the found position from the animal's true one at that time [m]."""
    radius95_m: float
    walked_m: float
    pulses: int
    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchSummary:
    """Result of ``uavrt demo --search``, printed as the last line with ``--json``."""

    tags: dict[str, SoughtAnimal]
    ended: str
    duration_s: float
    decisions: int
    commands: int
    guide_cpu_percent: float
    """Mean CPU use of the process that plans the search (guide) [% of one core]."""
    guide_memory_mb: float
    flight_directory: str

    @property
    def complete(self) -> bool:
        """True if every animal was found."""
        return all(one.found for one in self.tags.values())

    def table(self) -> Table:
        """Create a table of the results for a terminal."""
        found = sum(one.found for one in self.tags.values())
        after = f"after {self.duration_s:.0f} s"
        title = f"{found} of {len(self.tags)} animals found {after}"
        columns = ("tag", "found", "place", "error", "within")
        table = table_of(*columns, left=("tag", "place"), title=title)
        for column in table.columns:
            column.no_wrap = True
        for tag_id, one in self.tags.items():
            table.add_row(
                f"{tag_id} {one.name}",
                "no" if one.found_s is None else f"after {one.found_s:.0f} s",
                f"{one.latitude_deg:.5f}, {one.longitude_deg:.5f}",
                "–" if one.error_m is None else f"{one.error_m:.1f} m",
                f"{one.radius95_m:.0f} m",
            )
        return table


@dataclass(frozen=True, slots=True, kw_only=True)
class Among:
    """Number, ground station port and start time of one drone of a joint search."""

    number: int
    ground_port: int
    start_ns: int

    @property
    def height_m(self) -> float:
        """Height at which this drone searches [m]."""
        return FIRST_HEIGHT_M + ABOVE_M * (self.number - 1)

    def placed(self, scenario: Scenario) -> Scenario:
        """Copy a world with the start position of this drone."""
        flight = replace(
            scenario.flight, east_m=BESIDE_M * (self.number - 1), height_m=self.height_m
        )
        return replace(scenario, flight=flight)


@dataclass(slots=True)
class _Seen:
    notes: list[SearchNote] = field(default_factory=list)
    guide: list[tuple[float, ProcessStatus]] = field(default_factory=list)
    flight_directory: str = ""
    commands: int = 0
    has_others: bool = False
    """True once the drone's search process (guide) has received other drones' data."""

    @property
    def ended(self) -> bool:
        return bool(self.notes) and self.notes[-1].event == "ended"


class SearchDemo:
    """Runs one search on this computer with the real programs; `say` prints a line."""

    def __init__(
        self,
        *,
        scenario: Scenario,
        limit_s: float,
        flight_dir: Path,
        say: Callable[[str], None],
        autopilot: Flavour = "px4",
        among: Among | None = None,
    ) -> None:
        self._among = among
        self.scenario = scenario
        self._limit_s, self._flight_dir = limit_s, flight_dir
        self._print = say
        self._rig = Rig(autopilot)
        self._seen = _Seen()

    def run(self) -> SearchSummary:
        """Run the search once and return its result; raises `UavrtError` if a program ends."""
        require_writable(self._flight_dir)
        with workplace("uavrt-search-") as work, self._rig:
            self._start(work)
            self._search()
            return self._summary()

    def _start(self, work: Path) -> None:
        among, scenario = self._among, self.scenario
        if among is None:
            scenario = starting_in(scenario, START_LEAD_S)
        else:
            scenario = among.placed(scenario).starting_at(among.start_ns)
        self.scenario, self._direct = scenario, free_udp_port()
        self._drone = self._rig.drone(
            scenario,
            DemoPaths(directory=work, flights=self._flight_dir.resolve()),
            system_id=1 if among is None else among.number,
            ground_port=None if among is None else among.ground_port,
            flies=True,
            supervisor=(msgspec.json.encode(scenario.tags).decode(),),
            settings=self._settings,
        )
        self._reader = self._rig.reader(self._drone, READY_TIMEOUT_S)

    def _settings(self, made: Settings) -> Settings:
        direct = f"udpin://127.0.0.1:{self._direct}"
        return replace(
            made,
            mavlink=replace(made.mavlink, direct_links=(direct,)),
            guidance=GuidanceSettings(enabled=True, battery_wh=BATTERY_WH, speed_m_s=SPEED_M_S),
        )

    # ------------------------------------------------------------------ the search

    def _search(self) -> None:
        self._wait_for_others()
        order = self._ordered()
        deadline_s = time.monotonic() + self._limit_s + RETURNS_WITHIN_S
        while not self._seen.ended:
            self._watch()
            if time.monotonic() > deadline_s:
                raise UavrtError("the search did not end in time", remedy="Run the demo again")
        settled_s = time.monotonic() + SETTLES_S
        while time.monotonic() < settled_s:
            self._watch()
        order.stop()

    def _wait_for_others(self) -> None:
        deadline_s = time.monotonic() + OTHERS_TIMEOUT_S
        while self._among is not None and not self._seen.has_others:
            self._watch()
            if time.monotonic() > deadline_s:
                raise UavrtError(
                    "the ground station does not report the drones to each other",
                    remedy="Run the demo again, with fewer drones if this computer is slow",
                )

    def _ordered(self) -> Program:
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        while True:
            order = self._rig.program(
                self._drone.paths.directory,
                "fly",
                *("fly", "search", "--yes", "--sticks-unseen", "--json"),
                *("--mavlink", f"udpout://127.0.0.1:{self._direct}"),
                *("--radius", str(RADIUS_M), "--accuracy", str(ACCURACY_M)),
                *("--minutes", str(self._limit_s / 60.0)),
                *(() if self._among is None else ("--height", str(self._among.height_m))),
            )
            while not self._seen.notes and not order.ended:
                self._watch()
            if self._seen.notes:
                return order
            if time.monotonic() > deadline_s:
                order.check()

    def _watch(self) -> None:
        self._drone.check()
        for topic, record in self._reader.read(REFRESH_S):
            match record:
                case SearchNote():
                    self._seen.notes.append(record)
                    self._print(in_plain_words(record))
                case SystemStatus() if topic == "system_status":
                    self._receive_status(record)

    def _receive_status(self, status: SystemStatus) -> None:
        seen = self._seen
        seen.flight_directory = status.flight_directory or seen.flight_directory
        for one in status.processes:
            if one.process == "connection":
                count = int(one.counters.get("motion_commands_sent", 0.0))
                seen.commands = max(seen.commands, count)
            if one.process == "guide":
                seen.has_others |= one.counters.get("other_drones", 0.0) > 0.0
            if one.process == "guide" and seen.notes and not seen.ended:
                seen.guide.append((time.monotonic(), one))

    # ------------------------------------------------------------------ the account

    @property
    def searched_ns(self) -> tuple[int, int]:
        """Start and end of the search [ns, UTC]."""
        return self._seen.notes[0].time_ns, self._seen.notes[-1].time_ns

    def _summary(self) -> SearchSummary:
        seen = self._seen
        last = seen.notes[-1]
        shutil.copy(self._drone.paths.scenario, seen.flight_directory)
        shutil.copy(self._drone.paths.flown, seen.flight_directory)
        cpu, memory = 0.0, 0.0
        if len(seen.guide) > 1:
            (first_s, first), (end_s, end) = seen.guide[0], seen.guide[-1]
            cpu = 100.0 * (end.cpu_s - first.cpu_s) / (end_s - first_s)
            memory = max(one.memory_mb for _, one in seen.guide)
        return SearchSummary(
            tags={str(one.tag_id): self._animal(one) for one in last.tags},
            ended=last.reason,
            duration_s=last.elapsed_s,
            decisions=sum(note.event == "decision" for note in seen.notes),
            commands=seen.commands,
            guide_cpu_percent=round(cpu, 2),
            guide_memory_mb=round(memory, 1),
            flight_directory=seen.flight_directory,
        )

    def _animal(self, sought: SoughtTag) -> SoughtAnimal:
        begun, last = self._seen.notes[0], self._seen.notes[-1]
        name = next(tag.name for tag in self.scenario.tags if tag.tag_id == sought.tag_id)
        then_ns = last.time_ns
        if sought.found_s is not None:
            then_ns = begun.time_ns + ns_from_s(sought.found_s)
        first, then = (
            self.scenario.tag_position(sought.tag_id, moment)
            for moment in (begun.time_ns, then_ns)
        )
        error = distance_m(sought.latitude_deg, sought.longitude_deg, *then)
        return SoughtAnimal(
            name=name or "",
            found=sought.found_s is not None,
            found_s=sought.found_s,
            error_m=None if sought.found_s is None else round(error, 1),
            radius95_m=round(sought.radius95_m, 1),
            walked_m=round(distance_m(*first, *then), 1),
            pulses=sought.pulses,
            latitude_deg=sought.latitude_deg,
            longitude_deg=sought.longitude_deg,
        )
