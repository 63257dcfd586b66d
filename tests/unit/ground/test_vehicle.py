"""What the ground reads from the autopilot's and the radio's frames."""

from copy import copy
from itertools import pairwise

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.ground.link.vehicles.vehicle_identity import VehicleIdentity
from uavrt.ground.link.vehicles.vehicle_state import LossMeter, VehicleWatch
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import Peer
from uavrt.link.mavlink.frame import Frame, FrameParser, FrameWriter
from uavrt.link.mavlink.message import Message

NOW_NS = 1_700_000_000_000_000_000
SECOND = 1_000_000_000
HEARTBEAT = made.heartbeat(type=2, autopilot=3, base_mode=128)
PLACE = dialect.GlobalPositionInt(
    time_boot_ms=1,
    lat=351_782_410,
    lon=-1_116_565_870,
    alt=2_107_000,
    relative_alt=9_500,
    hdg=9_000,
)


class Autopilot:
    def __init__(self, component: int = 1, system: int = 1) -> None:
        self._writer = FrameWriter(system, component)

    def frame(self, message: Message) -> Frame:
        (frame,) = FrameParser().feed(self._writer.encode(message))
        return frame


def test_position_and_heading_make_a_pose() -> None:
    watch, autopilot = VehicleWatch(Peer(255, 190)), Autopilot()
    assert watch.receive(autopilot.frame(PLACE), NOW_NS) is None  # whose is it?
    watch.receive(autopilot.frame(HEARTBEAT), NOW_NS)
    pose = watch.receive(autopilot.frame(PLACE), NOW_NS)
    assert pose is not None
    assert pose.latitude_deg == pytest.approx(35.178241)
    assert pose.altitude_relative_m == 9.5
    w, x, y, z = pose.quaternion_wxyz
    assert (w, x, y, z) == pytest.approx((0.7071, 0.0, 0.0, 0.7071), abs=1e-4)
    assert watch.armed


@pytest.mark.parametrize(
    ("latitude_1e7", "longitude_1e7"), [(0, 0), (900_000_001, 1), (1, -1_800_000_001)]
)
def test_before_the_first_fix_and_off_the_globe_there_is_no_place(
    latitude_1e7: int, longitude_1e7: int
) -> None:
    watch, autopilot = VehicleWatch(Peer(255, 190)), Autopilot()
    watch.receive(autopilot.frame(HEARTBEAT), NOW_NS)
    nowhere = copy(PLACE)
    nowhere.lat, nowhere.lon = latitude_1e7, longitude_1e7
    assert watch.receive(autopilot.frame(nowhere), NOW_NS) is None
    assert watch.pose is None


def test_an_autopilot_that_sends_nothing_is_asked_now_and_then() -> None:
    watch, autopilot = VehicleWatch(Peer(255, 190)), Autopilot()
    assert watch.requests(NOW_NS) == []  # nobody there
    watch.receive(autopilot.frame(HEARTBEAT), NOW_NS)
    asked = watch.requests(NOW_NS)
    assert [
        message.param1 for message in asked if isinstance(message, dialect.CommandLong)
    ] == [dialect.AttitudeQuaternion.ID, dialect.GlobalPositionInt.ID]
    assert watch.requests(NOW_NS + SECOND) == []
    watch.receive(autopilot.frame(PLACE), NOW_NS + SECOND)
    assert watch.requests(NOW_NS + 3 * SECOND) == []


def version(uid: int) -> dialect.AutopilotVersion:
    return dialect.AutopilotVersion(
        flight_custom_version=bytes(8),
        middleware_custom_version=bytes(8),
        os_custom_version=bytes(8),
        uid=uid,
    )


def test_after_a_silence_only_the_same_vehicle_is_watched_again() -> None:
    identity = VehicleIdentity()
    watch = VehicleWatch(Peer(255, 190), identity)
    first, second = Autopilot(), Autopilot(system=2)
    identity.heard(1, NOW_NS)  # its companion
    watch.receive(first.frame(HEARTBEAT), NOW_NS)
    assert watch.receive(first.frame(PLACE), NOW_NS)
    later_ns = NOW_NS + 60 * SECOND
    watch.receive(second.frame(HEARTBEAT), later_ns)
    assert watch.receive(second.frame(PLACE), later_ns) is None
    assert not watch.present(later_ns)
    assert list(identity.others) == [2]
    watch.receive(first.frame(HEARTBEAT), later_ns)
    assert watch.receive(first.frame(PLACE), later_ns)


