"""Raw capture and gain, commanded from the ground while the real processes run."""

import contextlib
import json
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from listening import linked
from until import until_async as until

from uavrt.core.commands import CommandId, SystemState
from uavrt.core.errors import CommandRefused
from uavrt.core.messages import PulsePose, StatusText
from uavrt.drone.supervisor.start.usage import descendants_of
from uavrt.ground.link.protocol import DroneHeartbeat, GroundEvent, OperationStep
from uavrt.link.mavlink.sending.signing import read_signing_key
from uavrt.link.tunnel.generations.g2 import COMPLETE
from uavrt.link.tunnel.own_messages.seal import read_key
from uavrt.simulation.scene.scenario import Scenario

CAPTURE_S = 1.0


class Operator:
    """What a ground station of ours has received."""

    def __init__(self) -> None:
        self.heard: list[GroundEvent] = []

    @property
    def state(self) -> SystemState | None:
        states = [event.state for event in self.heard if isinstance(event, DroneHeartbeat)]
        return states[-1] if states else None

    def steps(self, command: CommandId) -> list[int]:
        """States of a command's operation, each once."""
        steps = [event for event in self.heard if isinstance(event, OperationStep)]
        states = [step.state for step in steps if step.command == command]
        return [state for state, _ in groupby(states)]

    def texts(self) -> list[str]:
        return [event.text for event in self.heard if isinstance(event, StatusText)]


def radio_arguments(pid: int) -> list[list[str]]:
    """Command lines of the running radio programs."""
    found = []
    for child in descendants_of(pid):
        with contextlib.suppress(OSError):
            line = Path(f"/proc/{child}/cmdline").read_bytes().decode().split("\0")
            if "-f" in line and "-h" in line:
                found.append(line)
    return found


@pytest.mark.timeout(240)
async def test_a_raw_capture_and_a_gain_set_in_flight_by_a_ground_station_with_keys(
    drone_bay: Any, thesis_scenario: Scenario, tmp_path: Path
) -> None:
    key = tmp_path / "key"
    key.write_text("5a" * 32)
    key.chmod(0o600)
    drone = drone_bay.launch(
        thesis_scenario,
        autopilot_options=("--flavour", "ardupilot"),
        recording=lambda usual: replace(usual, capture_s=CAPTURE_S, minimum_free_mb=1.0),
        mavlink=lambda usual: replace(
            usual,
            key_file=str(key),
            signing_key_file=str(key),
            tunnel_generation="G2",
            tunnel_experimental=True,
        ),
    )
    operator = Operator()
    keys = {"key": read_key(key), "signing_key": read_signing_key(key)}
    async with linked(
        drone.ground_port, on_event=operator.heard.append, generation="G2", **keys
    ) as link:
        told = (await link.command(link.writing.start(148_705_000.0, 9, "raw_capture"))).message
        with pytest.raises(CommandRefused, match="capturing: wait"):
            await link.ask("clean_logs")
        await until(
            lambda: any("Raw capture: 1.0 of 1 s in" in text for text in operator.texts())
        )
        await until(lambda: operator.state is SystemState.IDLE)
        # The operation's last step comes in a message of its own.
        await until(lambda: operator.steps(CommandId.RAW_CAPTURE)[-1] == COMPLETE)
        check_capture(Path(drone.settings.recording.directory), told)
        await link.upload_tags(drone.scenario.tags)
        await link.start_detection(gain=12)
        pid = drone.supervisor.pid
        await until(lambda: any("12" in line for line in radio_arguments(pid)))
        await until(lambda: COMPLETE in operator.steps(CommandId.START_DETECTION))
        assert await link.parameters.set("RADIO_GAIN", 7) == 7
        await until(lambda: any("7" in line for line in radio_arguments(pid)))
        with pytest.raises(CommandRefused, match="is still 7"):
            await link.parameters.set("RADIO_GAIN", 77)
        await until(lambda: any(isinstance(event, PulsePose) for event in operator.heard))
        await until(lambda: any(text.startswith("Tag ") for text in operator.texts()))
        assert (await link.parameters.list_all())["DET_RUN"] == 1
        assert await link.parameters.set("DET_RUN", 0) == 0
        await until(lambda: "Detection stopped" in operator.texts())
        await link.stop_detection()  # repeated
    assert link.contact.refused == {}


def check_capture(flights: Path, told: str) -> None:
    (directory,) = flights.glob("flight_log_*")
    assert str(directory).endswith(told.removeprefix("…"))  # what fits into the answer
    data = directory / "iq" / "capture_1.sigmf-data"
    meta = json.loads((directory / "iq" / "capture_1.sigmf-meta").read_text())
    rate_hz = meta["global"]["core:sample_rate"]
    samples = np.fromfile(data, dtype="<i2")
    assert len(samples) == 2 * round(CAPTURE_S * rate_hz)
    assert np.abs(samples).max() > 0
    assert meta["captures"][0]["core:frequency"] == 148_705_000
