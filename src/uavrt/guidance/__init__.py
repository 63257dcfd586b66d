"""Move the drone: who is in command, how to fly, at what height; no I/O.

`authority` has the last word on every command and yields to any pilot; `pilot` turns the
operator's orders into wishes; `manners` holds the differences between autopilots. Nothing here
arms a vehicle.
"""

from typing import TYPE_CHECKING

from uavrt.lazy import lazily

if TYPE_CHECKING:
    from uavrt.guidance.area_text import area_in, circle, keep_out_in
    from uavrt.guidance.authority import HOME_MOVED_M, Authority, Standing
    from uavrt.guidance.company import Company
    from uavrt.guidance.ground import GroundAround
    from uavrt.guidance.heights import target_amsl_m
    from uavrt.guidance.lessons import Lessons
    from uavrt.guidance.manners import MANNERS, AutopilotName, Manners, manners_of
    from uavrt.guidance.mission import (
        NOT_CHECKED,
        NOT_CHECKED_ABOARD,
        MissionItem,
        MissionKind,
        difference,
        fence_items,
        fence_of,
        survey_items,
    )
    from uavrt.guidance.observed import (
        Boot,
        BootTimeSeen,
        FailsafeSeen,
        HomeSeen,
        LandedSeen,
        ModeSeen,
        Observation,
        PositionLost,
        PositionSeen,
        SticksSeen,
        TargetSeen,
    )
    from uavrt.guidance.orders import OFFER_HOLDS_S, Limits, Order, VehicleNow
    from uavrt.guidance.pilot import Pilot
    from uavrt.guidance.plan_file import fence_file, survey_file
    from uavrt.guidance.plans import plan_of, survey_places
    from uavrt.guidance.reports import now_of, with_place
    from uavrt.guidance.seeker import (
        TAG_HEIGHT_M,
        Choice,
        Equipment,
        Seeker,
    )
    from uavrt.guidance.way_text import way_in
    from uavrt.guidance.wishes import VehicleCommand

__all__ = [
    "HOME_MOVED_M",
    "MANNERS",
    "NOT_CHECKED",
    "NOT_CHECKED_ABOARD",
    "OFFER_HOLDS_S",
    "TAG_HEIGHT_M",
    "Authority",
    "AutopilotName",
    "Boot",
    "BootTimeSeen",
    "Choice",
    "Company",
    "Equipment",
    "FailsafeSeen",
    "GroundAround",
    "HomeSeen",
    "LandedSeen",
    "Lessons",
    "Limits",
    "Manners",
    "MissionItem",
    "MissionKind",
    "ModeSeen",
    "Observation",
    "Order",
    "Pilot",
    "PositionLost",
    "PositionSeen",
    "Seeker",
    "Standing",
    "SticksSeen",
    "TargetSeen",
    "VehicleCommand",
    "VehicleNow",
    "area_in",
    "circle",
    "difference",
    "fence_file",
    "fence_items",
    "fence_of",
    "keep_out_in",
    "manners_of",
    "now_of",
    "plan_of",
    "survey_file",
    "survey_items",
    "survey_places",
    "target_amsl_m",
    "way_in",
    "with_place",
]
__getattr__ = lazily(
    __name__,
    {
        "way_in": "way_text",
        "Authority": "authority",
        "AutopilotName": "manners",
        "Boot": "observed",
        "BootTimeSeen": "observed",
        "Choice": "seeker",
        "Company": "company",
        "Equipment": "seeker",
        "FailsafeSeen": "observed",
        "GroundAround": "ground",
        "HOME_MOVED_M": "authority",
        "HomeSeen": "observed",
        "LandedSeen": "observed",
        "Lessons": "lessons",
        "Limits": "orders",
        "MANNERS": "manners",
        "Manners": "manners",
        "MissionItem": "mission",
        "NOT_CHECKED": "mission",
        "NOT_CHECKED_ABOARD": "mission",
        "MissionKind": "mission",
        "ModeSeen": "observed",
        "Observation": "observed",
        "OFFER_HOLDS_S": "orders",
        "Order": "orders",
        "Pilot": "pilot",
        "PositionLost": "observed",
        "PositionSeen": "observed",
        "Seeker": "seeker",
        "TAG_HEIGHT_M": "seeker",
        "Standing": "authority",
        "SticksSeen": "observed",
        "TargetSeen": "observed",
        "VehicleCommand": "wishes",
        "VehicleNow": "orders",
        "area_in": "area_text",
        "circle": "area_text",
        "difference": "mission",
        "fence_file": "plan_file",
        "fence_items": "mission",
        "fence_of": "mission",
        "keep_out_in": "area_text",
        "manners_of": "manners",
        "now_of": "reports",
        "plan_of": "plans",
        "survey_file": "plan_file",
        "survey_items": "mission",
        "survey_places": "plans",
        "target_amsl_m": "heights",
        "with_place": "reports",
    },
)