def test_another_autopilot_under_the_same_number_gives_no_poses() -> None:
    identity = VehicleIdentity()
    watch, autopilot = VehicleWatch(Peer(255, 190), identity), Autopilot()
    identity.heard(1, NOW_NS)
    watch.receive(autopilot.frame(HEARTBEAT), NOW_NS)
    asked = [m.param1 for m in watch.questions(NOW_NS) if isinstance(m, dialect.CommandLong)]
    wanted = [dialect.AutopilotVersion.ID, dialect.HomePosition.ID, dialect.SysStatus.ID]
    assert asked == [*wanted, dialect.ExtendedSysState.ID]
    assert watch.questions(NOW_NS + SECOND) == []
    watch.receive(autopilot.frame(version(7)), NOW_NS)
    assert watch.receive(autopilot.frame(PLACE), NOW_NS)
    watch.receive(autopilot.frame(version(8)), NOW_NS + SECOND)
    assert identity.foreign(NOW_NS + SECOND)
    assert watch.receive(autopilot.frame(PLACE), NOW_NS + SECOND) is None
    identity.choose(1)
    assert watch.receive(autopilot.frame(PLACE), NOW_NS + SECOND)


def test_only_the_drones_answer_is_a_round_trip() -> None:
    watch = VehicleWatch(Peer(255, 190))
    ping = watch.ping(NOW_NS)
    assert isinstance(ping, dialect.Ping)

    def answer(target: int) -> dialect.Ping:
        return dialect.Ping(
            time_usec=ping.time_usec, seq=ping.seq, target_system=target, target_component=190
        )

    later_ns = NOW_NS + 50_000_000
    watch.receive(Autopilot(component=1).frame(answer(255)), later_ns)
    watch.receive(Autopilot(component=191).frame(answer(254)), later_ns)
    assert watch.round_trip_s is None
    watch.receive(Autopilot(component=191).frame(answer(255)), later_ns)
    assert watch.round_trip_s == pytest.approx(0.05, abs=1e-5)


@given(st.lists(st.booleans(), min_size=30, max_size=400), st.integers(0, 255))
def test_the_loss_is_the_share_of_missing_numbers(arrived: list[bool], first: int) -> None:
    meter = LossMeter()
    kept = [place for place, one in enumerate(arrived) if one]
    gaps = [b - a for a, b in pairwise(kept)]
    for place in kept:
        meter.add((first + place) % 256, NOW_NS)
    share = meter.share(NOW_NS)
    if not kept:
        assert share is None
    elif all(gap < 128 for gap in gaps):
        assert share == pytest.approx(1.0 - len(kept) / (kept[-1] - kept[0] + 1))
    assert meter.share(NOW_NS + 60 * SECOND) is None


def places_of(watch: VehicleWatch, *north_1e7: int) -> bool:
    """Tell where a station without an autopilot is, five times a second; is it two?"""
    station = Autopilot(component=191)
    for number, north in enumerate(north_1e7):
        time_ns = NOW_NS + number * SECOND // 5
        place = copy(PLACE)
        place.lat += north
        assert watch.receive(station.frame(place), time_ns) is not None
    return watch.identity.foreign(NOW_NS + len(north_1e7) * SECOND // 5)


@pytest.mark.parametrize(
    ("north_1e7", "two"),
    [
        ((0, 9000) * 4, True),  # 100 m apart, in turn
        ((0, 0, 9000, 0, 0, 9000, 0, 0, 9000), True),
        ((0, 0, 9000, 0, 0, 0, 0), False),  # a GPS receiver that slips
        (tuple(range(0, 9000, 300)), False),  # a person who walks
        ((0, 5000, 10_000, 15_000, 20_000, 25_000), False),  # by car
    ],
)
def test_two_masts_under_one_number_are_told_by_their_places(
    north_1e7: tuple[int, ...], two: bool
) -> None:
    watch = VehicleWatch(Peer(255, 190), VehicleIdentity(1))
    assert places_of(watch, *north_1e7) is two
    if two:  # the operator takes this one
        watch.identity.choose(1)
        assert not watch.identity.foreign(NOW_NS)


@pytest.mark.parametrize(
    ("state", "landed"),
    [
        (dialect.MavLandedState.ON_GROUND, True),
        (dialect.MavLandedState.IN_AIR, False),
        (dialect.MavLandedState.LANDING, False),
        (dialect.MavLandedState.UNDEFINED, None),
    ],
)
def test_whether_it_has_landed_is_asked_for_until_it_is_told(
    state: dialect.MavLandedState, *, landed: bool | None
) -> None:
    watch, autopilot = VehicleWatch(Peer(255, 190)), Autopilot()
    watch.receive(autopilot.frame(HEARTBEAT), NOW_NS)
    assert watch.landed is None
    watch.receive(autopilot.frame(dialect.ExtendedSysState(landed_state=state)), NOW_NS)
    assert watch.landed is landed
    asked = [m.param1 for m in watch.questions(NOW_NS) if isinstance(m, dialect.CommandLong)]
    assert (dialect.ExtendedSysState.ID in asked) is (landed is None)
