"""What a QGroundControl without plug-in can do and sees; pymavlink stands in for it."""

import asyncio
import contextlib
import struct
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from pulses import pulse_at
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.messages import Command, FlightInfo, PulsePose, StatusText
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.saved_state import StateStore
from uavrt.flight.flight_recorder import FlightRecorder

Bay = Any  # tests/unit/processes/conftest.py
LYNX = made.tag(2, 148_710_000.0, name="lynx")
FOX = replace(LYNX, tag_id=4_000_000, frequency_hz=148_720_000.0, name=None)


class StockStation(asyncio.DatagramProtocol):
    """System 255, component 190, of type GCS: MAVLink's common dialect and nothing of ours."""

    def __init__(self, common: Any) -> None:
        self.common = common
        self.mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
        self.mav.robust_parsing = True
        self.heard: list[Any] = []
        """Messages of component 191."""
        self._vehicle: Any = None
        self._transport: Any = None

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: Any) -> None:
        self._vehicle = addr
        self.heard += [
            message
            for message in self.mav.parse_buffer(data) or []
            if message.get_srcComponent() == 191
        ]

    async def live(self) -> None:
        while True:
            if self._vehicle is not None:
                self.say(self.common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
            await asyncio.sleep(0.2)

    def say(self, message: Any) -> None:
        self._transport.sendto(message.pack(self.mav), self._vehicle)

    def set_run(self, value: int) -> None:
        field = struct.unpack("<f", struct.pack("<i", value))[0]  # as PX4 has it
        self.say(self.common.MAVLink_param_set_message(1, 191, b"DET_RUN", field, 6))

    @property
    def runs(self) -> list[int]:
        """Values of DET_RUN in the order of their coming."""
        return [
            struct.unpack("<i", struct.pack("<f", message.param_value))[0]
            for message in self.of("PARAM_VALUE")
            if message.param_id == "DET_RUN"
        ]

    @property
    def texts(self) -> list[str]:
        return [message.text for message in self.of("STATUSTEXT")]

    @property
    def values(self) -> list[tuple[str, float]]:
        return [
            (message.name, round(message.value, 3)) for message in self.of("NAMED_VALUE_FLOAT")
        ]

    def of(self, kind: str) -> list[Any]:
        return [message for message in self.heard if message.get_type() == kind]


@contextlib.asynccontextmanager
async def stock_station(bay: Bay) -> AsyncIterator[StockStation]:
    from pymavlink.dialects.v20 import common

    station = StockStation(common)
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: station, local_addr=("127.0.0.1", bay.ground_port)
    )
    living = asyncio.create_task(station.live())
    try:
        await until(lambda: station.of("HEARTBEAT"))
        await until(lambda: bay.process._link.other_station_present)
        yield station
    finally:
        living.cancel()
        await asyncio.gather(living, return_exceptions=True)
        transport.close()


