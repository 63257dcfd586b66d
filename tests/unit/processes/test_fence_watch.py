"""The vehicle's fence as the drone side reads it: when, and what it makes of silence."""

import random

import made
import pytest

from uavrt.core.messages import VehicleFence
from uavrt.drone.processes.motions.fence_watch import FenceWatch
from uavrt.guidance.files.mission import MissionItem
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.mission_store import MissionStore

OWN = (1, 191)


class Watched:
    """A watch beside an autopilot, in virtual time."""

    def __init__(self, *, loss: float = 0.0) -> None:
        self.store = MissionStore("ardupilot")
        self.random, self.loss = random.Random(5), loss
        self.now_s = 100.0
        self.asked = 0
        self.told: list[VehicleFence] = []
        self.answers: list[Message] = []
        self.watch = FenceWatch(self.send, self.told.append, lambda: OWN)

    def send(self, message: Message) -> None:
        self.asked += isinstance(message, dialect.MissionRequestList)
        if self.random.random() >= self.loss:
            self.store.receive(message, OWN, self.now_s, self.answers.append)

    def run(self, seconds: float, *, resting: bool = True) -> None:
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            answers, self.answers = self.answers, []
            for message in answers:
                if self.random.random() >= self.loss:
                    self.watch.vehicle(message, self.now_s)
            self.watch.tick(self.now_s, resting=resting)

    def draw(self, radius_m: float) -> None:
        """Let somebody upload a circle to stay within."""
        circle = MissionItem(
            frame=0, command=5003, params=(radius_m, 0.0, 0.0, 0.0), x=471_000_000, y=85_000_000
        )
        self.store.held[1] = made.mission_items([circle], 1)

    @property
    def radius_m(self) -> float | None:
        return self.told[-1].within[0].radius_m


def test_it_is_read_at_once_and_every_half_minute() -> None:
    watched = Watched()
    watched.run(1.0)
    assert watched.told == [VehicleFence()]
    watched.draw(200.0)
    watched.run(31.0)
    assert watched.radius_m == 200.0
    assert watched.asked == 2
    assert watched.watch.counters() == {"fence_read": 2.0}


def test_it_is_not_asked_for_while_something_is_flown() -> None:
    watched = Watched()
    watched.run(1.0)
    watched.draw(200.0)
    watched.run(300.0, resting=False)
    assert watched.asked == 1
    watched.run(1.0)
    assert watched.radius_m == 200.0


def test_it_arrives_though_a_fifth_is_lost() -> None:
    watched = Watched(loss=0.2)
    watched.draw(200.0)
    watched.run(20.0)
    assert watched.radius_m == 200.0


def test_silence_is_counted_and_no_fence() -> None:
    watched = Watched(loss=1.0)
    watched.run(60.0)
    assert not watched.told
    assert watched.watch.counters()["fence_not_read"] >= 1.0


@pytest.mark.parametrize("command", [16, 20, 5001])
def test_what_is_no_fence_is_told_with_its_fault(command: int) -> None:
    watched = Watched()
    watched.draw(1.0)
    watched.store.held[1][0].command = command
    watched.run(1.0)
    assert watched.told[-1].fault is not None


def test_of_another_autopilot_nothing_is_known() -> None:
    watched = Watched()
    watched.run(1.0)
    watched.watch.autopilot_found()
    watched.watch.repeat()
    assert len(watched.told) == 1
    watched.run(1.0)
    assert len(watched.told) == 2
