"""Raw capture and gain, commanded from the ground while the real processes run."""

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uavrt import tunnel
from uavrt.clock import Clock
from uavrt.config.settings import RecordingSettings
from uavrt.errors import CommandRefused
from uavrt.ground.link import GroundLink
from uavrt.ground.protocol import DroneHeartbeat, GroundEvent
from uavrt.mavlink import dialect
from uavrt.messages import StatusText, SystemState
from uavrt.simulation.scenario import Scenario
from uavrt.supervisor.usage import children_of

CAPTURE_S = 1.0


class Operator:
    """A ground station of ours, and what it has heard."""

    def __init__(self) -> None:
        self.heard: list[GroundEvent] = []
        self.link = GroundLink(Clock.start().now_ns, on_event=self.heard.append)

    @contextlib.asynccontextmanager
    async def connected(self, port: int) -> AsyncIterator[GroundLink]:
        task = asyncio.create_task(self.link.run(f"udpin://127.0.0.1:{port}"))
        try:
            await self.link.wait_for_drone(40.0)
            yield self.link
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    @property
    def state(self) -> SystemState | None:
        states = [event.state for event in self.heard if isinstance(event, DroneHeartbeat)]
        return states[-1] if states else None

    def texts(self) -> list[str]:
        return [event.text for event in self.heard if isinstance(event, StatusText)]


async def until(condition: Callable[[], object], timeout_s: float = 60.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not condition():  # noqa: ASYNC110 - any condition, not one object's
            await asyncio.sleep(0.05)


def radio_arguments(pid: int) -> list[list[str]]:
    """Command lines of the running radio programs."""
    found, waiting = [], [pid]
    while waiting:
        child = waiting.pop()
        waiting += children_of(child)
        with contextlib.suppress(OSError):
            line = Path(f"/proc/{child}/cmdline").read_bytes().decode().split("\0")
            if "-f" in line and "-h" in line:
                found.append(line)
    return found


def parameter_set(name: str, value: float) -> dialect.ParamSet:
    return dialect.ParamSet(
        target_system=1, target_component=191, param_id=name, param_value=value, param_type=9
    )


@pytest.mark.flight
@pytest.mark.timeout(240)
def test_a_raw_capture_and_a_gain_set_in_flight(
    drone_bay: Any, thesis_scenario: Scenario, tmp_path: Path
) -> None:
    recording = RecordingSettings(
        directory=str(tmp_path / "drone1" / "flights"),
        capture_s=CAPTURE_S,
        minimum_free_mb=1.0,
    )
    drone = drone_bay.launch(thesis_scenario, recording=recording)
    operator = Operator()

    async def main() -> None:
        async with operator.connected(drone.ground_port) as link:
            capture = tunnel.RawCapture(gain=9, frequency_hz=148_705_000).encode()
            directory = Path((await link.command(capture)).message)
            with pytest.raises(CommandRefused, match="capturing: wait"):
                await link.command(tunnel.HeaderMessage(command=tunnel.CommandId.CLEAN_LOGS).encode())
            await until(lambda: any("Raw capture in" in text for text in operator.texts()))
            await until(lambda: operator.state is SystemState.IDLE)
            check_capture(directory)
            tags = drone.scenario.tags
            await link.upload_tags(tags)
            await link.start_detection(gain=12)
            pid = drone.supervisor.pid
            await until(lambda: any("12" in line for line in radio_arguments(pid)))
            link.send(parameter_set("RADIO_GAIN", 7.0))
            await until(lambda: any("7" in line for line in radio_arguments(pid)))
            link.send(parameter_set("RADIO_GAIN", 77.0))
            await until(lambda: any("cannot be 77" in text for text in operator.texts()))
            await link.stop_detection()

    asyncio.run(main())


def check_capture(directory: Path) -> None:
    data = directory / "iq" / "capture_1.sigmf-data"
    meta = json.loads((directory / "iq" / "capture_1.sigmf-meta").read_text())
    rate_hz = meta["global"]["core:sample_rate"]
    samples = np.fromfile(data, dtype="<i2")
    assert len(samples) == 2 * round(CAPTURE_S * rate_hz)
    assert np.abs(samples).max() > 0
    assert meta["captures"][0]["core:frequency"] == 148_705_000
