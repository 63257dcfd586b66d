"""Convert surveys and fences to MAVLink mission items and back; no I/O.

Formats: https://mavlink.io/en/services/mission.html, https://mavlink.io/en/file_formats/#fence.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from typing import Literal

import numpy as np

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, PlanError
from uavrt.core.messages import KeepOut, VehicleFence
from uavrt.guidance.height_frames import check_height
from uavrt.guidance.operator_orders import Limits, Order, Place
from uavrt.guidance.plans import check_keep_out, excluded_areas, survey_places
from uavrt.guidance.safety import SAFETY
from uavrt.planning.area import Polygon, SearchArea

MissionKind = Literal["mission", "fence"]
WAYPOINT, RETURN = 16, 20
"""MAV_CMD numbers: NAV_WAYPOINT, NAV_RETURN_TO_LAUNCH."""
ABSOLUTE_FRAME, MISSION_FRAME, RELATIVE_FRAME = 0, 2, 3
RETURN_POINT = 5000
CORNER_WITHIN, CORNER_OUTSIDE, CIRCLE_WITHIN, CIRCLE_OUTSIDE = 5001, 5002, 5003, 5004
"""MAV_CMD numbers of fence corners and circles, inclusion and exclusion."""
FULL_SCALE_DEG = 1e7
_SAME_FRAMES = {5: 0, 6: 3}
"""MAV_FRAME numbers GLOBAL_INT and GLOBAL_RELATIVE_ALT_INT, and the older numbers with the same
meaning."""
_SAME_PLACE, _SAME_HEIGHT_M = 1, 0.011
"""Tolerances when items are read back [1e-7 deg; m]; ArduPilot stores whole centimetres."""
_REMEDY = "Draw the vehicle's fence again in QGroundControl, and upload it"


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionItem:
    """An item of a mission or fence, with the fields of MISSION_ITEM_INT."""

    command: int
    frame: int = ABSOLUTE_FRAME
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    x: int = 0
    """Latitude of the item [1e-7 deg]."""
    y: int = 0
    """Longitude of the item [1e-7 deg]."""
    z: float = 0.0
    """Height of the item, relative to the reference of its frame [m]."""

    @classmethod
    def at(
        cls, command: int, frame: int, place: Place, height_m: float = 0.0, first: float = 0.0
    ) -> "MissionItem":
        """Return an item at a position. `first` is its parameter 1.

        A waypoint leaves the heading to the autopilot.
        """
        return cls(
            command=command,
            frame=frame,
            params=(first, 0.0, 0.0, nan if command == WAYPOINT else 0.0),
            x=round(place[0] * FULL_SCALE_DEG),
            y=round(place[1] * FULL_SCALE_DEG),
            z=height_m,
        )

    @property
    def place(self) -> Place:
        """Latitude and longitude of the item [deg]."""
        return self.x / FULL_SCALE_DEG, self.y / FULL_SCALE_DEG

    def flies_as(self, other: "MissionItem") -> bool:
        """True if an autopilot flies both items in the same way, apart from rounding."""
        if self.command != other.command:
            return False
        if self.command == RETURN:
            return True
        frames = [_SAME_FRAMES.get(one.frame, one.frame) for one in (self, other)]
        return (
            frames[0] == frames[1]
            and abs(self.x - other.x) <= _SAME_PLACE
            and abs(self.y - other.y) <= _SAME_PLACE
            and abs(self.z - other.z) <= _SAME_HEIGHT_M
            and abs(self.params[0] - other.params[0]) < 0.5
        )


NOT_CHECKED = "the vehicle's fence, home, battery, and the ground below the path"
"""What the operator must check when a survey is saved to a file."""
NOT_CHECKED_ABOARD = "its battery, and the ground below the path"
"""What the operator must check when a survey is uploaded to a vehicle."""


def survey_items(
    order: Order, limits: Limits | None = None, home: Place | None = None
) -> tuple[MissionItem, ...]:
    """Convert a survey to a mission: its path at a height above home, then the return.

    The mission has no take-off: a pilot takes off and starts it. The `order` must be a survey
    along lines or around an area, because autopilots fly turns at positions differently.
    `limits` restrict the height. With the vehicle's `home`, also the distance from home and the
    vehicle's fence are checked for path and return. Raises `PlanError` if the order has no
    height, its outline is invalid, or the path crosses an excluded area or breaks a limit.
    """
    if order.action != "survey" or order.pattern == "points":
        raise PlanError(
            "a mission cannot contain turns",
            remedy="Choose --pattern lines or around",
        )
    if order.height_m is None:
        raise PlanError(
            "a survey as a mission needs a height", remedy="Give one, for example --height 60"
        )
    limits = limits or Limits()
    check_height(order.height_m, lowest_m=limits.lowest_m, highest_m=limits.highest_m)
    places = survey_places(order, order.places[0] if order.places else (0.0, 0.0))
    if home is None:
        _check_keep_out(order, places)
    else:
        _check_with_home(order, places, limits, home)
    height = order.height_m
    return (
        *(MissionItem.at(WAYPOINT, RELATIVE_FRAME, place, height) for place in places),
        MissionItem(command=RETURN, frame=MISSION_FRAME),
    )


def _check_keep_out(order: Order, places: Sequence[Place]) -> None:
    """Raise `PlanError` if the path crosses an excluded area of the order."""
    plane = TangentPlane(latitude_deg=places[0][0], longitude_deg=places[0][1])
    east, north = plane.to_local(*np.array(places).T)
    area = SearchArea(
        search=Polygon.rectangle(-1e5, 1e5, -1e5, 1e5),
        excluded=excluded_areas(order, Limits(), plane),
        margin_m=SAFETY.margin_m,
    )
    reason = area.entered_area(np.asarray(east), np.asarray(north))
    if reason is not None:
        raise PlanError(
            reason, remedy="Draw the area outside the excluded area, or in two parts"
        )


def _check_with_home(
    order: Order, places: Sequence[Place], limits: Limits, home: Place
) -> None:
    farthest = max(distance_m(*home, *place) for place in places)
    if farthest > limits.fence_m:
        raise PlanError(
            f"the survey leads {farthest:.0f} m from the vehicle's home",
            remedy=f"Survey within {limits.fence_m:.0f} m of home, or give a larger --farthest",
        )
    plane = TangentPlane(latitude_deg=home[0], longitude_deg=home[1])
    check_keep_out(order, limits, plane, (home, *places))


def difference(sent: Sequence[MissionItem], held: Sequence[MissionItem]) -> str | None:
    """Return how the mission on the vehicle differs from the one that was sent; else None."""
    if len(sent) != len(held):
        return f"the vehicle has {len(held)} items, not {len(sent)}"
    for number, (one, other) in enumerate(zip(sent, held, strict=True), 1):
        if not one.flies_as(other):
            return f"item {number} differs"
    return None


def fence_of(items: Iterable[MissionItem]) -> VehicleFence:
    """Convert a vehicle's fence items to areas; raises `FormatError` for an invalid fence."""
    within: list[KeepOut] = []
    outside: list[KeepOut] = []
    rest = iter(items)
    for item in rest:
        match item.command:
            case c if c in (CORNER_WITHIN, CORNER_OUTSIDE):
                area = KeepOut(places=_corners(item, rest), name="vehicle's fence")
                (within if c == CORNER_WITHIN else outside).append(area)
            case c if c in (CIRCLE_WITHIN, CIRCLE_OUTSIDE):
                area = KeepOut(
                    places=(_checked(item),), radius_m=_radius(item), name="vehicle's fence"
                )
                (within if c == CIRCLE_WITHIN else outside).append(area)
            case c if c == RETURN_POINT:
                pass
            case _:
                raise FormatError(
                    f"the vehicle's fence has an unknown item {item.command}", remedy=_REMEDY
                )
    return VehicleFence(within=tuple(within), keep_out=tuple(outside))


