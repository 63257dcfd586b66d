"""Our parameters and metadata, read and set by programs that nobody here wrote."""

import asyncio
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.clock import Clock
from uavrt.config.parameters import OFFERED, RUN, parameter_values
from uavrt.config.settings import MavlinkSettings, RecordingSettings, Settings
from uavrt.mavlink import Connection, Handlers, Peer, Priority
from uavrt.mavlink.component import ParameterEncoding
from uavrt.mavlink.dialect import MavParamType
from uavrt.mavlink.frame import FrameParser, FrameWriter
from uavrt.mavlink.ftp_files import FileTree
from uavrt.mavlink.ftp_server import FileServer
from uavrt.mavlink.message import Message
from uavrt.mavlink.metadata import component_metadata
from uavrt.mavlink.parameters import Requests, decode_value, encode_value
from uavrt.messages import CommandReply, StatusText
from uavrt.processes.parameter_desk import ParameterDesk
from uavrt.supervisor.mission.orders import Mission
from uavrt.supervisor.mission.saved_state import StateStore


class ParameterDrone:
    """The connection process's parameters with the supervisor's mission behind them."""

    def __init__(
        self,
        clock: Clock,
        directory: Path,
        send: Callable[[Message], None] | None = None,
        encoding: ParameterEncoding = "auto",
    ) -> None:
        self.texts: list[StatusText] = []
        self.replies: list[CommandReply] = []
        self._clock = clock
        self._number = 0
        self.refusal: str | None = None
        self.connection = Connection(
            Handlers(
                attitude=lambda _: None,
                position=lambda _: None,
                tunnel=lambda _payload, _peer: None,
                ftp=self._ftp,
                parameters=self._request,
            ),
            clock.now_ns,
            parameter_encoding=encoding,
        )
        metadata = component_metadata()
        self.connection.component.metadata = metadata
        wake = self.connection.tunnel.wake
        self._files = FileServer(FileTree(directory, metadata.files), wake)
        self.connection.tunnel.add_source(self._files, Priority.FILE)
        settings = Settings(
            recording=RecordingSettings(directory=str(directory)),
            mavlink=MavlinkSettings(parameter_encoding=encoding),
        )
        self.mission = Mission(
            settings,
            StateStore(directory),
            tell=lambda _severity, _text: None,
            on_start=lambda _flight: None,
            on_stop=lambda: None,
            on_settings=lambda changed: self._desk.changed(changed),
        )
        self._desk = ParameterDesk(
            self.mission.settings,
            lambda: self.connection.component.parameters_bytewise,
            send=lambda value, _asker: (send or self.connection.tunnel.send_message)(value),
            ask=lambda command: self._answer(self.mission.command(command)),
            tell=self.texts.append,
        )

    @property
    def values(self) -> dict[str, float]:
        return {**parameter_values(self.mission.settings), RUN.name: 0.0}

    async def tick(self) -> None:
        while True:
            self._files.work()
            self.connection.tunnel.wake()
            await asyncio.sleep(0.02)

    def _answer(self, reply: CommandReply) -> None:
        self.replies.append(reply)
        self._desk.reply(reply)

    def _request(self, message: Requests, peer: Peer) -> None:
        self._number += 1
        self._desk.receive(message, peer, self.refusal, self._number)

    def _ftp(self, payload: bytes, peer: Peer) -> None:
        self._files.receive(payload, peer, self._clock.now_ns())


class PymavlinkStation:
    """A ground station of pymavlink's encoder and decoder on a link of ours."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("MAVLINK20", "1")
        from pymavlink.dialects.v20 import ardupilotmega

        self.dialect = ardupilotmega
        self.mav = ardupilotmega.MAVLink(None, srcSystem=255, srcComponent=190)
        self.heard: list[Any] = []

    def take(self, data: bytes) -> None:
        self.heard += self.mav.parse_buffer(data) or []

    def values(self) -> dict[str, float]:
        """Values as pymavlink understands them with bytewise encoding."""
        found = {}
        for message in self.heard:
            if message.get_type() == "PARAM_VALUE":
                raw = struct.pack("<f", message.param_value)
                whole = message.param_type == self.dialect.MAV_PARAM_TYPE_INT32
                found[message.param_id] = struct.unpack("<i" if whole else "<f", raw)[0]
        return found


def test_pymavlink_sets_a_parameter_bytewise_and_hears_why_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    station = PymavlinkStation(monkeypatch)
    sent: list[Message] = []
    drone = ParameterDrone(Clock.start(), tmp_path, sent.append)
    now_ns = 10**9
    component = drone.connection.component
    component.tick(now_ns)

    def say(message: Any) -> None:
        for frame in FrameParser().feed(message.pack(station.mav)):
            component.receive(frame, now_ns)

    writer = FrameWriter(1, 191)

    def heard() -> dict[str, float]:
        station.heard.clear()
        for message in sent:
            station.take(writer.encode(message))
        sent.clear()
        return station.values()

    say(station.mav.param_request_list_encode(1, 0))
    assert heard() == pytest.approx(drone.values)
    assert [m.param_index for m in station.heard] == list(range(len(OFFERED)))
    say(station.mav.param_request_read_encode(1, 191, b"DET_K", -1))
    assert heard() == {"DET_K": 0}
    say(station.mav.param_request_read_encode(1, 191, b"", 0))
    assert heard() == {"RADIO_GAIN": -1}
    say(station.mav.param_request_read_encode(1, 191, b"SYSID_THISMAV", -1))
    say(station.mav.param_request_read_encode(1, 191, b"", 99))
    assert heard() == {}
    twelve = struct.unpack("<f", struct.pack("<i", 12))[0]
    say(station.mav.param_set_encode(1, 191, b"RADIO_GAIN", twelve, 6))
    assert heard() == {"RADIO_GAIN": 12}
    forty = struct.unpack("<f", struct.pack("<i", 40))[0]
    say(station.mav.param_set_encode(1, 191, b"RADIO_GAIN", forty, 6))
    assert heard() == {"RADIO_GAIN": 12}
    assert drone.texts[-1].text == "RADIO_GAIN cannot be 40: whole, 0 to 21, or -1"
    drone.refusal = "system 255 may not command"
    say(station.mav.param_set_encode(1, 191, b"RADIO_GAIN", twelve, 6))
    say(station.mav.param_set_encode(1, 191, b"DET_WINDOW_HZ", float("nan"), 9))
    assert heard() == {"RADIO_GAIN": 12, "DET_WINDOW_HZ": 500}
    assert drone.texts[-1].text == drone.refusal
    assert len(drone.replies) == 2


@given(st.integers(-(2**22), 2**23), st.booleans())
def test_a_whole_number_comes_back_in_either_encoding(value: int, bytewise: bool) -> None:
    field = encode_value(float(value), MavParamType.INT32, bytewise)
    wire = struct.unpack("<f", struct.pack("<f", field))[0]
    assert decode_value(wire, MavParamType.INT32, bytewise) == value


@pytest.mark.parametrize("kind", [MavParamType.INT64, MavParamType.REAL64, 77])
def test_a_type_that_does_not_fit_the_field_is_no_value(kind: int) -> None:
    assert decode_value(1.0, kind, bytewise=True) is None
