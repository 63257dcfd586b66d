"""Planners without an estimate: lines over the area, and turns at points of a grid."""

from collections.abc import Callable, Iterator
from itertools import cycle
from math import ceil, sqrt

import numpy as np

from uavrt.planning.area import survey_lines
from uavrt.planning.drone_model.planner_actions import FlyTo, Hold, Rotate
from uavrt.planning.situation import Decision, Situation

_NEAR_M = 1.0


class Lawnmower:
    """Fly parallel lines over the area, back and forth, repeatedly.

    `spacing_m`: distance between lines [m]; None: a tenth of the square root of the area.
    """

    def __init__(self, spacing_m: float | None = None) -> None:
        self._spacing_m = spacing_m
        self._corners: Iterator[tuple[float, float]] | None = None
        self._target: tuple[float, float] | None = None

    def decide(self, situation: Situation) -> Decision:
        """Choose the flight to the next corner of the survey lines."""
        polygon = situation.area.search
        if self._corners is None:
            spacing = self._spacing_m or 0.1 * sqrt(polygon.area_m2)
            way = survey_lines(polygon, spacing)
            self._corners = cycle([*way, *way[::-1]])
        target = self._next(situation)
        return Decision(
            action=FlyTo(east_m=target[0], north_m=target[1]),
            reason="survey lines in their order, whatever is heard",
        )

    def _next(self, situation: Situation) -> tuple[float, float]:
        """Present corner, or the next allowed one once it is reached."""
        state = situation.state
        assert self._corners is not None
        for _ in range(1000):
            if self._target is None or (
                np.hypot(self._target[0] - state.east_m, self._target[1] - state.north_m)
                < _NEAR_M
            ):
                self._target = next(self._corners)
                continue
            east, north = np.array([self._target]).T
            here = (state.east_m, state.north_m)
            if situation.area.refusals(here, east, north, state.height_m)[0] is None:
                return self._target
            self._target = None
        return (state.east_m, state.north_m)


class RotationPoints:
    """Turn in place at each point of a grid, as pilots fly rotations today.

    `spacing_m`: distance between points [m]; None: a third of the square root of the area.
    `duration_s`: duration of a turn [s].
    """

    def __init__(self, spacing_m: float | None = None, duration_s: float = 20.0) -> None:
        self._spacing_m, self._duration_s = spacing_m, duration_s
        self._points: Iterator[tuple[float, float]] | None = None
        self._target: tuple[float, float] | None = None

    def decide(self, situation: Situation) -> Decision:
        """Choose the flight to the next grid point, or the turn at it."""
        polygon = situation.area.search
        if self._points is None:
            spacing = self._spacing_m or sqrt(polygon.area_m2) / 3.0
            self._points = cycle(_grid(polygon.box, polygon.contains, spacing))
        state = situation.state
        if self._target is None:
            self._target = next(self._points)
        there = np.hypot(self._target[0] - state.east_m, self._target[1] - state.north_m)
        if there < _NEAR_M:
            self._target = None
            if situation.vehicle.hovers:
                return Decision(
                    action=Rotate(duration_s=self._duration_s), reason="turn at a grid point"
                )
            return Decision(action=Hold(duration_s=self._duration_s), reason="circle there")
        east, north = self._target
        return Decision(
            action=FlyTo(east_m=east, north_m=north), reason="fly to the next grid point"
        )


def _grid(
    box: object, contains: Callable[..., np.ndarray], spacing_m: float
) -> list[tuple[float, float]]:
    """Points of a grid within an outline, in rows flown back and forth."""
    from uavrt.localization.position.bayes_fix import Area

    assert isinstance(box, Area)
    across = max(1, ceil((box.east_m - box.west_m) / spacing_m - 1e-9))
    along = max(1, ceil((box.north_m - box.south_m) / spacing_m - 1e-9))
    east = box.west_m + (np.arange(across) + 0.5) * (box.east_m - box.west_m) / across
    north = box.south_m + (np.arange(along) + 0.5) * (box.north_m - box.south_m) / along
    points = [
        (float(x), float(y))
        for number, y in enumerate(north)
        for x in (east if number % 2 == 0 else east[::-1])
    ]
    inside = [p for p in points if contains(np.array([p[0]]), np.array([p[1]]))[0]]
    return inside or points
