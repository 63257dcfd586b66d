"""Differences between PX4 and ArduPilot as multirotor autopilots, in one table.

As flown on PX4 v1.17 and ArduCopter 4.7. `uavrt.guidance.control.authority` handles what both
share: a flight to a position is DO_REPOSITION by COMMAND_INT in frame GLOBAL_INT with altitude
above mean sea level.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from uavrt.core.errors import CommandRefused

AutopilotName = Literal["px4", "ardupilot"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Behaviour:
    """Modes, messages and tolerances of one kind of autopilot."""

    name: AutopilotName
    own_mode: int
    """Number of the mode in which commands are flown; the command DO_REPOSITION sets it."""
    return_modes: frozenset[int]
    mode_names: Mapping[int, str]
    yaw_in_reposition: bool
    """True if headings are commanded by DO_REPOSITION (a turn in several steps), False if by
    CONDITION_YAW."""
    follows_course: bool
    """True if the nose turns in flight to the direction of motion, False if it turns to the
    target."""

    takeoff_mode: int
    """Mode in which the vehicle takes off, before it changes to `own_mode`."""

    mission_modes: frozenset[int]
    """Numbers of the modes in which the vehicle flies its mission or returns along it."""
    home_in_mission: bool
    """True if item 0 of the vehicle's mission is the home position."""

    target_m: float
    """Largest distance between a reported target and the commanded one at which they count as
    equal [m]. PX4 reports the exact numbers of a command; the target that a pause sets must
    differ from them."""

    settles_m: float
    """Largest distance from the target at which a drone comes to rest by itself [m]; one that
    rests farther away was stopped. ArduCopter: 0.6 m in 203 recorded legs of SITL without wind,
    0.66 m in the simulator's gusts. PX4 slows down over the last metres."""

    target_lost_s: float
    """Time without a reported target after which an order ends [s]. ArduCopter stops reporting
    a target when another station commands velocities."""

    @property
    def own_mode_first(self) -> bool:
        """True if `own_mode` must be set before a take-off is commanded."""
        return self.takeoff_mode == self.own_mode

    def mode_name(self, mode: int) -> str:
        """Return the name of a flight mode as shown to pilots, or its number if unknown."""
        return self.mode_names.get(mode, f"mode {mode}")


def _px4(main: int, sub: int = 0) -> int:
    """Return PX4's number of a mode: main mode in the third byte, submode in the fourth."""
    return main << 16 | sub << 24


PX4 = Behaviour(
    name="px4",
    own_mode=_px4(4, 3),
    return_modes=frozenset({_px4(4, 5)}),
    mode_names=MappingProxyType(
        {
            _px4(1): "Manual",
            _px4(2): "Altitude",
            _px4(3): "Position",
            _px4(4, 2): "Takeoff",
            _px4(4, 3): "Hold",
            _px4(4, 4): "Mission",
            _px4(4, 5): "Return",
            _px4(4, 6): "Land",
            _px4(5): "Acro",
            _px4(6): "Offboard",
            _px4(7): "Stabilized",
        }
    ),
    yaw_in_reposition=True,
    follows_course=False,
    takeoff_mode=_px4(4, 2),
    mission_modes=frozenset({_px4(4, 4), _px4(4, 5)}),
    home_in_mission=False,
    target_m=0.05,
    settles_m=3.0,
    target_lost_s=3.0,
)
ARDUPILOT = Behaviour(
    name="ardupilot",
    own_mode=4,
    return_modes=frozenset({6, 21}),
    mode_names=MappingProxyType(
        {
            0: "Stabilize",
            2: "AltHold",
            3: "Auto",
            4: "Guided",
            5: "Loiter",
            6: "RTL",
            9: "Land",
            16: "PosHold",
            17: "Brake",
            21: "SmartRTL",
            27: "Auto RTL",
        }
    ),
    yaw_in_reposition=False,
    follows_course=True,
    takeoff_mode=4,
    mission_modes=frozenset({3, 27}),
    home_in_mission=True,
    target_m=0.3,
    settles_m=0.9,
    target_lost_s=1.0,
)
BEHAVIOURS: Mapping[AutopilotName, Behaviour] = MappingProxyType(
    {"px4": PX4, "ardupilot": ARDUPILOT}
)


def behaviour_of(name: str | None) -> Behaviour:
    """Return the behaviour of an autopilot; raises `CommandRefused` if it is unknown."""
    for known, behaviour in BEHAVIOURS.items():
        if known == name:
            return behaviour
    raise CommandRefused(
        "the autopilot's type is unknown"
        if name is None
        else f"autopilot {name} is not supported",
        remedy="Motion needs a multirotor with PX4 or ArduPilot; fly by hand",
    )
