"""A drone that searches in virtual time, and the animals that it hears."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import made
import numpy as np
from flown import HOME, STEP_S, Flown
from some import some

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import Pulse, PulsePose, SearchNote, SearchReport, Tag
from uavrt.guidance.autopilot_behaviour import BEHAVIOURS
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Limits, Order, VehicleNow
from uavrt.guidance.order_execution import OrderExecution
from uavrt.guidance.search.search_run import Choice, SearchRun
from uavrt.guidance.search.search_task import Equipment
from uavrt.localization.antenna import PATTERNS
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import FlyingVehicle

PATTERN = PATTERNS["RA-23K"]
HEARD_DB = 9.2


@dataclass
class Animal:
    """Where it is, how it walks [m/s], and its SNR at 100 m on boresight."""

    north_m: float
    east_m: float
    level_db: float = 38.0
    walks: tuple[float, float] = (0.0, 0.0)
    """North, east."""
    interval_s: float = 1.25
    next_s: float = 0.0


@dataclass
class Searched:
    """The drone, its search and the animals; tags are 2, 4, 6 …"""

    flavour: Flavour
    animals: list[Animal]
    seed: int = 1
    limits: Limits = field(
        default_factory=lambda: Limits(battery_wh=160.0, speed_m_s=8.0, fence_m=500.0)
    )
    frame: Frame = field(default_factory=lambda: Frame(battery_wh=160.0))
    radius_m: float = 280.0
    accuracy_m: float = 25.0
    duration_s: float = 900.0
    absent: int = 0
    """Tags that are sought besides and are not there."""
    listens: bool = True
    """The detectors report."""
    make: Callable[..., Flown] = Flown
    """The drone."""

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.flown = self.make(self.flavour, frame=self.frame, limits=self.limits)
        count = len(self.animals) + self.absent
        self.tags = [
            made.tag(
                2 * number + 2,
                150e6 + 1e4 * number,
                self.animals[number].interval_s if number < len(self.animals) else 1.3,
            )
            for number in range(count)
        ]
        self.notes: list[SearchNote] = []
        self.errors_m: dict[int, float] = {}
        """Of each tag found, at that moment."""
        self.nearest_m = math.inf
        self._think_s = self._report_s = self.begun_s = self.flown.time_s

    def order(self, **values: Any) -> Order:
        return Order(
            order_id=7,
            action="search",
            radius_m=self.radius_m,
            accuracy_m=self.accuracy_m,
            duration_s=self.duration_s,
            **values,
        )

    def seeker_of(self, order: Order) -> SearchRun:
        now = some(self.flown.now())
        equipment = Equipment(pattern=PATTERN, seed=self.seed)
        return SearchRun(
            order, self.tags, now, self.limits, BEHAVIOURS[self.flavour], equipment
        )

    def begin(self) -> OrderExecution:
        """Ask for the search and confirm it."""
        flown, order = self.flown, self.order()
        self.search_run = self.seeker_of(order)
        flown.confirm(order)
        now = some(flown.now())
        choice = self.search_run.begin(self.time_ns, now)
        self.notes.extend(choice.notes)
        self.execution = OrderExecution(order, self.search_run.plan, self.limits, waits=True)
        self.execution.redirect(some(choice.steps), now)
        flown.execution = self.execution
        self.begun_s = self._think_s = self._report_s = flown.time_s
        return self.execution

    @property
    def time_ns(self) -> int:
        return round(self.flown.time_s * 1e9)

    @property
    def out(self) -> bool:
        return self.flown.authority.standing is ControlStage.OUT

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> None:
        ended = until or (lambda: self.out)
        for _ in range(round(seconds / STEP_S)):
            self.step()
            if ended():
                return

    def step(self) -> None:
        self.flown.step()
        self.live()

    def live(self) -> None:
        """The animals walk and are heard, and the search thinks."""
        flown = self.flown
        for number, animal in enumerate(self.animals):
            animal.north_m += animal.walks[0] * STEP_S
            animal.east_m += animal.walks[1] * STEP_S
            north, east = flown.vehicle.body.place_m
            off = math.hypot(animal.north_m - north, animal.east_m - east)
            self.nearest_m = min(self.nearest_m, off)
            if flown.time_s >= animal.next_s:
                animal.next_s = flown.time_s + animal.interval_s
                self._beep(self.tags[number], animal)
        if self.listens and flown.time_s >= self._report_s:
            self._report_s += 1.0
            for tag in self.tags:
                self.search_run.searched(report(tag.tag_id, self.time_ns))
        now = flown.now()
        if now is None:
            return
        self.search_run.place(self.time_ns, now)
        self.decide(now)

    def decide(self, now: VehicleNow) -> None:
        """As the guide does, in no time."""
        if self.is_time:
            choice = self.search_run.decide(self.time_ns, now, idle=self.execution.idle)
            self.take_up(choice, now)

    @property
    def is_time(self) -> bool:
        due = self.flown.time_s >= self._think_s - (4.5 if self.execution.idle else 0.0)
        if due:
            self._think_s = self.flown.time_s + 5.0
        return due

    def take_up(self, choice: Choice, now: VehicleNow) -> None:
        self._note(choice.notes)
        if choice.steps is not None:
            self.execution.redirect(choice.steps, now)

    def _note(self, notes: tuple[SearchNote, ...]) -> None:
        self.notes.extend(notes)
        for note in notes:
            if note.event == "found":
                assert note.tag_id is not None
                number = note.tag_id // 2 - 1
                told = note.tags[number]
                place = HOME.to_geodetic(
                    self.animals[number].north_m, self.animals[number].east_m
                )
                self.errors_m[note.tag_id] = distance_m(
                    told.latitude_deg, told.longitude_deg, *place
                )

    def _beep(self, tag: Tag, animal: Animal) -> None:
        snr = snr_db(animal, self.flown.vehicle) + 2.0 * float(self.rng.normal())
        if snr > HEARD_DB:
            self.search_run.pulse(self.heard(tag, snr))

    def heard(self, tag: Tag, snr_db: float) -> PulsePose:
        vehicle = self.flown.vehicle
        latitude, longitude = vehicle.latitude_longitude()
        pose = made.pose(
            self.time_ns,
            latitude,
            longitude,
            altitude_relative_m=vehicle.body.shown_height_m,
            altitude_amsl_m=HOME.altitude_amsl_m + vehicle.body.shown_height_m,
            yaw_deg=vehicle.heading.yaw_deg,
        )
        return PulsePose(pulse=pulse(tag, self.time_ns, snr_db), pose=pose)


def snr_db(animal: Animal, vehicle: FlyingVehicle) -> float:
    """SNR of a pulse at the drone's antenna, without what differs from pulse to pulse."""
    north, east = vehicle.body.place_m
    dn, de = animal.north_m - north, animal.east_m - east
    height = vehicle.body.shown_height_m
    slant = math.hypot(dn, de, height)
    yaw = math.radians(vehicle.heading.yaw_deg)
    ahead, right = (
        dn * math.cos(yaw) + de * math.sin(yaw),
        de * math.cos(yaw) - dn * math.sin(yaw),
    )
    unit = (np.array([one / slant]) for one in (ahead, right, height))
    gain = float(PATTERN.gain_towards_db(*unit)[0])
    return animal.level_db - 26.0 * math.log10(slant / 100.0) + gain


def pulse(tag: Tag, time_ns: int, snr_db: float, **changes: Any) -> Pulse:
    """A confirmed one."""
    own = {"tag_id": tag.tag_id, "frequency_hz": tag.frequency_hz, "noise_psd": 1e-9}
    return made.pulse(time_ns, snr_db=snr_db, **(own | changes))


def report(tag_id: int, time_ns: int) -> SearchReport:
    """A detector's, that searched until then."""
    return made.search_report(
        tag_id, time_ns, frequency_hz=150e6, noise_psd=1e-9, best_score=0.1
    )
