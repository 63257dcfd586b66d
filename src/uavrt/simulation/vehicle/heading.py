"""Simulate the heading of a vehicle that turns as PX4 and ArduCopter do."""

import math
from dataclasses import dataclass

from uavrt.simulation.vehicle.airframe import Flavour


@dataclass(frozen=True, slots=True)
class _Turning:
    """Parameters of how an autopilot turns: limits of rate and acceleration."""

    rate_deg_s: float
    acceleration_deg_s2: float
    braking_share: float = 0.8
    """Deceleration at the end of a turn as a fraction of the greatest acceleration."""
    gain_hz: float = 4.0
    """Ratio of the highest turning rate to the remaining angle [1/s]."""
    setpoint: "_Turning | None" = None
    """Limits of the heading setpoint; None: its acceleration is not limited."""

    def rate(
        self, off_deg: float, now_deg_s: float, step_s: float, goal_deg_s: float = 0.0
    ) -> float:
        """Turning rate after a time step [°/s].

        `off_deg`: remaining angle. `now_deg_s`: present turning rate. `goal_deg_s`: rate at
        which the commanded heading itself turns.
        """
        stops = math.sqrt(2.0 * self.braking_share * self.acceleration_deg_s2 * abs(off_deg))
        wanted_deg_s = min(self.rate_deg_s, stops, self.gain_hz * abs(off_deg))
        wanted = math.copysign(wanted_deg_s, off_deg) + goal_deg_s
        most = self.acceleration_deg_s2 * step_s
        return now_deg_s + max(-most, min(most, wanted - now_deg_s))


SETPOINT_AGE_S = 0.04
"""Largest age of a reported heading setpoint [s]. It varies the change between two reports by a
quarter, as in PX4 1.17 (SIH)."""
SETTLED_DEG = 0.3
"""Difference from the commanded heading [°] below which PX4's setpoint equals it."""
_TURNING: dict[Flavour, _Turning] = {
    "px4": _Turning(65.0, 90.0, setpoint=_Turning(60.0, 20.0, braking_share=1.0, gain_hz=10.0)),
    "ardupilot": _Turning(200.0, 185.0),
}
"""Measured turns of two autopilots. ArduCopter 4.7-dev reaches 129°/s in a turn by 107° and
165°/s in a turn by 180°. The heading setpoint of PX4 1.17 (SIH) accelerates and brakes with
20°/s² (MPC_YAWRAUTO_ACC)."""


class Heading:
    """Heading of the simulated drone's nose, and the setpoint that it follows."""

    def __init__(self, flavour: Flavour, yaw_deg: float) -> None:
        self._turning = _TURNING[flavour]
        self.yaw_deg, self.rate_deg_s = yaw_deg, 0.0
        self.setpoint_deg: float | None = None
        """Heading setpoint as PX4 reports it [°]; it turns ahead of the drone."""
        self._setpoint_rate_deg_s = 0.0
        self.wanted_deg: float | None = None
        self._turn_left_deg, self._turn_rate_deg_s = 0.0, 20.0
        """Remaining angle [°] and rate [°/s] of a CONDITION_YAW command, both signed."""

    def shown_setpoint(self, boot_ms: int) -> tuple[float, float]:
        """Heading setpoint [°] and its rate [°/s] as reported, with a small delay."""
        if self.setpoint_deg is None:
            return self.yaw_deg, 0.0
        age_s = SETPOINT_AGE_S * (boot_ms * 0.6180339887 % 1.0)  # a sequence without a pattern
        return self.setpoint_deg - age_s * self._setpoint_rate_deg_s, self._setpoint_rate_deg_s

    def turn_to(self, wanted_deg: float | None) -> None:
        """Turn to a heading [°]; with None, turn to the bearing of the target."""
        self.wanted_deg, self._turn_left_deg = wanted_deg, 0.0

    def turn(self, by_deg: float, rate_deg_s: float) -> None:
        """Turn clockwise by an angle [°] at a rate [°/s]."""
        self._turn_left_deg, self._turn_rate_deg_s = by_deg, rate_deg_s

    def advance(self, bearing_deg: float | None, step_s: float) -> None:
        """Turn for a time step, towards the commanded heading or else towards `bearing_deg`."""
        if self._turn_left_deg:
            most = self._turn_rate_deg_s * step_s
            step = max(-most, min(most, self._turn_left_deg))
            self._turn_left_deg -= step
            self.yaw_deg = (self.yaw_deg + step) % 360.0
            self.rate_deg_s = step / step_s
            self.setpoint_deg = None
            return
        if self.setpoint_deg is None:
            self.setpoint_deg, self._setpoint_rate_deg_s = self.yaw_deg, 0.0
        wanted = bearing_deg if self.wanted_deg is None else self.wanted_deg
        setpoint = self._moved(self.setpoint_deg, wanted, step_s)
        off = (setpoint - self.yaw_deg + 180.0) % 360.0 - 180.0
        self.setpoint_deg = setpoint
        smooth = self._turning.setpoint is not None
        ahead_deg_s = self._setpoint_rate_deg_s if smooth else 0.0
        self.rate_deg_s = self._turning.rate(off, self.rate_deg_s, step_s, ahead_deg_s)
        self.yaw_deg = (self.yaw_deg + self.rate_deg_s * step_s) % 360.0

    def _moved(self, setpoint: float, wanted: float | None, step_s: float) -> float:
        """Move the heading setpoint; with inertia it first continues an earlier turn."""
        goal = setpoint if wanted is None else wanted
        off = (goal - setpoint + 180.0) % 360.0 - 180.0
        smooth = self._turning.setpoint
        if smooth is None:
            most = self._turning.rate_deg_s * step_s
            self._setpoint_rate_deg_s = max(-most, min(most, off)) / step_s
        else:
            self._setpoint_rate_deg_s = smooth.rate(off, self._setpoint_rate_deg_s, step_s)
        setpoint = (setpoint + self._setpoint_rate_deg_s * step_s) % 360.0
        off = (goal - setpoint + 180.0) % 360.0 - 180.0
        if abs(off) < SETTLED_DEG and abs(self._setpoint_rate_deg_s) < SETTLED_DEG / 0.1:
            self._setpoint_rate_deg_s = 0.0
            return goal  # exactly the commanded value
        return setpoint
