"""What the guide plans, and from where."""

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import made
import numpy as np
import pytest
from flown import Flown
from virtual_time import VirtualClock

from uavrt.config.settings import GuidanceSettings, Settings
from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import (
    FlyThere,
    KeepOut,
    MotionOffer,
    MotionRequest,
    Tag,
    VehicleFence,
    VehicleReport,
    VehicleRequest,
    VehicleStatus,
)
from uavrt.drone.processes.guide import Guide


@dataclass
class Hub:
    """A guide and what it sends."""

    sent: list[Any] = field(default_factory=list)
    guidance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        guidance = GuidanceSettings(enabled=True, battery_wh=120.0, **self.guidance)
        settings = Settings(guidance=guidance)
        frame: Any = SimpleNamespace(
            assignment=SimpleNamespace(settings=settings, flight=None),
            send=lambda _, record: self.sent.append(record),
        )
        self.flown = Flown("px4")
        self.begun: list[Callable[[], None]] = []
        """Plans that are being made; done at once unless `plans_at_once` is False."""
        self.plans_at_once = True
        self.guide = Guide(frame, self.begin)

    def begin(self, work: Callable[[], None]) -> None:
        if self.plans_at_once:
            work()
        else:
            self.begun.append(work)

    def report(self, north_m: float = 0.0, **values: Any) -> VehicleReport:
        latitude, longitude = self.flown.place(north_m, 0.0)
        seen: dict[str, Any] = {
            "latitude_deg": latitude,
            "longitude_deg": longitude,
            "altitude_amsl_m": 470.0,
            "altitude_relative_m": 40.0,
            "speed_m_s": 0.0,
            "yaw_deg": 0.0,
            "home": self.flown.place(0.0, 0.0),
            "battery_percent": 90.0,
            "obeyed": False,
            "requests_sent": 0,
            "requests_refused": 0,
            "turned_deg": 0.0,
            "ground_silent_s": 0.0,
        }
        seen |= {name: values.pop(name) for name in list(values) if name in seen}
        report = VehicleReport(
            autopilot="px4",
            fault=None,
            standing="out",
            reason="",
            order_id=None,
            mode="Position",
            seen=VehicleStatus(**seen),
        )
        return replace(report, **values)

    def ask(self, action: Any, **values: Any) -> MotionOffer:
        request = MotionRequest(request_id=3, requester=(254, 190), action=action, **values)
        self.guide.receive("motion", request)
        return self.offer()

    def refusal(self, action: Any, **values: Any) -> str:
        offer = self.ask(action, **values)
        assert offer.refused
        return offer.summary

    def offer(self) -> MotionOffer:
        """What was planned."""
        self.guide.tick()
        offer = self.sent.pop()
        assert isinstance(offer, MotionOffer)
        return offer

    def confirmed(self, offer: MotionOffer, north_m: float, **values: Any) -> VehicleRequest:
        values = {"standing": "confirmed", "order_id": offer.order_id} | values
        self.guide.receive("vehicle", self.report(north_m, **values))
        assert isinstance(self.sent[-1], VehicleRequest)
        return self.sent[-1]


def ready(**guidance: Any) -> Hub:
    """A guide that knows its vehicle and that there is no fence."""
    hub = Hub(guidance=guidance)
    hub.guide.receive("vehicle", hub.report())
    hub.guide.receive("vehicle_fence", VehicleFence())
    return hub


@pytest.fixture
def hub() -> Hub:
    return ready()


def test_an_offer_tells_out_of_which_mode(hub: Hub) -> None:
    offer = hub.ask("hold")
    assert offer.mode == "Position"
    assert offer.summary == "hold here at 40 m; in mode Position"


def test_an_offer_says_that_the_vehicles_fence_is_not_known() -> None:
    hub = Hub()
    hub.guide.receive("vehicle", hub.report())
    offer = hub.ask("hold")
    assert offer.summary == ("hold here at 40 m; geofence unknown; in mode Position")


def meadow(hub: Hub, half_m: float) -> KeepOut:
    corners = ((-half_m, -half_m), (-half_m, half_m), (half_m, half_m), (half_m, -half_m))
    return KeepOut(
        places=tuple(hub.flown.place(*one) for one in corners), name="vehicle's fence"
    )


