"""Stations without an autopilot: a mast, and people with a GPS receiver."""

import asyncio
import json
import math
import socket
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.unit.test_nmea import sentence
from until import until_async as until

from uavrt.config.settings import MavlinkSettings, PoseSettings, RecordingSettings, Settings
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Poses, PulsePose, StatusText
from uavrt.drone.processes.connection_parts.own_pose import pose_address
from uavrt.ground.link.vehicles.vehicle_state import VehicleWatch
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.discovery import Peer
from uavrt.simulation.demo.demo_programs import free_udp_port

Bay = Any  # tests/unit/processes/conftest.py
MAST = PoseSettings(
    source="fixed",
    latitude_deg=46.501,
    longitude_deg=8.002,
    altitude_amsl_m=700.0,
    height_m=6.0,
    heading_deg=250.0,
)


def without_autopilot(bay: Bay, pose: PoseSettings, directory: Path) -> str:
    """Take the autopilot away; returns the address for a ground station."""
    port = free_udp_port()
    bay.settings = Settings(
        mavlink=MavlinkSettings(
            address="", direct_links=(f"udpin://127.0.0.1:{port}",), system_id=7
        ),
        pose=pose,
        recording=RecordingSettings(directory=str(directory)),
    )
    bay.assignment = replace(bay.assignment, settings=bay.settings)
    return f"udpout://127.0.0.1:{port}"


def poses_of(events: list[Any]) -> list[Any]:
    return [one.pose for one in events if isinstance(one, PulsePose) and one.pose is not None]


def recorded_pose(bay: Bay) -> Any:
    """The first pulse's pose as the recorder gets it; the wire has no height above the sea."""
    return next(one.pose for _, one in bay.records if isinstance(one, PulsePose))


def heading_deg(pose: Any) -> float:
    w, _, _, z = pose.quaternion_wxyz
    return math.degrees(2.0 * math.atan2(z, w)) % 360.0


def texts(bay: Bay) -> list[str]:
    return [one.text for _, one in bay.records if isinstance(one, StatusText)]


async def test_a_masts_pulses_have_its_place_and_the_ground_sees_where_it_stands(
    bay: Bay, tmp_path: Path
) -> None:
    address = without_autopilot(bay, MAST, tmp_path)
    frames: list[Any] = []
    station = bay.ground_station(address, radio=False, on_frame=frames.append)
    async with bay.running(), station as (link, events):
        await until(lambda: bay.health is not None and bay.health.status == "ready")
        bay.send_pulse(1)
        await until(lambda: poses_of(events))
        (pose,) = poses_of(events)
        assert (pose.latitude_deg, pose.longitude_deg) == pytest.approx(
            (46.501, 8.002), abs=1e-6
        )
        assert recorded_pose(bay).altitude_amsl_m == pytest.approx(706.0, abs=0.01)
        assert pose.altitude_relative_m == pytest.approx(6.0, abs=0.01)
        assert heading_deg(pose) == pytest.approx(250.0, abs=0.1)
        await until(lambda: {dialect.GlobalPositionInt.ID} & {f.message_id for f in frames})
        watch = VehicleWatch(Peer(254, 190), link.protocol.identity)
        seen = [pose for one in frames if (pose := watch.receive(one, 10**18)) is not None]
        assert (seen[-1].latitude_deg, heading_deg(seen[-1])) == pytest.approx(
            (46.501, 250.0), abs=0.01
        )
        assert link.protocol.identity.system_id == 7
        recorded = [one for _, one in bay.records if isinstance(one, Poses)]
        await until(lambda: [one for _, one in bay.records if isinstance(one, Poses)])
        assert not any(pose.extrapolated for one in recorded for pose in one.poses)


async def test_a_heading_that_is_typed_while_it_runs_is_in_force_at_once(
    bay: Bay, tmp_path: Path
) -> None:
    address = without_autopilot(bay, MAST, tmp_path)
    async with bay.running(), bay.ground_station(address, radio=False) as (_, events):
        await until(lambda: bay.health is not None and bay.health.status == "ready")
        turned = replace(bay.settings, pose=replace(MAST, heading_deg=-10.0))
        bay.deliver("settings", turned)
        before = bay.counter("pose_places")
        await until(lambda: bay.counter("pose_places") >= before + 3)
        bay.send_pulse(1)
        await until(lambda: poses_of(events))
        assert heading_deg(poses_of(events)[0]) == pytest.approx(350.0, abs=0.1)


