"""The band recorded while detecting, searched again after the flight."""

import time
from pathlib import Path
from typing import Any

import msgspec
import pytest
import sigmf
from command_line import started

from uavrt.config.settings import RecordingSettings
from uavrt.recording import read_flight


@pytest.mark.timeout(150)
def test_a_flight_that_records_its_band_is_found_again_pulse_by_pulse(
    drone_bay: Any, thesis_scenario: Any, tmp_path: Path
) -> None:
    tags = msgspec.json.encode(thesis_scenario.tags).decode()
    flights = tmp_path / "flights"
    drone = drone_bay.launch(
        thesis_scenario,
        tags,
        recording=RecordingSettings(directory=str(flights), iq=True),
    )
    deadline_s = time.monotonic() + 60.0
    recorded = 0.0
    while recorded < 6 and time.monotonic() < deadline_s:
        for topic, record in drone.status.read(0.5):
            if topic == "system_status":
                counters = {p.process: p.counters for p in record.processes}
                recorded = counters.get("recorder", {}).get("pulses_recorded", 0.0)
    drone.supervisor.stop()
    (directory,) = flights.glob("flight_log_*")
    before = read_flight(directory)
    (metadata,) = directory.glob("iq/*.sigmf-meta")
    recording = sigmf.fromfile(str(metadata))
    recording.validate()
    assert recording.get_global_field("core:datatype") == "ci16_le"
    assert recording.sample_count > 6 * 375_000

    again = flights / "again"
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