@pytest.mark.parametrize("action", ["goto", "survey"])
def test_nothing_leaves_the_vehicles_own_fence(hub: Hub, action: str) -> None:
    hub.guide.receive("vehicle_fence", VehicleFence(within=(meadow(hub, 150.0),)))
    corners = ((50.0, 0.0), (50.0, 100.0), (140.0, 100.0))
    for far_m, refused in ((0.0, False), (50.0, True)):
        places = tuple(hub.flown.place(north + far_m, east) for north, east in corners)
        offer = hub.ask(
            action, places=places[-1:] if action == "goto" else places, height_m=40.0
        )
        assert offer.refused == refused, offer.summary
        assert ("leaves the vehicle's fence" in offer.summary) == refused


def test_nothing_enters_what_the_vehicles_own_fence_excludes(hub: Hub) -> None:
    pond = replace(meadow(hub, 20.0), places=(hub.flown.place(100.0, 0.0),), radius_m=20.0)
    hub.guide.receive("vehicle_fence", VehicleFence(keep_out=(pond,)))
    offer = hub.refusal("goto", places=(hub.flown.place(200.0, 0.0),), height_m=40.0)
    assert 'enters the keep-out "vehicle\'s fence"' in offer


def test_a_fence_that_cannot_be_read_or_leaves_home_out_is_not_flown_with(hub: Hub) -> None:
    hub.guide.receive("vehicle_fence", VehicleFence(fault="the vehicle's fence has 2 corners"))
    assert "has 2 corners" in hub.ask("hold").summary
    away = replace(meadow(hub, 20.0), places=(hub.flown.place(100.0, 0.0),), radius_m=20.0)
    hub.guide.receive("vehicle_fence", VehicleFence(within=(away,)))
    assert "home lies outside of the vehicle's fence" in hub.ask("hold").summary


@pytest.mark.parametrize("action", ["hold", "rotate"])
def test_here_is_where_the_drone_is_when_the_order_is_confirmed(hub: Hub, action: str) -> None:
    offer = hub.ask(action)
    manoeuvre = hub.confirmed(offer, north_m=120.0).manoeuvre
    assert isinstance(manoeuvre, FlyThere)
    there = hub.flown.place(120.0, 0.0)
    assert distance_m(manoeuvre.latitude_deg, manoeuvre.longitude_deg, *there) < 0.1


def test_the_height_is_the_one_that_was_offered(hub: Hub) -> None:
    offer = hub.ask("hold")
    manoeuvre = hub.confirmed(
        offer, 0.0, altitude_amsl_m=490.0, altitude_relative_m=60.0
    ).manoeuvre
    assert isinstance(manoeuvre, FlyThere)
    assert manoeuvre.altitude_amsl_m == pytest.approx(470.0)


def test_what_cannot_be_flown_when_it_is_confirmed_ends_with_the_reason(hub: Hub) -> None:
    offer = hub.ask("goto", places=(hub.flown.place(300.0, 0.0),), height_m=40.0)
    request = hub.confirmed(offer, 0.0, battery_percent=30.0)
    assert (request.ends, request.order_id) == (True, offer.order_id)
    assert "Wh" in request.status_text


@pytest.mark.parametrize("action", ["goto", "search", "return"])
def test_what_was_planned_around_another_home_is_not_flown(hub: Hub, action: str) -> None:
    """Home that moves while an order is planned is the one that its offer is made with."""
    tag = Tag(tag_id=2, frequency_hz=150e6, pulse_width_s=0.02, pulse_intervals_s=(1.3,))
    info = made.flight_info("", (tag,), center_frequency_hz=150e6)
    hub.guide.receive("flight", info)
    asked: dict[str, dict[str, Any]] = {
        "goto": {"places": (hub.flown.place(100.0, 0.0),), "height_m": 40.0},
        "search": {"radius_m": 100.0, "height_m": 40.0, "duration_s": 300.0},
        "return": {},
    }
    values = asked[action]
    moved = hub.flown.place(100.0, 0.0)
    request = hub.confirmed(hub.ask(action, **values), 0.0, home=moved)
    assert request.ends
    assert (
        request.status_text
        == "home was moved while the order was planned. Request the motion again"
    )
    hub.guide.receive("vehicle", hub.report(home=moved))
    assert not hub.ask(action, **values).refused


