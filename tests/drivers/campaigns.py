"""Orders flown from end to end, and takeovers at random instants, as campaigns.

Telemetry and commands go through the motion handler, the authority, the execution of the order
and the frames of the link, in virtual time, with a simulated PX4 or ArduCopter.
"""

import math
import random
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import made
from flown import Flown
from motion_handled import MotionHandled
from searched import Animal, Searched
from some import some

from uavrt.core.units import wrap_degrees_180
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.operator_orders import Limits
from uavrt.guidance.safety import SAFETY
from uavrt.link.mavlink.dialect import MavCmd
from uavrt.link.mavlink.frame import FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour, Frame
from uavrt.simulation.vehicle.simulated_flying import MODES
from uavrt.simulation.vehicle.vehicle_telemetry import target_message

LONGEST_S = 1500.0
WELL = ("done", "returning: the autopilot flies home")
"""How an order ends that nobody took over; a search ends in its return."""


class Framed(MotionHandled):
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
    arrived = some(frame.message())
    return arrived


def air(rng: random.Random) -> tuple[float, float]:
    speed, way = rng.uniform(0.0, 8.0), rng.uniform(0.0, math.tau)
    return speed * math.cos(way), speed * math.sin(way)


def frame_of(rng: random.Random, **values: Any) -> Frame:
    """A drone that may fly faster or slower than the settings say."""
    return Frame(
        speed_m_s=rng.choice((5.0, 5.0, 8.0, 10.0)),
        gust_m=rng.uniform(0.02, 0.15),
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
    vehicle.heading.yaw_deg = rng.uniform(0.0, 360.0)
    turns = rng.random() < 0.3
    vehicle.heading.setpoint_deg = rng.uniform(0.0, 360.0) if turns else vehicle.heading.yaw_deg
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
            gust_m=rng.uniform(0.02, 0.15),
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
    if flavour == "px4" and rng.random() < 0.3:
        start_s = flown.vehicle.ground.idle_s + rng.uniform(0.0, 1.0)
        flown.vehicle.ground.false_flight_s = (start_s, start_s + rng.uniform(0.2, 1.2))
    flown.order("takeoff", height_m=rng.uniform(30.0, 90.0))
    execution, flown.execution = flown.execution, None
    flown.run(rng.uniform(0.0, 1.0))  # until the guide begins
    flown.execution = execution
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
        flown.run(20.0, until=lambda: flown.authority.fault(flown.time_s) is None)
        flown.order("goto", places=(flown.place(60.0, 40.0),), height_m=50.0)
        reason = ended(flown)
    return None if reason in WELL else f"{flavour} {action} {seed}: {reason}"


def ended(flown: Flown) -> str:
    flown.run(LONGEST_S, until=lambda: flown.authority.standing is ControlStage.OUT)
    if flown.authority.standing is not ControlStage.OUT:
        return "not ended"
    return flown.authority.reason


# ------------------------------------------------------------------------- takeovers


def other_mode(flown: Framed, rng: random.Random) -> None:
    names = MODES[flown.flavour]
    ours = (names["hold"], names.get("takeoff"), flown.vehicle.mode)
    flown.vehicle.set_mode(rng.choice([one for one in names.values() if one not in ours]))


def go_elsewhere(flown: Framed, rng: random.Random) -> None:
    flown.go_to(rng.uniform(-200, 200), rng.uniform(-200, 200))


def go_nearby(flown: Framed, rng: random.Random) -> None:
    """A metre beside our target."""
    target = some(flown.vehicle.target)
    way = rng.uniform(0.0, math.tau)
    flown.go_to(target.north_m + math.cos(way), target.east_m + math.sin(way))


def turn_at_our_target(flown: Framed, rng: random.Random) -> None:
    """Go to where we have sent it, a centimetre higher, looking elsewhere by 5 to 15°."""
    vehicle, (_, last) = flown.vehicle, flown.commands[-1]
    assert vehicle.heading.setpoint_deg is not None
    by_deg = rng.choice((-1, 1)) * rng.uniform(5.0, 15.0)
    yaw = math.radians(vehicle.heading.setpoint_deg + by_deg)
    flown._reposition(x=last.x, y=last.y, z=last.z + 0.01, param4=yaw)


def turn_away(flown: Framed, rng: random.Random) -> None:
    """Ask for another heading, as a ground station's "rotate" does on ArduCopter."""
    by_deg, way = rng.uniform(60.0, 180.0), rng.choice((-1.0, 1.0))
    rate_deg_s = rng.uniform(30.0, 90.0)
    turn = made.command_long(MavCmd.CONDITION_YAW, by_deg, rate_deg_s, way, 1.0)
    flown.vehicle.command(turn)


def set_velocity(flown: Framed, rng: random.Random) -> None:
    still = rng.random() < 0.5
    flown.vehicle.set_velocity(*((0.0, 0.0) if still else (rng.uniform(-2, 2), 1.0)), 0.0)


def move_stick(flown: Framed, rng: random.Random) -> None:
    channels = list(flown.channels)
    channels[rng.randrange(4)] += rng.choice((-1, 1)) * rng.randint(65, 400)
    flown.channels = tuple(channels)


def fail(flown: Framed, rng: random.Random) -> None:
    flown.failsafe = rng.choice(("heartbeat", "fence", "battery"))


def lose_remote(flown: Framed, _: random.Random) -> None:
    flown.channels = ()


def restart(flown: Framed, _: random.Random) -> None:
    flown.boot_s = 0.0


def move_home(flown: Framed, rng: random.Random) -> None:
    flown.home_north_m = rng.choice((-1, 1)) * rng.uniform(3.0, 300.0)


def disarm(flown: Framed, _: random.Random) -> None:
    flown.vehicle.armed = False


Takeover = tuple[Callable[[Framed, random.Random], None], float, float]
TAKEOVERS: dict[str, Takeover] = {
    # What happens; how long until PX4, and ArduCopter, show it [s]; 0: not to be had there.
    "pause": (lambda flown, _: flown.pause(), 0.1, 0.1),
    "pause by 193": (lambda flown, _: flown.pause_by_193(), 0.0, 9.0),
    "go elsewhere": (go_elsewhere, 0.1, 0.1),
    "go nearby": (go_nearby, 0.1, 0.1),
    "turn at our target": (turn_at_our_target, 0.6, 0.0),
    "turn": (turn_away, 0.0, 2.0),
    "velocity": (set_velocity, 0.0, 0.3),
    "mode": (other_mode, 0.5, 0.1),
    "stick": (move_stick, 0.2, 0.2),
    "remote lost": (lose_remote, 1.75, 1.75),
    "failsafe": (fail, 1.0, 0.5),
    "restart": (restart, 0.1, 0.1),
    "home moved": (move_home, 1.0, 1.0),
    "disarmed": (disarm, 1.0, 0.1),
}
NEED_REMOTE = ("stick", "remote lost")
CROSSED = "crossed"
STANDS_M_S = 0.1


def takeover_fault(name: str, flavour: Flavour, seed: int) -> str | None:
    """Take over at a random instant of a random order; what is wrong, else None.

    A command that was under way, and undid the takeover before any message showed it, makes it
    `CROSSED`: the pilot would do it again.
    """
    rng = random.Random(f"{name} {seed}")
    event, *shown = TAKEOVERS[name]
    shown_s = shown[flavour == "ardupilot"]
    flown = flying(flavour, rng, name)
    story = f"{flavour} {name} {seed}"
    before = target_message(flown.vehicle, 0)
    begun_s, sent = flown.time_s, len(flown.commands)
    event(flown, rng)
    if name == "pause" and is_same(before, target_message(flown.vehicle, 0)):
        return CROSSED
    stood_s: float | None = None
    while flown.authority.standing is not ControlStage.OUT and flown.time_s < begun_s + 40.0:
        flown.step()
        if stood_s is None and math.hypot(*flown.vehicle.body.velocity_m_s) < STANDS_M_S:
            stood_s = flown.time_s
    out_s, reason = flown.time_s, flown.authority.reason
    late = [time_s for time_s, _ in flown.commands[sent:]]
    if name != "pause by 193" and late and late[0] <= begun_s + shown_s + 0.06:
        return CROSSED
    flown.run(15.0)
    if len(flown.commands) != sent + len(late):
        return f"{story}: a command after it was out ({reason})"
    if name == "pause by 193":
        # Paused within the tolerance of its target, it shows by not leaving for the next.
        until_s = max(
            [
                (stood_s or begun_s) + 4.0,
                *(one + SAFETY.no_progress_s + 0.3 for one in late[-1:]),
            ]
        )
        arrives = reason in WELL and not late  # paused as good as at its last place
        if not arrives and (stood_s is None or out_s > until_s):
            return (
                f"{story}: out {out_s - (stood_s or begun_s):.1f} s after its stop ({reason})"
            )
        return CROSSED if late else None
    if late or out_s > begun_s + max(shown_s + 0.2, 4.0):
        return f"{story}: out after {out_s - begun_s:.2f} s ({reason}), commands at {late}"
    return None


def is_same(before: Any, after: Any) -> bool:
    """Whether a pause where it stands differs by less than the 5 cm that PX4's targets do."""
    if before is None or after is None:
        return False
    north = 0.0111 * (before.lat_int - after.lat_int)
    east = 0.0076 * (before.lon_int - after.lon_int)
    return math.hypot(north, east) <= 0.05 and abs(before.alt - after.alt) <= 0.05


def is_clear(flown: Framed, last: Any) -> bool:
    """Whether it is at our target or far from it: in between, bearings change."""
    vehicle, target = flown.vehicle, flown.vehicle.target
    if target is None or getattr(last, "x", None) is None:
        return False
    north, east = vehicle.body.place_m
    away_m = math.hypot(target.north_m - north, target.east_m - east)
    setpoint_deg = wanted_deg = some(vehicle.heading.setpoint_deg)
    if vehicle.heading.wanted_deg is not None:
        wanted_deg = vehicle.heading.wanted_deg
    elif away_m > 2.0:
        wanted_deg = math.degrees(math.atan2(target.east_m - east, target.north_m - north))
    # In a turn, the pilot may by chance ask for the heading to which it turns.
    turns = abs(wrap_degrees_180(wanted_deg - setpoint_deg)) > 1.0
    return not turns and not 0.5 < away_m < 30.0


def looks_ahead(flown: Framed) -> bool:
    """Whether it looks and flies to its target, and is not there within half a second."""
    vehicle, target = flown.vehicle, flown.vehicle.target
    if target is None:
        return False
    north, east = target.north_m - vehicle.body.north_m, target.east_m - vehicle.body.east_m
    off_deg = wrap_degrees_180(math.degrees(math.atan2(east, north)) - vehicle.heading.yaw_deg)
    speed_m_s = math.hypot(*vehicle.body.velocity_m_s)
    return abs(off_deg) < 3.0 and math.hypot(north, east) > 0.5 * speed_m_s > 0.5


def flying(flavour: Flavour, rng: random.Random, name: str) -> Framed:
    """A drone in command, somewhere in an order in which the takeover means something."""
    while True:
        action = rng.choice(("survey", "search", "rotation"))
        flown = BEGUN[action](flavour, rng.randrange(1_000_000))
        flown.run(rng.uniform(3.0, 45.0))
        vehicle, wishes = flown.vehicle, flown.authority.standing is ControlStage.IN_COMMAND
        moves = math.hypot(*vehicle.body.velocity_m_s) > 1.0
        last = flown.commands[-1][1] if flown.commands else None
        fits = not (name == "pause by 193" and not moves)
        fits &= not (name in NEED_REMOTE and not flown.channels)
        fits &= not (name == "turn at our target" and not is_clear(flown, last))
        fits &= not (name == "turn" and not looks_ahead(flown))
        if wishes and fits:
            return flown
