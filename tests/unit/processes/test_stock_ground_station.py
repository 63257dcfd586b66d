"""What a QGroundControl without plug-in can do and sees; pymavlink stands in for it."""

import asyncio
from contextlib import AbstractAsyncContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from pulses import pulse_at
from stock_station import StockStation, bytewise, stock_station
from until import until_async as until

from uavrt.core.commands import SystemState
from uavrt.core.messages import Command, FlightInfo, PulsePose, StatusText
from uavrt.drone.supervisor.supervisor_program import start_commands
from uavrt.flight.flight_recorder import FlightRecorder

Bay = Any  # tests/unit/processes/conftest.py
LYNX = made.tag(2, 148_710_000.0, name="lynx")
FOX = replace(LYNX, tag_id=4_000_000, frequency_hz=148_720_000.0, name=None)


def listening(bay: Bay) -> AbstractAsyncContextManager[StockStation]:
    return stock_station(bay.ground_port, lambda: bay.process._link.other_station_present)


def set_run(station: StockStation, value: int) -> None:
    station.say(
        station.common.MAVLink_param_set_message(1, 191, b"DET_RUN", bytewise(value), 6)
    )


def runs(station: StockStation) -> list[float]:
    """Values of DET_RUN in the order of their coming."""
    return [value for name, value in station.values() if name == "DET_RUN"]


def named(station: StockStation) -> list[tuple[str, float]]:
    return [
        (message.name, round(message.value, 3)) for message in station.of("NAMED_VALUE_FLOAT")
    ]


@pytest.fixture(autouse=True)
def mavlink_2(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")


class MissionBehind:
    """The supervisor's mission behind the connection process of a bay."""

    def __init__(self, bay: Bay) -> None:
        self.bay = bay
        self.mission = made.mission(
            replace(
                bay.settings, radio=replace(bay.settings.radio, center_frequency_hz=1.487e8)
            ),
            Path(bay.settings.recording.directory),
            notify=lambda severity, text: bay.deliver(
                "status_text", StatusText(severity=severity, text=text)
            ),
            on_start=lambda flight: bay.deliver("flight", flight),
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
        for number, step in enumerate(start_commands((LYNX,))[:-1]):
            own = replace(step, request_id=number, source="command line")
            assert self.mission.command(own).accepted


async def test_it_starts_and_stops_by_a_parameter_that_shows_the_actual_state(bay: Bay) -> None:
    behind = MissionBehind(bay)
    async with bay.running(), listening(bay) as station:
        set_run(station, 1)
        await until(lambda: runs(station) == [0])
        await until(lambda: station.texts)
        assert station.texts == ["no tags stored: send them once with uavrt ground"]
        behind.send_tags()
        set_run(station, 1)
        await until(lambda: runs(station) == [0, 1])
        assert behind.mission.state is SystemState.DETECTING
        set_run(station, 0)
        await until(lambda: runs(station) == [0, 1, 0])
        assert behind.mission.flights.ending  # the last pulses are being recorded
        behind.deliver_status()
        behind.mission.flight_ended()
        behind.deliver_status()
        # A start and a stop from the drone's own command line.
        own = Command(name="start_detection", request_id=7, source="command line")
        behind.do(own)
        behind.do(replace(own, name="stop_detection", request_id=8))
        await until(lambda: runs(station) == [0, 1, 0, 1, 0])


async def test_it_hears_of_a_tag_by_text_and_by_numbers(bay: Bay) -> None:
    async with bay.running(), listening(bay) as station:
        begin_flight(bay)
        start_ns = bay.clock.now_ns() - 200_000_000_000
        hear(bay, 2, start_ns, snr_db=14.23)
        hear(bay, 2, start_ns, snr_db=99.0, confirmed=False, after_s=0.1)
        await until(lambda: ("CNT_2", 1.0) in named(station))
        hear(bay, 2, start_ns, snr_db=12.0, after_s=1.25)
        hear(bay, FOX.tag_id, start_ns, snr_db=9.5, after_s=1.25, clipped=True)
        hear(bay, 2, start_ns, snr_db=11.5, after_s=46.27)
        await until(lambda: ("CNT_2", 3.0) in named(station))
        await until(lambda: len(station.texts) == 3 and len(named(station)) == 6)
        assert set(station.texts) == {
            "Tag 2 (lynx) detected: 14.2 dB",
            "Tag 4000000 detected: at least 9.5 dB",
            "Tag 2 (lynx) detected again after 45 s: 11.5 dB",
        }
        assert named(station)[:2] == [("SNR_2", 14.23), ("CNT_2", 1.0)]
        assert ("SNR_2", 11.5) in named(station)
        assert {("SNR2DQF4", 9.5), ("CNT2DQF4", 1.0)} < set(named(station))


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
        listening(bay) as station,
        bay.ground_station(f"udpout://127.0.0.1:{wifi.port}", radio=False),
    ):
        await until(lambda: bay.process._link.tunnel._links == (1, 0))
        begin_flight(bay)
        hear(bay, 2, bay.clock.now_ns(), snr_db=14.25)
        await until(lambda: len(named(station)) == 2)
        assert named(station) == [("SNR_2", 14.25), ("CNT_2", 1.0)]


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
    async with bay.running(), listening(bay) as station:
        hear(bay, 2, start_ns, snr_db=9.0, after_s=3 * 1.254)
        await until(lambda: ("CNT_2", 3.0) in named(station))
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
