"""Request, confirm and stop motions of the drone for the page. The drone decides and reports
what it would fly; previews use its own planning functions.
"""

import asyncio
import itertools
import re
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import Any

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.errors import CommandRefused, FormatError, LinkError, UsageError
from uavrt.core.messages import KeepOut, MotionRequest, Tag
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s
from uavrt.ground.link.drone_link import GroundLink
from uavrt.ground.link.motions.motion_requests import (
    confirm,
    motion_request,
    request_motion,
    stop,
)
from uavrt.ground.link.page_values import Places, listed, number_in, places_in
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.guidance.files.area_text import MOST_CORNERS, MOST_KEEP_OUT
from uavrt.guidance.files.mission import NOT_CHECKED_ABOARD, survey_items
from uavrt.guidance.operator_orders import Limits, Order
from uavrt.guidance.plans import survey_places
from uavrt.guidance.safety import SAFETY
from uavrt.link.tunnel.own_messages.motion_messages import MAX_PLACES, MotionState

SILENCE_NS = ns_from_s(6.0)
"""Time without a report after which a drone's motion is unknown [ns]; it sends one a second."""
OFFER_NS = ns_from_s(SAFETY.offer_holds_s)
"""Time for which the drone waits for the confirmation of a proposed motion [ns]."""
PATTERNS = ("lines", "around", "points")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposedMotion:
    """Motion that the drone proposes, and flies only after a confirmation."""

    state: MotionState
    path: Places
    time_ns: int
    page: str | None
    """Name of the page that requested the motion; None for a script."""


def with_names(text: str, tags: Iterable[Tag]) -> str:
    """Add the names of tags to a text from the drone, which contains only their numbers."""
    names = {str(one.tag_id): f" ({one.name})" for one in tags if one.name}
    return re.sub(r"\btag (\d+)\b", lambda found: found[0] + names.get(found[1], ""), text)


class MotionCommands:
    """Requests and confirms the motions of one vehicle."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._vehicle = vehicle
        self._state: MotionState | None = None
        self._heard_ns = 0
        self._offered: ProposedMotion | None = None
        self._flown: ProposedMotion | None = None
        self._noted = ("", "")

    def receive_state(self, state: MotionState) -> None:
        """Store the drone's report of its motion."""
        self._heard_ns = self._vehicle.clock.now_ns()
        if state.kind != "state":
            return
        self._state = state
        if state.standing == "out":
            self._flown = None
        if (state.standing, state.text) != self._noted:
            before, self._noted = self._noted[0], (state.standing, state.text)
            if before and before != state.standing:
                self._vehicle.feed.note(5, f"motion: {state.standing}, {state.text}")
            self._vehicle.feed.send_state()

    def forget(self) -> None:
        """Clear the motion state, because another vehicle is now served."""
        self._state = self._offered = self._flown = None
        self._heard_ns, self._noted = 0, ("", "")

    def record(self) -> dict[str, Any] | None:
        """Motion state for the page; None if the drone does not report any."""
        now_ns = self._vehicle.clock.now_ns()
        state = self._state
        if state is None:
            return None
        heard = now_ns - self._heard_ns < SILENCE_NS
        if not heard and state.standing == "out":
            return None
        offered = self._offered
        if offered is not None and now_ns - offered.time_ns > OFFER_NS:
            offered = self._offered = None
        tags = self._vehicle.store.tags
        return {
            "standing": state.standing,
            "text": with_names(state.text, tags),
            "heard": heard,
            "way": [] if self._flown is None else listed(self._flown.path),
            "offer": None
            if offered is None
            else {
                "order_id": offered.state.order_id,
                "text": with_names(offered.state.text, tags),
                "page": offered.page,
                "left_s": (OFFER_NS - (now_ns - offered.time_ns)) / NANOSECONDS_PER_SECOND,
                "way": listed(offered.path),
            },
        }

    def plan(self, body: dict[str, Any]) -> dict[str, Any]:
        """Preview a motion from data on the ground, without a request to the drone."""
        path = self._planned_path(_request(body))
        home = self._home()
        return {
            "way": listed(path),
            "length_m": _length_m(path),
            "farthest_m": None
            if home is None
            else max((distance_m(*home, *place) for place in path), default=0.0),
        }

    async def request_motion(self, body: dict[str, Any], page: str | None) -> dict[str, Any]:
        """Request a motion; return the drone's proposed order. Nothing moves yet."""
        request = _request(body)
        path = self._planned_path(request)
        self._offered = None
        offer = await request_motion(self._link(), request)
        now_ns = self._vehicle.clock.now_ns()
        self._offered = ProposedMotion(state=offer, path=path, time_ns=now_ns, page=page)
        self._vehicle.feed.note(6, f"the drone proposes to {offer.text}")
        self._vehicle.feed.send_state()
        return {"order_id": offer.order_id, "text": offer.text, "way": listed(path)}

    async def confirm(self, body: dict[str, Any], page: str | None) -> dict[str, Any]:
        """Confirm the proposed order that the page shows; the drone then moves."""
        number, unseen, offered = body.get("order_id"), body.get("sticks_unseen"), self._offered
        if offered is None or number != offered.state.order_id or page != offered.page:
            raise CommandRefused(
                "the proposed motion has expired", remedy="Request the motion again"
            )
        self._offered = None
        if self._vehicle.clock.now_ns() - offered.time_ns > OFFER_NS:
            raise CommandRefused(
                "the proposed motion has expired", remedy="Request the motion again"
            )
        state = await confirm(self._link(), offered.state, sticks_unseen=unseen is True)
        self._flown = offered
        self.receive_state(state)
        self._vehicle.feed.note(5, f"confirmed: {offered.state.text}")
        return {"standing": state.standing, "text": state.text}

    async def upload(
        self, body: dict[str, Any], call: Callable[..., Awaitable[Any]] = asyncio.to_thread
    ) -> dict[str, Any]:
        """Upload a survey as the autopilot's mission; `call` checks the path in a thread."""
        order = Order.of(_request(body))
        await call(survey_items, order)  # what is none is refused without a link, too
        link = self._vehicle.connection.link
        if link is None:
            raise LinkError(
                "the ground station is not connected to a drone", remedy="Connect to the drone"
            )
        done = await link.missions.upload_survey(order, Limits(), call)
        self._vehicle.feed.note(
            5,
            f"the vehicle has the survey as its mission: {done.items} items; not checked: "
            f"{NOT_CHECKED_ABOARD}",
        )
        return {"items": done.items, "sent_again": done.sent_again}

    async def stop(self) -> dict[str, Any]:
        """Stop the drone and end its control by uavrt; on an error, a pilot must stop it."""
        self._offered = None
        self._vehicle.feed.note(5, "stopped by the operator")
        state = await stop(self._link())
        self.receive_state(state)
        return {"standing": state.standing, "text": state.text}

    def _link(self) -> GroundLink:
        link = self._vehicle.connection.link
        if link is None or not self._vehicle.situation().drone_present:
            raise LinkError(
                "no contact with the drone",
                remedy="If necessary, stop the drone with the remote control",
            )
        return link

    def _home(self) -> tuple[float, float] | None:
        watch = self._vehicle.connection.watch
        return None if watch is None else watch.home

    def _planned_path(self, request: MotionRequest) -> Places:
        pose = self._vehicle.connection.watch.pose if self._vehicle.connection.watch else None
        here: Places = () if pose is None else ((pose.latitude_deg, pose.longitude_deg),)
        match request.action:
            case "goto":
                return (*here, *request.places)
            case "survey":
                if not request.places:
                    raise UsageError("a survey needs an area", remedy="Draw or import an area")
                return (
                    *here,
                    *survey_places(Order.of(request), self._home() or request.places[0]),
                )
            case "search" if bool(request.places) == (request.radius_m is not None):
                raise UsageError(
                    "a search needs exactly one area",
                    remedy="Draw an area, or give a radius around the drone",
                )
            case "return":
                home = self._home()
                return () if home is None else (*here, home)
        return ()


