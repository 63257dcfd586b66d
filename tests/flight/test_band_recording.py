"""The band recorded while detecting, searched again after the flight; a channel by UDP."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sigmf
from command_line import started
from tests.flight.conftest import process
from tests.system.cli.test_original_halves import detect, ended
from until import until

from uavrt.config.settings import RecordingSettings, UdpChannelSettings
from uavrt.flight.logs.detector_configs import read_detector_config
from uavrt.flight.reading.flight_reader import read_flight


@pytest.mark.timeout(150)
def test_a_flight_that_records_its_band_is_found_again_and_feeds_a_detector_by_udp(
    drone_bay: Any, thesis_scenario: Any, tmp_path: Path
) -> None:
    flights, output = tmp_path / "flights", tmp_path / "pulses.jsonl"
    drone = drone_bay.launch(
        thesis_scenario,
        tags=thesis_scenario.tags,
        recording=RecordingSettings(directory=str(flights), iq=True),
        udp_channels=UdpChannelSettings(enabled=True),
    )
    until(lambda: list(flights.rglob("detectorConfig.txt")), 60.0)
    (found,) = flights.rglob("detectorConfig.txt")
    port = read_detector_config(found).data_port
    remote = detect(f"udp://127.0.0.1:{port}", "--tags", str(found), "-o", str(output))
    drone.status_when(
        lambda status: (
            process(status, "recorder").counters.get("pulses_recorded", 0.0) >= 6
            and output.exists()
            and len(output.read_text().splitlines()) >= 4
        )
    )
    said = ended(remote)
    check_udp_pulses(output.read_text().splitlines(), said)
    drone.end()
    (directory,) = flights.glob("flight_log_*")
    assert found.is_relative_to(directory)
    check_found_again(directory, flights / "again")


def check_udp_pulses(lines: list[str], said: str) -> None:
    assert " 0 samples lost" in said
    pulses = [json.loads(line) for line in lines]
    assert {pulse["tag_id"] for pulse in pulses} == {2}
    starts_s = np.array([pulse["start_time_ns"] for pulse in pulses], np.int64) * 1e-9
    steps = np.diff(np.sort(starts_s)) / 1.254
    assert np.abs(steps - np.round(steps)).max() < 0.05


def check_found_again(directory: Path, again: Path) -> None:
    """Pulse by pulse, in the recording of the band."""
    before = read_flight(directory)
    (metadata,) = directory.glob("iq/*.sigmf-meta")
    recording = sigmf.fromfile(str(metadata))
    recording.validate()
    assert recording.get_global_field("core:datatype") == "ci16_le"
    assert recording.sample_count > 6 * 375_000

    started("detect", metadata, "--flight", directory, "-o", again, check=True, timeout=60)
    after = read_flight(again)
    times = sorted(item.pulse.start_time_ns for item in after.pulse_poses)
    # In flight the clock settles within seconds; the recording gets it as it was in the end.
    off_ms = [
        min(abs(item.pulse.start_time_ns - other) for other in times) * 1e-6
        for item in before.pulse_poses
    ]
    assert len(off_ms) >= 6
    assert max(off_ms) < 20.0, off_ms
    assert all(item.pose is not None for item in after.pulse_poses)
