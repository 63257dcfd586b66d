"""Missions and fences over the mission protocol, with losses and hostile answers."""

from dataclasses import replace
from math import nan
from typing import Any

import made
import pytest
from mission_wire import OWN, VEHICLE, MissionWire

from uavrt.core.messages import KeepOut, VehicleFence
from uavrt.guidance.files.mission import MissionItem, difference, fence_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.autopilot.mission_transfer import (
    MissionDownload,
    MissionUpload,
    with_home,
)
from uavrt.link.mavlink.message import Message
from uavrt.simulation.vehicle.airframe import Flavour

TO_US = {"target_system": OWN[0], "target_component": OWN[1]}
BOTH: tuple[Flavour, ...] = ("px4", "ardupilot")
MISSION = (
    *(MissionItem.at(16, 3, (47.1 + 0.001 * n, 8.5), 60.0) for n in range(14)),
    MissionItem(command=20, frame=2),
)
FENCE = VehicleFence(
    within=(KeepOut(places=((47.0, 8.4), (47.0, 8.6), (47.2, 8.5)), name="vehicle's fence"),),
    keep_out=(KeepOut(places=((47.1, 8.5),), radius_m=25.0, name="vehicle's fence"),),
)


def upload(**values: Any) -> MissionUpload:
    return MissionUpload(
        values.get("items", MISSION), values.get("kind", "mission"), VEHICLE, OWN
    )


def held_by(wire: MissionWire, kind: Any = "mission") -> list[MissionItem]:
    download = MissionDownload(kind, VEHICLE, OWN)
    wire.run(download)
    assert download.done, download.fault
    return download.items


@pytest.mark.parametrize("flavour", BOTH)
@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_a_mission_arrives_whole_though_a_fifth_is_lost(flavour: Flavour, loss: float) -> None:
    for seed in range(1 if loss == 0.0 else 40):
        wire = MissionWire(flavour, loss=loss, seed=seed)
        sent = upload()
        wire.run(sent)
        assert sent.done, (seed, sent.fault)
        assert difference(MISSION, held_by(wire)) is None
        if loss == 0.0:
            assert sent.acknowledged
            assert not sent.counters


@pytest.mark.parametrize("flavour", BOTH)
def test_a_fence_comes_as_it_was_drawn(flavour: Flavour) -> None:
    wire = MissionWire(flavour, loss=0.2)
    wire.run(upload(items=made.fence_items(FENCE), kind="fence"))
    assert fence_of(held_by(wire, "fence")) == FENCE


@pytest.mark.parametrize("flavour", BOTH)
def test_no_fence_is_an_empty_one(flavour: Flavour) -> None:
    assert fence_of(held_by(MissionWire(flavour), "fence")) == VehicleFence()


def test_nothing_is_sent_that_starts_moves_or_arms() -> None:
    wire = MissionWire("px4", loss=0.2)
    wire.run(upload())
    held_by(wire)
    kinds = {type(message) for message in wire.sent}
    assert kinds == {
        dialect.MissionCount,
        dialect.MissionItemInt,
        dialect.MissionRequestList,
        dialect.MissionRequestInt,
        dialect.MissionAck,
    }
    items = [one for one in wire.sent if isinstance(one, dialect.MissionItemInt)]
    assert {one.current for one in items} == {0}


def test_a_vehicle_that_never_answers_is_given_up() -> None:
    wire = MissionWire("px4", loss=1.0)
    sent = upload()
    took_s = wire.run(sent)
    assert sent.fault == "the autopilot did not answer in 12 s"
    assert took_s < 15.0
    assert sent.counters["sent_again"] == 11


def test_a_vehicle_that_stops_asking_is_asked_anew_and_given_up_in_the_end() -> None:
    wire = MissionWire("px4")
    sent = upload()
    first = dialect.MissionRequestInt(**TO_US)
    wire.store.receive = lambda *_: True  # type: ignore[method-assign]
    wire.also = lambda now_s: [first] if round(now_s / 0.05) % 20 == 0 else []
    took_s = wire.run(sent)
    assert sent.fault is not None
    assert took_s < 120.0


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (1, "cannot accept a mission now"),
        (4, "more items than"),
        (14, "accepts no missions from"),
        (9, "result 9"),
    ],
)
def test_a_refusal_is_told_with_its_reason(result: int, said: str) -> None:
    wire, sent = MissionWire("px4"), upload()
    refusal = dialect.MissionAck(**TO_US, type=result)
    wire.also = lambda now_s: [refusal]
    wire.run(sent)
    assert sent.fault is not None
    assert said in sent.fault