async def test_a_person_with_an_nmea_receiver_is_where_it_says_whatever_else_comes(
    bay: Bay, tmp_path: Path
) -> None:
    port = free_udp_port()
    source = PoseSettings(source="nmea", address=f"udpin://127.0.0.1:{port}", height_m=1.5)
    address = without_autopilot(bay, source, tmp_path)
    sentences = [
        sentence("GNGGA,101500.00,4630.0600,N,00800.1200,E,1,09,0.9,412.0,M,48.0,M,,"),
        sentence("GPRMC,101500.00,A,4630.0600,N,00800.1200,E,0.1,0.0,010526,,,A"),
        b"$GNGGA,broken\r\n\xff\x00" + b"x" * 500,
    ]
    compass = sentence("HCHDT,90.0,T")
    receiver = socket.socket(type=socket.SOCK_DGRAM)
    sending = [*sentences]

    async def send() -> None:
        while True:
            for one in sending:
                receiver.sendto(one, ("127.0.0.1", port))
            await asyncio.sleep(0.2)

    async with bay.running(), bay.ground_station(address, radio=False) as (_, events):
        task = asyncio.create_task(send())
        await until(lambda: any("heading" in one for one in texts(bay)))
        sending.append(compass)
        await until(lambda: bay.health is not None and bay.health.status == "ready")
        bay.send_pulse(1)
        await until(lambda: poses_of(events))
        assert bay.counter("pose_refused") > 0
        task.cancel()
        receiver.close()
    (pose,) = poses_of(events)
    assert (pose.latitude_deg, pose.longitude_deg) == pytest.approx((46.501, 8.002), abs=1e-6)
    assert recorded_pose(bay).altitude_amsl_m == pytest.approx(412.0, abs=0.01)
    assert pose.altitude_relative_m == pytest.approx(1.5, abs=0.01)
    assert heading_deg(pose) == pytest.approx(90.0, abs=0.1)
    assert bay.counter("pose_places_without_altitude") > 0


async def test_gpsd_is_asked_and_asked_again_when_it_comes_back(
    bay: Bay, tmp_path: Path
) -> None:
    asked: list[bytes] = []
    clients: list[asyncio.StreamWriter] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        clients.append(writer)
        writer.write(b'{"class":"VERSION","release":"3.25"}\n')
        asked.append(await reader.readline())
        report = {"class": "TPV", "mode": 3, "lat": 46.5, "lon": 8.0, "altMSL": 412.0}
        while not writer.is_closing():
            writer.write(json.dumps(report).encode() + b"\n")
            writer.write(b'{"class":"ATT","heading":33.0}\n')
            await asyncio.sleep(0.2)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    source = PoseSettings(source="gpsd", address=f"127.0.0.1:{port}")
    address = without_autopilot(bay, source, tmp_path)
    async with bay.running(), bay.ground_station(address, radio=False) as (_, events):
        await until(lambda: bay.health is not None and bay.health.status == "ready")
        clients[0].close()
        await until(lambda: len(asked) == 2)
        places = bay.counter("pose_places")
        await until(lambda: bay.counter("pose_places") > places + 2)
        bay.send_pulse(1)
        await until(lambda: poses_of(events))
        for one in clients:
            one.close()
        server.close()
    assert all(b"WATCH" in one for one in asked)
    assert heading_deg(poses_of(events)[0]) == pytest.approx(33.0, abs=0.1)


async def test_a_receiver_that_falls_silent_is_named_and_pulses_go_on_without_a_place(
    bay: Bay, tmp_path: Path
) -> None:
    port = free_udp_port()
    source = PoseSettings(source="nmea", address=f"udpin://127.0.0.1:{port}", heading_deg=0.0)
    address = without_autopilot(bay, source, tmp_path)
    async with bay.running(), bay.ground_station(address, radio=False) as (_, events):
        await until(lambda: any("Waiting for a position" in one for one in texts(bay)))
        bay.send_pulse(1)
        await until(lambda: [one for one in events if isinstance(one, PulsePose)])
    assert poses_of(events) == []


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        (PoseSettings(source="fixed"), "latitude_deg, longitude_deg, heading_deg"),
        (replace(MAST, heading_deg=None), "needs heading_deg"),
        (PoseSettings(source="nmea"), "needs pose.address"),
        (PoseSettings(source="nmea", address="COM3"), "not a link address"),
        (PoseSettings(source="gpsd", address="nonsense"), "not HOST:PORT"),
    ],
)
def test_an_incomplete_source_is_refused_with_the_remedy(
    pose: PoseSettings, words: str
) -> None:
    with pytest.raises(ConfigError, match=words) as caught:
        pose_address(pose)
    assert caught.value.remedy
