"""Orders flown from end to end, and takeovers at random instants, as campaigns.

Telemetry and commands go through MotionDesk, Authority, Pilot and the frames of the link, in
virtual time, with a simulated autopilot in the manners of PX4 or ArduCopter.
"""

import math
import random
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from desked import Desked
from flown import Flown
from searched import Animal, Searched

from uavrt.guidance.authority import Standing
from uavrt.guidance.orders import Limits
from uavrt.mavlink import FrameParser, FrameWriter
from uavrt.mavlink.message import Message
from uavrt.simulation.flying import MODES, Flavour, Frame

LONGEST_S = 1500.0
WELL = ("done", "returning: the autopilot flies home")
"""How an order ends that nobody took over; a search ends in its return."""


class Framed(Desked):
    """Its messages are frames on the way, in both directions."""

    def __init__(self, flavour: Flavour, **values: Any) -> None:
        self._theirs, self._ours = FrameWriter(1, 1), FrameWriter(1, 191)
        self._from_them, self._from_us = FrameParser(), FrameParser()
        super().__init__(flavour, **values)
        self.through = self._as_frames

    def _as_frames(self, _: float, told: Iterable[Message]) -> Iterator[Message]:
        for message in told:
            yield carried(message, self._theirs, self._from_them)

    def _command(self, message: Any) -> None:
        super()._command(carried(message, self._ours, self._from_us))


def carried(message: Message, writer: FrameWriter, parser: FrameParser) -> Message:
    (frame,) = parser.feed(writer.encode(message))
    arrived = frame.message()
    assert arrived is not None
    return arrived


def air(rng: random.Random) -> tuple[float, float]:
    speed, way = rng.uniform(0.0, 8.0), rng.uniform(0.0, math.tau)
    return speed * math.cos(way), speed * math.sin(way)


def frame_of(rng: random.Random, **values: Any) -> Frame:
    """A drone that may fly faster or slower than the settings say."""
    return Frame(
        speed_m_s=rng.choice((5.0, 5.0, 8.0, 10.0)),
        gust_m=rng.uniform(0.02, 0.3),
        wind_m_s=air(rng),
        battery_wh=3000.0,
        **values,
    )


LIMITS = Limits(battery_wh=3000.0, fence_m=900.0, speed_m_s=5.0)


def hovering(flavour: Flavour, rng: random.Random) -> Framed:
    """A drone that its pilot has left hovering, in his mode or in ours, looking anywhere."""
    flown = Framed(
        flavour,
        frame=frame_of(rng),
        limits=LIMITS,
        phase_s=rng.uniform(0.0, 100.0),
        sticks=rng.random() < 0.5,
    )
    leave(flown, rng)
    return flown


def leave(flown: Framed, rng: random.Random) -> None:
    """Let its pilot give up control: some drones still turn then."""
    vehicle = flown.vehicle
    vehicle.yaw_deg = rng.uniform(0.0, 360.0)
    turns = rng.random() < 0.3
    vehicle.yaw_setpoint_deg = rng.uniform(0.0, 360.0) if turns else vehicle.yaw_deg
    if rng.random() < 0.5:
        vehicle.set_mode(MODES[flown.flavour]["hold"])
    flown.run(rng.uniform(1.2, 3.0))


def survey(flavour: Flavour, seed: int) -> Framed:
    """Begin a survey of two to four lines of 10 to 300 m."""
    rng = random.Random(f"survey {seed}")
    flown = hovering(flavour, rng)
    length = math.exp(rng.uniform(math.log(10.0), math.log(300.0)))
    spacing = rng.uniform(10.0, 60.0)
    wide = spacing * rng.uniform(1.2, 3.4)
    turn, north, east = rng.uniform(0.0, math.tau), rng.uniform(-80, 80), rng.uniform(-80, 80)
    corners = [
        (
            north + x * math.cos(turn) - y * math.sin(turn),
            east + x * math.sin(turn) + y * math.cos(turn),
        )
        for x, y in ((0.0, 0.0), (length, 0.0), (length, wide), (0.0, wide))
    ]
    flown.order(
        "survey",
        places=tuple(flown.place(*one) for one in corners),
        spacing_m=spacing,
        pattern=rng.choice(("lines", "lines", "around")),
        height_m=rng.uniform(25.0, 100.0),
    )
    return flown


def search(flavour: Flavour, seed: int) -> Framed:
    """Begin a search for one to three animals."""
    rng = random.Random(f"search {seed}")
    animals = [
        Animal(rng.uniform(-200, 200), rng.uniform(-200, 200), rng.uniform(30.0, 42.0))
        for _ in range(rng.randint(1, 3))
    ]
    made = Searched(
        flavour,
        animals,
        seed=seed,
        limits=Limits(battery_wh=800.0, fence_m=700.0, speed_m_s=8.0),
        frame=Frame(
            speed_m_s=rng.choice((8.0, 10.0)),
            gust_m=rng.uniform(0.02, 0.3),
            wind_m_s=air(rng),
            battery_wh=800.0,
        ),
        duration_s=rng.uniform(60.0, 400.0),
        make=lambda *given, **values: Framed(
            *given, phase_s=rng.uniform(0.0, 100.0), sticks=rng.random() < 0.5, **values
        ),
    )
    flown = made.flown
    assert isinstance(flown, Framed)
    leave(flown, rng)
    made.begin()
    flown.each_step = made.live
    return flown


def takeoff(flavour: Flavour, seed: int) -> Framed:
    """Begin a take-off; afterwards a first order, while PX4 still corrects its home."""
    rng = random.Random(f"takeoff {seed}")
    flown = Framed(
        flavour,
        frame=frame_of(rng, climb_m_s=rng.uniform(1.0, 4.0)),
        limits=LIMITS,
        phase_s=rng.uniform(0.0, 100.0),
        sticks=rng.random() < 0.5,
        on_ground=True,
    )
    flown.run(rng.uniform(0.5, 3.0))
    flown.order("takeoff", height_m=rng.uniform(21.0, 90.0))
    return flown


def rotation(flavour: Flavour, seed: int) -> Framed:
    rng = random.Random(f"rotation {seed}")
    flown = hovering(flavour, rng)
    flown.order("rotate", duration_s=rng.uniform(20.0, 60.0), clockwise=rng.random() < 0.5)
    return flown


BEGUN: dict[str, Callable[[Flavour, int], Framed]] = {
    "survey": survey,
    "search": search,
    "takeoff": takeoff,
    "rotation": rotation,
}


def fault_of(action: str, flavour: Flavour, seed: int) -> str | None:
    """Fly one order that nobody takes over; how it ended, if not well."""
    flown = BEGUN[action](flavour, seed)
    reason = ended(flown)
    if reason in WELL and action == "takeoff":
        flown.run(random.Random(seed).uniform(0.5, 20.0))
        flown.order("goto", places=(flown.place(60.0, 40.0),), height_m=50.0)
        reason = ended(flown)
    return None if reason in WELL else f"{flavour} {action} {seed}: {reason}"


def ended(flown: Flown) -> str:
    flown.run(LONGEST_S, until=lambda: flown.authority.standing is Standing.OUT)
    if flown.authority.standing is not Standing.OUT:
        return "not ended"
    return flown.authority.reason
