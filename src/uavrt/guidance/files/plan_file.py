"""Write surveys and fences as text of QGroundControl plan files; no I/O.

The plan has version 1, its mission and fence version 2
(https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html).
"""

import json
from collections.abc import Iterable
from typing import Any

from uavrt.core.messages import KeepOut, VehicleFence
from uavrt.guidance.files.mission import RETURN, MissionItem, survey_items
from uavrt.guidance.operator_orders import Order, Place

_PX4, _MULTIROTOR, _ABOVE_HOME = 12, 2, 1


def survey_file(order: Order, speed_m_s: float) -> str:
    """Return a survey as the text of a plan file: path and return at a height above home.

    A pilot uploads and starts the plan without uavrt. Excluded areas become exclusion fences.
    `uavrt.guidance.files.mission.survey_items` checks the order and raises `PlanError`.
    """
    items = survey_items(order)
    fences = _fences(order.keep_out, inclusion=False)
    return _plan(items, fences, items[0].place, speed_m_s)


def fence_file(fence: VehicleFence, home: Place | None = None) -> str:
    """Return a vehicle's fence as the text of a plan file without a mission."""
    within, outside = (
        _fences(areas, inclusion=inclusion)
        for areas, inclusion in ((fence.within, True), (fence.keep_out, False))
    )
    areas = (*fence.within, *fence.keep_out)
    middle = home or (areas[0].places[0] if areas else (0.0, 0.0))
    both = {name: within[name] + outside[name] for name in within}
    return _plan((), both, middle, 5.0)


def _plan(
    items: tuple[MissionItem, ...],
    fences: dict[str, list[dict[str, Any]]],
    home: Place,
    speed_m_s: float,
) -> str:
    plan = {
        "fileType": "Plan",
        "geoFence": {**fences, "version": 2},
        "groundStation": "QGroundControl",
        "mission": {
            "cruiseSpeed": speed_m_s,
            "firmwareType": _PX4,
            "globalPlanAltitudeMode": _ABOVE_HOME,
            "hoverSpeed": speed_m_s,
            "items": [_item(one, number) for number, one in enumerate(items, 1)],
            "plannedHomePosition": [*home, 0.0],
            "vehicleType": _MULTIROTOR,
            "version": 2,
        },
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }
    return json.dumps(plan, indent=4, sort_keys=True) + "\n"


def _item(item: MissionItem, number: int) -> dict[str, Any]:
    params = [one if one == one else None for one in item.params]  # NaN is none
    record: dict[str, Any] = {
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [*params, *item.place, item.z],
        "type": "SimpleItem",
    }
    if item.command == RETURN:
        return record
    return record | {
        "AMSLAltAboveTerrain": None,
        "Altitude": item.z,
        "AltitudeMode": _ABOVE_HOME,
    }


def _fences(areas: Iterable[KeepOut], *, inclusion: bool) -> dict[str, list[dict[str, Any]]]:
    """Return the circles and polygons of a fence in the format of a plan file."""
    areas = tuple(areas)
    return {
        "circles": [
            {
                "circle": {"center": list(one.places[0]), "radius": one.radius_m},
                "inclusion": inclusion,
                "version": 1,
            }
            for one in areas
            if one.radius_m is not None
        ],
        "polygons": [
            {
                "inclusion": inclusion,
                "polygon": [list(place) for place in one.places],
                "version": 1,
            }
            for one in areas
            if one.radius_m is None
        ],
    }