@pytest.mark.parametrize("action", ["goto", "survey"])
def test_a_way_begins_at_the_least_height_or_above(hub: Hub, action: str) -> None:
    corners = ((50.0, 0.0), (50.0, 100.0), (150.0, 100.0))
    places = tuple(hub.flown.place(*one) for one in corners)
    low = hub.report(altitude_amsl_m=438.0, altitude_relative_m=8.0)
    hub.guide.receive("vehicle", low)
    offer = hub.refusal(
        action, places=places[:1] if action == "goto" else places, height_m=40.0
    )
    assert "the drone is at 8 m" in offer
    assert not hub.ask("hold", height_m=30.0).refused


def test_the_drones_own_buildings_are_read_for_each_order(tmp_path: Path) -> None:
    farm = tmp_path / "farm.geojson"
    hub = ready(keep_out_file=str(farm))
    goal = (hub.flown.place(120.0, 0.0),)
    for north_m, refused in ((60.0, True), (-60.0, False)):
        corners = [hub.flown.place(north_m + a, b) for a, b in ((0, -15), (0, 15), (15, 0))]
        ring = [[east, north] for north, east in corners]
        farm.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
        assert hub.ask("goto", places=goal, height_m=40.0).refused is refused


def test_heights_of_the_ground_are_read_from_the_drones_own_files(tmp_path: Path) -> None:
    heights = np.full((1201, 1201), 430, ">i2")
    heights[1200 - 123 : 1200 - 120, 599:602] = 480  # 200 m north of home
    heights.tofile(tmp_path / "N47E008.hgt")
    hub = ready(terrain=str(tmp_path))
    over = hub.refusal("goto", places=(hub.flown.place(350.0, 0.0),), height_m=40.0)
    assert "path and return need 70 m above home" in over
    assert not hub.ask("goto", places=(hub.flown.place(-200.0, 0.0),), height_m=40.0).refused
    wrong = hub.report(altitude_amsl_m=520.0)
    hub.guide.receive("vehicle", wrong)
    assert "home's altitude differs by +50 m from the elevation map" in hub.ask("hold").summary


FARM = "keep_out_file"


def encrypted() -> bytes:
    """A file of heights that needs a password."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("N47E008.hgt", bytes(1201 * 1201 * 2))
    content = bytearray(packed.getvalue())
    content[6] |= 1
    content[content.rfind(b"PK\1\2") + 8] |= 1
    return bytes(content)


@pytest.mark.parametrize(
    ("setting", "content", "reason"),
    [
        (FARM, None, "cannot be read"),
        (FARM, b'{"type": "FeatureCollection", "features": []}', "contains no usable keep-out"),
        (FARM, b'{"type": "Polygon", "coordinates": []}', ""),
        (FARM, b'{"type": "\\ud800", "coordinates": [1' + b"0" * 400 + b"]}", ""),
        ("terrain", None, "there is no"),
        ("terrain", encrypted(), ""),
    ],
)
def test_a_file_that_cannot_be_used_refuses_the_order_with_its_name(
    tmp_path: Path, setting: str, content: bytes | None, reason: str
) -> None:
    path = tmp_path / ("farm.geojson" if setting == FARM else "N47E008.hgt.zip")
    if content is not None:
        path.write_bytes(content)
    offer = ready(**{setting: str(path)}).ask("hold")
    assert offer.refused
    assert reason in offer.summary
    assert str(path) in offer.summary
    offer.summary.encode()


def test_what_nobody_foresaw_refuses_the_order(hub: Hub) -> None:
    offer = hub.refusal("goto", places=((10**400, 8.0),), height_m=40.0)
    assert "the order cannot be planned: OverflowError" in offer
    assert not hub.ask("hold").refused


def test_an_order_goes_on_while_another_is_planned(
    hub: Hub, clock_of_test: VirtualClock
) -> None:
    flown = hub.ask("hold")
    hub.confirmed(flown, 0.0)
    hub.plans_at_once = False
    for number in (4, 5):
        hub.guide.receive(
            "motion", MotionRequest(request_id=number, requester=(1, 1), action="hold")
        )
    begun = len(hub.sent)
    for _ in range(20):
        clock_of_test.now_s += 0.1
        hub.guide.receive("vehicle", hub.report(standing="confirmed", order_id=flown.order_id))
        hub.guide.tick()
    assert any(one.manoeuvre is None for one in hub.sent[begun:])
    assert not any(isinstance(one, MotionOffer) for one in hub.sent)
    for number in (4, 5):  # one after the other
        (plan,) = hub.begun
        hub.begun.clear()
        plan()
        offer = hub.offer()
        assert (offer.request_id, offer.refused) == (number, False)