@pytest.fixture(autouse=True)
def mavlink_2(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")


class MissionBehind:
    """The supervisor's mission behind the connection process of a bay."""

    def __init__(self, bay: Bay) -> None:
        self.bay = bay
        self.mission = Mission(
            replace(
                bay.settings, radio=replace(bay.settings.radio, center_frequency_hz=1.487e8)
            ),
            StateStore(Path(bay.settings.recording.directory)),
            notify=lambda severity, text: bay.deliver(
                "status_text", StatusText(severity=severity, text=text)
            ),
            on_start=lambda flight: bay.deliver("flight", flight),
            on_stop=lambda: None,
        )
        self._take = bay._take
        bay._take = self.take

    def take(self, topic: str, record: object) -> None:
        if isinstance(record, StatusText):  # as the tables have it: back to the ground
            self.bay.deliver("status_text", record)
        if isinstance(record, Command):
            self.do(record)
        else:
            self._take(topic, record)

    def do(self, command: Command) -> None:
        reply = self.mission.command(command)
        self.deliver_status()
        self.bay.deliver("command_reply", reply)

    def deliver_status(self) -> None:
        detecting = self.mission.state is SystemState.DETECTING or self.mission.flights.ending
        status = made.system_status(
            self.bay.clock.now_ns(),
            state=SystemState.DETECTING if detecting else self.mission.state,
            tags=(*self.mission.upload.tags.values(),),
            ending=self.mission.flights.ending,
        )
        self.bay.deliver("system_status", status)

    def send_tags(self) -> None:
        for number, step in enumerate(
            (
                Command(name="start_tags", request_id=0),
                Command(name="add_tag", request_id=0, tag=LYNX),
                Command(name="end_tags", request_id=0),
            )
        ):
            own = replace(step, request_id=number, source="command line")
            assert self.mission.command(own).accepted


async def test_it_starts_and_stops_by_a_parameter_that_shows_the_actual_state(bay: Bay) -> None:
    behind = MissionBehind(bay)
    async with bay.running(), stock_station(bay) as station:
        station.set_run(1)
        await until(lambda: station.runs == [0])
        await until(lambda: station.texts)
        assert station.texts == ["no tags stored: send them once with uavrt ground"]
        behind.send_tags()
        station.set_run(1)
        await until(lambda: station.runs == [0, 1])
        assert behind.mission.state is SystemState.DETECTING
        station.set_run(0)
        await until(lambda: station.runs == [0, 1, 0])
        assert behind.mission.flights.ending  # the last pulses are being recorded
        behind.deliver_status()
        behind.mission.flight_ended()
        behind.deliver_status()
        # A start and a stop from the drone's own command line.
        own = Command(name="start_detection", request_id=7, source="command line")
        behind.do(own)
        behind.do(replace(own, name="stop_detection", request_id=8))
        await until(lambda: station.runs == [0, 1, 0, 1, 0])


async def test_it_hears_of_a_tag_by_text_and_by_numbers(bay: Bay) -> None:
    async with bay.running(), stock_station(bay) as station:
        begin_flight(bay)
        start_ns = bay.clock.now_ns() - 200_000_000_000
        hear(bay, 2, start_ns, snr_db=14.23)
        hear(bay, 2, start_ns, snr_db=99.0, confirmed=False, after_s=0.1)
        await until(lambda: ("CNT_2", 1.0) in station.values)
        hear(bay, 2, start_ns, snr_db=12.0, after_s=1.25)
        hear(bay, FOX.tag_id, start_ns, snr_db=9.5, after_s=1.25, clipped=True)
        hear(bay, 2, start_ns, snr_db=11.5, after_s=46.27)
        await until(lambda: ("CNT_2", 3.0) in station.values)
        await until(lambda: len(station.texts) == 3 and len(station.values) == 6)
        assert set(station.texts) == {
            "Tag 2 (lynx) detected: 14.2 dB",
            "Tag 4000000 detected: at least 9.5 dB",
            "Tag 2 (lynx) detected again after 45 s: 11.5 dB",
        }
        assert station.values[:2] == [("SNR_2", 14.23), ("CNT_2", 1.0)]
        assert ("SNR_2", 11.5) in station.values
        assert {("SNR2DQF4", 9.5), ("CNT2DQF4", 1.0)} < set(station.values)


async def test_our_own_ground_station_gets_no_numbers_besides_its_pulses(bay: Bay) -> None:
    numbers: list[int] = []

    def take(frame: Any) -> None:
        if frame.message_id == 251:
            numbers.append(frame.message_id)

    async with bay.running(), bay.ground_station(on_frame=take) as (_, events):
        begin_flight(bay)
        hear(bay, 2, bay.clock.now_ns(), snr_db=14.2)
        text = StatusText(severity=6, text="Tag 2 (lynx) detected: 14.2 dB")
        await until(lambda: text in events)
        await asyncio.sleep(0.6)
    assert numbers == []


async def test_numbers_reach_it_by_radio_while_our_pulses_go_by_wifi(two_link_bay: Bay) -> None:
    bay = two_link_bay
    async with (
        bay.relay.running() as wifi,
        bay.running(),
        stock_station(bay) as station,
        bay.ground_station(f"udpout://127.0.0.1:{wifi.port}", radio=False),
    ):
        await until(lambda: bay.process._link.tunnel._links == (1, 0))
        begin_flight(bay)
        hear(bay, 2, bay.clock.now_ns(), snr_db=14.25)
        await until(lambda: len(station.values) == 2)
        assert station.values == [("SNR_2", 14.25), ("CNT_2", 1.0)]


async def test_a_restarted_connection_continues_its_counts_and_reports_no_tag_as_new(
    bay: Bay, tmp_path: Path
) -> None:
    start_ns = bay.clock.now_ns() - 100_000_000_000
    flight = replace(flight_of(bay), directory=str(tmp_path / "flight"))
    recorder = FlightRecorder.create(flight)
    before = [
        pulse_at(start_ns),
        pulse_at(start_ns + 1_254_000_000),
        pulse_at(start_ns + 2_000_000_000, confirmed=False),
    ]
    recorder.write_pulses([PulsePose(pulse=pulse, pose=None) for pulse in before])
    recorder.close()
    bay.assignment = replace(bay.assignment, flight=flight)
    async with bay.running(), stock_station(bay) as station:
        hear(bay, 2, start_ns, snr_db=9.0, after_s=3 * 1.254)
        await until(lambda: ("CNT_2", 3.0) in station.values)
        hear(bay, 2, start_ns, snr_db=8.0, after_s=90.0)
        await until(lambda: station.texts)
        assert station.texts == ["Tag 2 (lynx) detected again after 86 s: 8.0 dB"]


def begin_flight(bay: Bay) -> None:
    bay.deliver("flight", flight_of(bay))


def flight_of(bay: Bay) -> FlightInfo:
    return made.flight_info(
        bay.settings.recording.directory,
        (LYNX, FOX),
        start_time_ns=bay.clock.now_ns(),
        clock_offset_ns=bay.clock.offset_ns,
    )


def hear(bay: Bay, tag_id: int, start_ns: int, *, after_s: float = 0.0, **numbers: Any) -> None:
    time_ns = start_ns + round(after_s * 1e9)
    bay.deliver("pulse", pulse_at(time_ns, tag_id=tag_id, **{"confirmed": True, **numbers}))