def hostile() -> list[Message]:
    """Answers that are none: early, for others, of another list, beyond the end, copies."""
    item: dict[str, Any] = {
        "frame": 3,
        "command": 16,
        "current": 0,
        "autocontinue": 1,
        "param1": 0.0,
        "param2": 0.0,
        "param3": 0.0,
        "param4": 0.0,
        "x": 0,
        "y": 0,
        "z": 0.0,
    }
    return [
        dialect.MissionAck(**TO_US, mission_type=1),
        dialect.MissionAck(target_system=255, target_component=190, type=1),
        dialect.MissionRequestInt(**TO_US, seq=60_000),
        dialect.MissionItemInt(**TO_US, seq=60_000, **item),
        dialect.MissionItemInt(**TO_US, mission_type=1, **item),
        dialect.MissionCount(**TO_US, count=3, mission_type=2),
    ]


@pytest.mark.parametrize("flavour", BOTH)
def test_strange_answers_are_counted_and_change_nothing(flavour: Flavour) -> None:
    wire = MissionWire(flavour)
    wire.also = lambda now_s: hostile()
    sent = upload()
    wire.run(sent)
    assert sent.done
    assert sent.counters["strange"] > 0
    assert difference(MISSION, held_by(wire)) is None


def test_an_early_yes_is_none() -> None:
    sent = upload()
    sent.due(0.0)
    yes = dialect.MissionAck(**TO_US)
    assert sent.receive(yes, (1, 1), 0.1) == []
    assert not sent.done
    assert sent.counters["strange"] == 1


def test_answers_of_another_vehicle_are_none() -> None:
    download = MissionDownload("fence", VEHICLE, OWN)
    download.due(0.0)
    count = dialect.MissionCount(**TO_US, mission_type=1)
    assert download.receive(count, (2, 1), 0.1) == []
    assert not download.done


@pytest.mark.parametrize(("count", "z"), [(65_535, 0.0), (1, nan)])
def test_a_list_that_cannot_be_is_given_up_and_the_vehicle_told(count: int, z: float) -> None:
    download = MissionDownload("mission", VEHICLE, OWN)
    download.due(0.0)
    said = download.receive(dialect.MissionCount(**TO_US, count=count), (1, 1), 0.1)
    if count == 1:
        bad = next(one for one in hostile() if isinstance(one, dialect.MissionItemInt))
        bad.seq, bad.z, bad.mission_type = 0, z, 0
        said = download.receive(bad, (1, 1), 0.2)
    assert download.fault is not None
    assert isinstance(said[0], dialect.MissionAck)
    assert said[0].type != 0


def test_a_cancelled_upload_leaves_what_was_held() -> None:
    wire = MissionWire("px4")
    wire.run(upload())
    other = upload(items=MISSION[3:])
    asked = 0

    def cancel(now_s: float) -> list[Message]:
        nonlocal asked
        asked += 1
        if asked == 12:
            wire._send(other.cancel("the vehicle flies its mission now"))
        return []

    wire.also = cancel
    wire.run(other)
    wire.also = lambda now_s: []
    assert other.fault == "the vehicle flies its mission now"
    assert difference(MISSION, held_by(wire)) is None


def test_ardupilot_keeps_home_before_the_mission() -> None:
    assert with_home(MISSION, home_first=True)[1:] == MISSION
    assert with_home(MISSION, home_first=False) == MISSION


def test_what_differs_is_told() -> None:
    assert difference(MISSION, MISSION[1:]) == "the vehicle has 14 items, not 15"
    lower = (replace(MISSION[0], z=10.0), *MISSION[1:])
    assert difference(MISSION, lower) == "item 1 differs"
    as_px4 = tuple(replace(one, frame={3: 6}.get(one.frame, one.frame)) for one in MISSION)
    assert difference(MISSION, as_px4) is None
