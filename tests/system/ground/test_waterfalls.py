"""Waterfalls of recorded and of live channels: the tone stands where it is."""

import asyncio
import base64
import json
import socket
from dataclasses import asdict
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from gapped import GAP_S, KINDS, write_gapped
from numpy.typing import NDArray
from recorded import START_NS, frames, write_recording
from websockets.asyncio.client import connect

from uavrt.core.clock import Clock
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.web.work.waterfalls import ChannelStream, recorded_picture
from uavrt.simulation.demo.demo_programs import free_udp_port

TAG = made.tag(2, 148_712_000.0, 1.2)


def cells_of(record: dict[str, Any]) -> NDArray[np.uint8]:
    """(columns, rows) of a picture."""
    cells = np.frombuffer(base64.b64decode(record["values"]), np.uint8)
    return cells.reshape(record["columns"], record["rows"])


@pytest.fixture
def flight_id(served: Any) -> str:
    keeper = FlightKeeper(served.directory, Clock.start())
    name = keeper.begin([TAG])
    keeper.close()
    return name


def test_a_pulse_stands_at_its_time_and_frequency(served: Any, flight_id: str) -> None:
    path = f"/api/flights/{flight_id}"
    assert served.ask("GET", f"{path}/recordings").json == []
    assert served.ask("GET", f"{path}/waterfall?tag=2").status == 404
    write_recording(served.directory / flight_id / "iq")
    assert served.ask("GET", f"{path}/recordings").json == ["band.sigmf-meta"]
    record = served.ask("GET", f"{path}/waterfall?tag=2&length_s=3").json
    cells = cells_of(record)
    column, row = np.unravel_index(int(cells.argmax()), cells.shape)
    time_s = (record["start_time_ns"] - START_NS) / 1e9 + column * record["column_s"]
    # A window is one and a half pulses long and stands at its start.
    assert time_s == pytest.approx(1.5, abs=0.03)
    step_hz = (record["high_hz"] - record["low_hz"]) / (record["rows"] - 1)
    assert record["low_hz"] + row * step_hz == pytest.approx(200.0, abs=2 * step_hz)
    assert np.median(cells) == pytest.approx(255 * 3 / 33, abs=2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_pulse_behind_a_gap_stands_at_its_time(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(4)
    rate_hz, start_ns = 48_000.0, 1_714_543_200_000_000_000
    samples = (rng.normal(size=(240_000, 2)) * 0.01).astype(np.float32).view(np.complex64)[:, 0]
    at = np.arange(round(4.0 * rate_hz), round(4.02 * rate_hz))
    samples[at] += (0.01 * np.exp(2j * np.pi * 200.0 * at / rate_hz)).astype(np.complex64)
    path = write_gapped(
        tmp_path / "band",
        samples,
        rate_hz=rate_hz,
        center_hz=TAG.frequency_hz,
        start_ns=start_ns,
        gap_s=(2.0, 2.0 + GAP_S),
        kind=kind,
    )
    picture = recorded_picture(path, TAG, 0.0, 60.0)
    cells = cells_of(asdict(picture))
    column = int(np.unravel_index(int(cells.argmax()), cells.shape)[0])
    time_s = (picture.start_time_ns - start_ns) / 1e9 + column * picture.column_s
    assert time_s == pytest.approx(4.0, abs=0.03)


def test_only_the_stretch_that_was_asked_for_is_drawn(served: Any, flight_id: str) -> None:
    write_recording(served.directory / flight_id / "iq")
    path = f"/api/flights/{flight_id}/waterfall?tag=2"
    record = served.ask("GET", f"{path}&start_s=0.2&length_s=1").json
    # Blocks of the recording are 0.17 s long; the stretch holds whole ones.
    assert record["columns"] * record["column_s"] < 1.6
    assert cells_of(record).max() < 200
    assert served.ask("GET", f"{path}&start_s=100").status == 422


def test_what_cannot_be_drawn_is_said(served: Any, flight_id: str) -> None:
    write_recording(served.directory / flight_id / "iq", 0.2)
    for query in ("", "tag=x", "tag=4", "tag=2&start_s=nan", "tag=-1"):
        answer = served.ask("GET", f"/api/flights/{flight_id}/waterfall?{query}")
        assert answer.status in (404, 422), query
        assert answer.json["error"], query


def test_a_live_channel_is_drawn_as_it_comes() -> None:
    records: list[dict[str, Any]] = []
    stream = ChannelStream(records.append)
    stream.receive(b"nonsense")
    for payload in frames(600.0, 4):
        stream.receive(payload)
    assert stream.refused == 1
    assert len(records) == 4
    for record in records:
        strongest = int(cells_of(record).mean(axis=0).argmax())
        step_hz = (record["high_hz"] - record["low_hz"]) / (record["rows"] - 1)
        assert record["low_hz"] + strongest * step_hz == pytest.approx(600.0, abs=step_hz)
        assert record["columns"] * record["column_s"] == pytest.approx(1024 / 3750.0)


def test_listeners_get_the_live_channel(served: Any) -> None:
    port = free_udp_port()

    async def listen() -> dict[str, Any]:
        async with connect(f"ws://127.0.0.1:{served.port}/api/records") as sock:
            await sock.recv()
            wanted = {"address": f"udp://127.0.0.1:{port}"}
            answer = await asyncio.to_thread(served.ask, "POST", "/api/waterfall", wanted)
            assert answer.json == wanted
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.connect(("127.0.0.1", port))
                for payload in frames(0.0, 3):
                    sender.send(payload)
            while True:
                message: dict[str, Any] = json.loads(await sock.recv())
                if message["topic"] == "waterfall":
                    return message

    async def bounded() -> dict[str, Any]:
        return await asyncio.wait_for(listen(), 60.0)

    assert asyncio.run(bounded())["record"]["columns"] > 0
    assert served.ask("POST", "/api/waterfall", {"address": ""}).json == {"address": None}
    wrong = served.ask("POST", "/api/waterfall", {"address": "file:///etc/passwd"})
    assert wrong.status == 422