def _corners(first: MissionItem, rest: Iterator[MissionItem]) -> tuple[Place, ...]:
    """Return the corners of a fence polygon; every item contains their number."""
    count = first.params[0]
    if not (isfinite(count) and 3.0 <= count <= 1000.0):
        raise FormatError(
            f"the vehicle's fence has {count:g} corners instead of 3 to 1000", remedy=_REMEDY
        )
    places = [_checked(first)]
    for _ in range(round(count) - 1):
        item = next(rest, None)
        if item is None or item.command != first.command or item.params[0] != count:
            raise FormatError("a corner of the vehicle's fence is missing", remedy=_REMEDY)
        places.append(_checked(item))
    return tuple(places)


def _radius(item: MissionItem) -> float:
    radius = item.params[0]
    if not (isfinite(radius) and 0.0 < radius < 1e6):
        raise FormatError(
            f"the vehicle's fence has an invalid radius of {radius:g} m", remedy=_REMEDY
        )
    return radius


def _checked(item: MissionItem) -> Place:
    latitude, longitude = item.place
    if abs(latitude) > 90.0 or abs(longitude) > 180.0 or item.frame not in (0, 3, 5, 6):
        raise FormatError(
            f"the vehicle's fence has an invalid corner at {latitude:g}, {longitude:g}",
            remedy=_REMEDY,
        )
    return latitude, longitude
