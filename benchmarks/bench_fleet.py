"""One ground station and five vehicles of twenty tags each, 40 pulses a second in all.

Bars: a page is at most 300 ms behind, the server takes at most 15 % of a core and 150 MB. Each
vehicle sends what one in the field sends over a radio: heartbeats, attitude and position four
times a second, and its pulses, in groups of three as detectors report them. It turns on the
spot, so that the station has bearings and positions to work out. Once with the page of one
vehicle open, once with all five. How far a page is behind is taken at its WebSocket, from the
datagram's sending; what a browser adds is told by the section `page`.
"""

import asyncio
import json
import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from websockets.asyncio.client import connect

from benchmarks.harness import Table
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.commands import SystemState
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, Pulse, PulsePose, Tag
from uavrt.drone.supervisor.start.usage import usage_of
from uavrt.link.mavlink import dialect
from uavrt.link.mavlink.frame import FrameWriter
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE
from uavrt.link.tunnel.tunnel_records import heartbeat_to_wire, pulse_to_wire
from uavrt.simulation.demo.demo_programs import free_udp_port
from uavrt_experiments.resources.usage import pss_mb

VEHICLES, TAGS, PULSES_HZ = 5, 20, 8.0
TURN_S, MOVE_S = 40.0, 5.0
SETTLE_S, MEASURED_S = 50.0, 40.0
STEP_S = 0.025
BAR_MS, BAR_PERCENT, BAR_MB = 300.0, 15.0, 150.0
TAG_LIST = [
    Tag(
        tag_id=2 * number + 2,
        frequency_hz=148e6 + 20_000.0 * (number + 1),
        pulse_width_s=0.02,
        pulse_intervals_s=(1.4,),
    )
    for number in range(TAGS)
]
PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
_COPTER, _PX4, _ACTIVE, _MAVLINK_2 = 2, 12, 4, 3


def run() -> list[Table]:
    """Measure."""
    rows = []
    for name, pages in (("one page", 1), ("five pages", VEHICLES)):
        lags, cpu, memory = asyncio.run(measured(pages))
        behind = f"{np.quantile(lags, 0.95):.0f} ms, {max(lags):.0f} ms" if lags else ""
        kept = cpu <= BAR_PERCENT and memory <= BAR_MB and max(lags, default=0.0) <= BAR_MS
        rows.append(
            [
                name,
                f"{cpu:.1f} %",
                f"{memory:.0f} MB",
                behind,
                str(len(lags)),
                f"≤ {BAR_PERCENT:g} %, {BAR_MB:g} MB, {BAR_MS:g} ms: "
                + ("met" if kept else "NOT met"),
            ]
        )
    return [
        Table(
            title=f"Ground station with {VEHICLES} vehicles of {TAGS} tags, "
            f"{VEHICLES * PULSES_HZ:g} pulses a second in all",
            header=["open", "of a core", "PSS", "behind: 95 %, worst", "pulses seen", "bar"],
            rows=rows,
            notes=[
                f"Over {MEASURED_S:g} s, {SETTLE_S:g} s after the first pulse: after the first "
                "bearings."
            ],
        )
    ]


