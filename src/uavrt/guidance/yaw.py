"""Check that the heading moves as commanded. Pure."""

import math
from dataclasses import dataclass

from uavrt.units import wrap_degrees_180

SETTLED_S = 1.0
"""A heading that changed by less than `STEADY_DEG` for so long has settled."""
STEADY_DEG = 3.0
SETTLES_WITHIN_S = 10.0
BEGINS_WITHIN_S = 4.0
THERE_DEG, BEGUN_DEG = 6.0, 5.0
OTHERS_TURN = "another turns the drone"


@dataclass(slots=True, kw_only=True)
class YawWatch:
    """Watches a heading from a command on; `fault` says what is not ours.

    Parameters
    ----------
    start_s : float
        Time of the command.
    yaw_deg : float
        Heading then.
    tolerance_deg : float
        Gusts and overshoot.
    wanted_deg : float, optional
        Heading that was asked for.
    course_deg : float, optional
        Where it flies to, when no heading was asked for: the autopilot looks there, or stays.
    turn_deg, rate_deg_s : float, optional
        A turn in place by so much, clockwise, instead.
    """

    start_s: float
    yaw_deg: float
    tolerance_deg: float
    wanted_deg: float | None = None
    course_deg: float | None = None
    turn_deg: float | None = None
    rate_deg_s: float = 0.0
    turned_deg: float = 0.0
    """In the direction asked for; of a heading that was not asked for, clockwise."""
    _first_deg: float = 0.0
    _best_deg: float = 0.0
    _arc_deg: float = 0.0
    _settled: bool = False
    _steady_deg: float = 0.0
    _steady_s: float = 0.0

    def __post_init__(self) -> None:
        self._steady_deg, self._steady_s = self.yaw_deg, self.start_s
        if self.wanted_deg is not None:
            self._first_deg = abs(wrap_degrees_180(self.wanted_deg - self.yaw_deg))
            self._best_deg = self._first_deg
        if self.course_deg is not None:
            self._arc_deg = wrap_degrees_180(self.course_deg - self.yaw_deg)

    @property
    def begun(self) -> bool:
        """Whether a heading that was asked for is there, or has come nearer."""
        if self.wanted_deg is None:
            return True
        return self._best_deg < max(THERE_DEG, self._first_deg - BEGUN_DEG)

    def fault(self, time_s: float, yaw_deg: float) -> str | None:
        """Take a heading; say what is wrong with it."""
        step = wrap_degrees_180(yaw_deg - self.yaw_deg)
        self.yaw_deg = yaw_deg
        if self.turn_deg is not None:
            return self._turning(time_s, step)
        if self.wanted_deg is not None:
            left = abs(wrap_degrees_180(self.wanted_deg - yaw_deg))
            self._best_deg = min(self._best_deg, left)
            return OTHERS_TURN if left > self._best_deg + self.tolerance_deg else None
        self.turned_deg += step
        return self._chosen(time_s, yaw_deg)

    def _turning(self, time_s: float, step_deg: float) -> str | None:
        """Neither back nor too fast, nor too late."""
        assert self.turn_deg is not None
        whole, passed = abs(self.turn_deg), time_s - self.start_s
        self.turned_deg += step_deg if self.turn_deg >= 0.0 else -step_deg
        if self.turned_deg > self._best_deg + 1.0:
            self._best_deg, self._steady_s = self.turned_deg, time_s
        if self._best_deg < 10.0:
            return "the turn was not obeyed" if passed > BEGINS_WITHIN_S else None
        if self._best_deg < whole - 10.0 and time_s - self._steady_s > BEGINS_WITHIN_S / 2:
            return OTHERS_TURN  # it has stopped
        soonest = min(whole, self.rate_deg_s * passed) + self.tolerance_deg
        least = min(whole, self.rate_deg_s * (passed - BEGINS_WITHIN_S)) - self.tolerance_deg
        least = max(least, self._best_deg - self.tolerance_deg)
        return None if least <= self.turned_deg <= soonest else OTHERS_TURN

    def _chosen(self, time_s: float, yaw_deg: float) -> str | None:
        """Let the autopilot look where it flies to, once; then the heading is to stay."""
        arcs = [0.0, self._arc_deg]
        if abs(self._arc_deg) > 180.0 - self.tolerance_deg:
            # To look straight back it may turn either way.
            arcs.append(self._arc_deg - math.copysign(360.0, self._arc_deg))
        lowest, highest = min(arcs), max(arcs)
        if not lowest <= self.turned_deg + self.tolerance_deg:
            return OTHERS_TURN
        if self.turned_deg > highest + self.tolerance_deg:
            return OTHERS_TURN
        off = abs(wrap_degrees_180(yaw_deg - self._steady_deg))
        if self._settled:
            return OTHERS_TURN if off > self.tolerance_deg else None
        if off > STEADY_DEG:
            self._steady_deg, self._steady_s = yaw_deg, time_s
        elif time_s - self._steady_s >= SETTLED_S and time_s - self.start_s >= 2 * SETTLED_S:
            self._settled = True
        if time_s - self.start_s > SETTLES_WITHIN_S and not self._settled:
            return OTHERS_TURN
        return None