def _request(body: dict[str, Any]) -> MotionRequest:
    """Parse a motion request of the page; raises `FormatError` or `UsageError`."""
    height = body.get("height_m")
    pattern = body.get("pattern", "lines")
    if pattern not in PATTERNS:
        raise FormatError("pattern must be lines, around or points")
    places = places_in(body.get("places", []))
    if len(places) > MAX_PLACES:
        raise UsageError(
            f"the area has {len(places)} corners; at most {MAX_PLACES} are allowed",
            remedy=f"Draw an area with {MAX_PLACES} corners or fewer",
        )
    return motion_request(
        str(body.get("action")),
        places,
        height_m=None if height is None else number_in(body, "height_m"),
        duration_s=number_in(body, "duration_s", 60.0),
        clockwise=body.get("clockwise", True) is not False,
        spacing_m=number_in(body, "spacing_m", 60.0),
        pattern=pattern,
        radius_m=None if body.get("radius_m") is None else number_in(body, "radius_m"),
        accuracy_m=number_in(body, "accuracy_m", 25.0),
        tags=_tags(body.get("tags", [])),
        keep_out=_keep_out(body.get("keep_out", [])),
    )


def _keep_out(given: Any) -> tuple[KeepOut, ...]:
    """Read excluded areas that have the form returned by `area_of_file`."""
    found = []
    if isinstance(given, list) and len(given) > MOST_KEEP_OUT:
        raise FormatError(f"keep_out can contain at most {MOST_KEEP_OUT} outlines")
    for one in given if isinstance(given, list) else [None]:
        if not isinstance(one, dict):
            raise FormatError("keep_out must be a list of outlines")
        radius = one.get("radius_m")
        places = places_in(one.get("places"))
        if len(places) > MOST_CORNERS:
            raise FormatError(f"an outline can have at most {MOST_CORNERS} corners")
        if len(places) != 1 if radius is not None else len(places) < 3:
            raise FormatError(
                "each item of keep_out must be an outline, or a place with a radius"
            )
        radius_m = None if radius is None else number_in(one, "radius_m")
        if radius_m is not None and not radius_m > 0.0:
            raise FormatError("radius_m must be above 0")
        found.append(KeepOut(places=places, radius_m=radius_m))
    return tuple(found)


def _tags(given: Any) -> tuple[int, ...]:
    """Read the ids of the tags to search for; all listed tags if none is given."""
    if isinstance(given, list) and all(type(one) is int for one in given):
        return tuple(given)
    raise FormatError("tags must be whole numbers")


def _length_m(path: Places) -> float:
    return sum(distance_m(*a, *b) for a, b in itertools.pairwise(path))
