"""The parts of one vehicle's session: small enough to read, and each right by itself."""

import ast
import asyncio
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import made
import pytest

from uavrt import ground
from uavrt.config.tags.tag_corrections import correction_of
from uavrt.core.commands import CommandId, SystemState
from uavrt.core.errors import CommandRefused
from uavrt.ground.link.protocol import Acknowledged, DroneHeartbeat
from uavrt.ground.link.received.drone_reports import DroneReports
from uavrt.ground.link.requests.pending_commands import Exchange
from uavrt.ground.link.vehicles.drone_contact import DroneContact
from uavrt.ground.store.live_columns import POSE_STEP_NS, LiveColumns
from uavrt.link.tunnel.generations.g0 import HeaderMessage

MOST_LINES, MOST_METHODS, MOST_ATTRIBUTES = 250, 20, 12
LARGER = {
    "GroundProtocol": (234, 20, 15),
    "GroundStore": (206, 22, 14),
    "VehicleWatch": (193, 16, 18),
}
"""Lines, methods and attributes of classes that exceed a limit: none may grow."""


def sizes() -> dict[str, tuple[int, int, int]]:
    found = {}
    for path in Path(ground.__path__[0]).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                methods = [one for one in node.body if isinstance(one, Methods)]
                stored = {
                    one.attr
                    for method in methods
                    for one in ast.walk(method)
                    if isinstance(one, ast.Attribute)
                    and isinstance(one.ctx, ast.Store)
                    and ast.unparse(one.value) == "self"
                }
                lines = (node.end_lineno or 0) - node.lineno + 1
                found[node.name] = (lines, len(methods), len(stored))
    return found


Methods = ast.FunctionDef | ast.AsyncFunctionDef


def test_no_class_of_the_ground_station_grows_beyond_one_sitting() -> None:
    most = (MOST_LINES, MOST_METHODS, MOST_ATTRIBUTES)
    grown = {
        name: size
        for name, size in sizes().items()
        if any(now > limit for now, limit in zip(size, LARGER.get(name, most), strict=True))
    }
    assert not grown, "split it; lines, methods and attributes are limited"


def test_a_drone_that_is_lost_has_no_state_and_keeps_its_tags() -> None:
    drone = DroneReports(now_ns=0)
    drone.receive_heartbeat(DroneHeartbeat(state=SystemState.IDLE, cpu_temperature_c=40.0))
    assert drone.set_presence(True, 5)
    assert not drone.set_presence(True, 7)
    drone.tags_accepted((made.tag(),))
    assert (drone.state, drone.contact_ns) == (SystemState.HAS_TAGS, 7)
    assert drone.set_presence(False, 9)
    assert (drone.state, drone.contact_ns, len(drone.sent_tags)) == (None, 7, 1)
    drone.tags_accepted(())
    assert drone.state is None, "only a drone in contact has a state"


def test_a_sender_measured_before_its_tag_was_corrected_is_outdated() -> None:
    before = made.tag(2)
    beep = made.beep(
        frequency_hz=before.frequency_hz + 640.0, tag_ids=(2,), offsets_hz=(640.0,)
    )
    correction = correction_of(before, beep, 0)
    assert correction is not None
    drone = DroneReports(now_ns=0)
    drone.set_tags((correction.after,))
    assert not drone.receive_beep(beep, [correction])
    drone.set_tags((before,))
    assert drone.receive_beep(beep, [])
    assert not drone.receive_beep(beep, []), "it is known"


def test_poses_in_memory_keep_their_distance_and_the_first_gives_the_takeoff_height() -> None:
    live = LiveColumns()
    poses = [made.pose(time_ns=(10 + n) * POSE_STEP_NS // 2) for n in range(5)]
    assert [live.add_pose(pose) for pose in poses] == [True, False, True, False, True]
    columns = live.columns(goes_on=True)
    assert columns.poses.shape == (8, 3)
    height_m = poses[0].altitude_amsl_m - poses[0].altitude_relative_m
    assert math.isclose(columns.takeoff_amsl_m, height_m)


@pytest.mark.parametrize(("request_id", "tries"), [(7, 1), (8, 4)])
async def test_only_the_answer_to_this_request_ends_a_command(
    request_id: int, tries: int
) -> None:
    sent: list[Any] = []
    protocol: Any = SimpleNamespace(
        tunnel_message=lambda payload, kind: payload, counters={"retries": 0}, drone=None
    )
    ways: Any = SimpleNamespace(best=lambda: [0], send=lambda message, link: sent.append(link))
    exchange = Exchange(protocol, ways, DroneContact(None), lambda: 0, 0.01)
    payload = HeaderMessage(command=CommandId.START_DETECTION).encode()
    waiting = asyncio.create_task(exchange.command(payload, 0, 7))
    await asyncio.sleep(0)
    answer = Acknowledged(
        command=CommandId.START_DETECTION, accepted=False, message="busy", request_id=request_id
    )
    exchange.receive(answer)
    with pytest.raises(Exception, match="busy" if tries == 1 else "did not answer") as error:
        await waiting
    assert len(sent) == tries
    assert isinstance(error.value, CommandRefused) is (tries == 1)