class Vehicle:
    """A drone that circles, turns and hears its tags in turn."""

    def __init__(self, number: int, port: int) -> None:
        self.number = number
        self._autopilot, self._companion = FrameWriter(number, 1), FrameWriter(number, 191)
        self._port, self._sent = port, 0
        self._sock: asyncio.DatagramTransport

    async def open(self) -> None:
        """Get a socket."""
        self._sock, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            asyncio.DatagramProtocol, remote_addr=("127.0.0.1", self._port)
        )

    def step(self, step: int, at_s: float) -> list[int]:
        """Send what is due; the beginnings of the pulses in it."""
        if step % 40 == self.number:
            self._beat()
        pose = self._pose(at_s)
        if step % 10 == self.number:
            self._telemetry(pose)
        begun = []
        while self._sent < (at_s + 0.13 * self.number) * PULSES_HZ // 3 * 3:
            begun.append(self._pulse(pose))
            self._sent += 1
        return begun

    def _beat(self) -> None:
        beat = dialect.Heartbeat(
            type=_COPTER, autopilot=_PX4, system_status=_ACTIVE, mavlink_version=_MAVLINK_2
        )
        self._sock.sendto(self._autopilot.encode(beat))
        self._sock.sendto(self._companion.encode(beat))
        self._tunnel(heartbeat_to_wire(SystemState.DETECTING, 51.5).encode())

    def _pose(self, at_s: float) -> Pose:
        """Turning on the spot for 40 s, then 60 m on in 5 s, and so on."""
        stop, within_s = divmod(at_s, TURN_S + MOVE_S)
        turned = min(within_s / TURN_S, 1.0)
        gone = stop + max(0.0, within_s - TURN_S) / MOVE_S
        east_m, north_m = 150.0 * self.number + 60.0 * gone, 50.0 * self.number
        self._place = east_m, north_m, 2.0 * math.pi * turned
        latitude, longitude = PLANE.to_geodetic(east_m, north_m)
        half = math.pi * turned
        return Pose(
            time_ns=time.time_ns(),
            latitude_deg=float(latitude),
            longitude_deg=float(longitude),
            altitude_amsl_m=1060.0,
            altitude_relative_m=60.0,
            quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
        )

    def _snr_db(self, tag: int) -> float:
        """Of a tag on a ring of 600 m about the place, by an antenna that looks ahead."""
        east_m, north_m, yaw = self._place
        angle = 2.0 * math.pi * tag / TAGS
        course = math.atan2(
            500.0 + 600.0 * math.sin(angle) - east_m, 600.0 * math.cos(angle) - north_m
        )
        return 22.0 + 7.0 * math.cos(course - yaw) + math.sin(7.0 * self._sent)

    def _telemetry(self, pose: Pose) -> None:
        boot_ms = (pose.time_ns // 1_000_000) % 1_000_000_000
        position = dialect.GlobalPositionInt(
            time_boot_ms=boot_ms,
            lat=round(pose.latitude_deg * 1e7),
            lon=round(pose.longitude_deg * 1e7),
            alt=round(pose.altitude_amsl_m * 1e3),
            relative_alt=round(pose.altitude_relative_m * 1e3),
            hdg=9_000,
        )
        w, x, y, z = pose.quaternion_wxyz
        attitude = dialect.AttitudeQuaternion(time_boot_ms=boot_ms, q1=w, q2=x, q3=y, q4=z)
        for message in (position, attitude):
            self._sock.sendto(self._autopilot.encode(message))

    def _pulse(self, pose: Pose) -> int:
        group, index = divmod(self._sent, 3)
        tag_id = TAG_LIST[group % TAGS].tag_id
        start_ns = time.time_ns() - 500_000_000 + index
        heard = Pulse(
            tag_id=tag_id,
            frequency_hz=TAG_LIST[group % TAGS].frequency_hz,
            start_time_ns=start_ns,
            end_time_ns=start_ns + 20_000_000,
            snr_db=self._snr_db(group % TAGS),
            group_snr_db=22.0,
            score=2.0,
            group_index=1 + index,
            group_sequence=group,
            noise_psd=1e-9,
            detection_status="confirmed",
            confirmed=True,
            rate=1,
            predicted_next_start_ns=None,
            predicted_next_end_ns=None,
        )
        self._tunnel(pulse_to_wire(PulsePose(pulse=heard, pose=pose)).encode())
        return start_ns

    def _tunnel(self, payload: bytes) -> None:
        message = dialect.Tunnel(
            target_system=254,
            target_component=190,
            payload_type=PAYLOAD_TYPE,
            payload_length=len(payload),
            payload=payload,
        )
        self._sock.sendto(self._companion.encode(message))


async def measured(pages: int) -> tuple[list[float], float, float]:
    """How far behind each pulse was [ms], share of a core [%], memory [MB]."""
    with tempfile.TemporaryDirectory() as work:
        port = free_udp_port()
        tags = Path(work) / "tags.toml"
        write_tags(tags, TAG_LIST)
        further = [f"--vehicle={number}" for number in range(2, VEHICLES + 1)]
        server = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "uavrt.cli", "ground", "--page", "--no-browser"),
            *("--port", "0", "--mavlink", f"udpin://127.0.0.1:{port}", "-o", work),
            *("--tags", str(tags), *further),
            stdout=asyncio.subprocess.PIPE,
        )
        assert server.stdout is not None
        try:
            address = (await server.stdout.readline()).decode().split()[4]
            drain = asyncio.create_task(server.stdout.read())
            found = await _flown(server.pid, address, port, pages)
        finally:
            server.terminate()
            await server.wait()
        await drain
    return found


async def _flown(
    pid: int, address: str, port: int, pages: int
) -> tuple[list[float], float, float]:
    vehicles = [Vehicle(number, port) for number in range(1, VEHICLES + 1)]
    for vehicle in vehicles:
        await vehicle.open()
    sent_s: dict[tuple[int, int], float] = {}
    flying = asyncio.create_task(_fly(vehicles, sent_s))
    seen_s: dict[tuple[int, int], float] = {}
    watching = [
        asyncio.create_task(_watch(address, vehicle.number, seen_s))
        for vehicle in vehicles[:pages]
    ]
    await asyncio.sleep(SETTLE_S)
    begun_s, cpu_s = time.monotonic(), usage_of(pid).cpu_s
    await asyncio.sleep(MEASURED_S)
    ended_s = time.monotonic()
    cpu = 100.0 * (usage_of(pid).cpu_s - cpu_s) / (ended_s - begun_s)
    memory = pss_mb(pid)
    for task in (flying, *watching):
        if task.done():
            task.result()
        task.cancel()
    await asyncio.gather(flying, *watching, return_exceptions=True)
    due = [one for one, at_s in sent_s.items() if begun_s <= at_s < ended_s - 1.0]
    due = [one for one in due if one[0] <= pages]
    missing = sum(one not in seen_s for one in due)
    if missing:
        raise RuntimeError(f"{missing} of {len(due)} pulses never reached their page")
    return [1e3 * (seen_s[one] - sent_s[one]) for one in due], cpu, memory


async def _fly(vehicles: list[Vehicle], sent_s: dict[tuple[int, int], float]) -> None:
    begun_s = time.monotonic()
    for step in range(1_000_000):
        await asyncio.sleep(max(0.0, begun_s + step * STEP_S - time.monotonic()))
        for vehicle in vehicles:
            for start_ns in vehicle.step(step, step * STEP_S):
                sent_s[vehicle.number, start_ns // 1000] = time.monotonic()


async def _watch(address: str, number: int, seen_s: dict[tuple[int, int], float]) -> None:
    page = address if number == 1 else f"{address}vehicle/{number}/"
    async with connect(page.replace("http", "ws") + "api/records", max_size=None) as socket:
        async for text in socket:
            now_s = time.monotonic()
            message = json.loads(text)
            if message["topic"] == "pulse":
                start_ns = message["record"]["start_time_ns"]
                # The wire carries times with 0.3 µs.
                for near in (-1, 0, 1):
                    seen_s.setdefault((number, start_ns // 1000 + near), now_s)
