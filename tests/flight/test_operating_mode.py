"""The operating mode of the settings reaches the detectors of a flight in every shape."""

import sqlite3
import time
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from uavrt.config.settings import DetectionSettings, Shape
from uavrt.recording import FlightLayout, read_detector_config

pytestmark = pytest.mark.timeout(90)

BESIDE_HZ = 700.0
"""Beyond the window of the search: only the mode that takes the whole channel hears the tag."""


def pulses_at_hz(flights: Path) -> list[float]:
    found: list[float] = []
    for database in flights.rglob("flight.sqlite"):
        with (
            closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection,
            suppress(sqlite3.OperationalError),  # its tables are being made
        ):
            found += [hz for (hz,) in connection.execute("SELECT frequency_hz FROM pulses")]
    return found


@pytest.mark.parametrize("shape", ["workers", "stages", "one"])
def test_a_flight_searches_in_the_mode_of_its_settings_and_says_so(
    drone_bay: Any, thesis_scenario: Any, shape: Shape
) -> None:
    (true_tag,) = thesis_scenario.tags
    tags = [replace(true_tag, frequency_hz=true_tag.frequency_hz - BESIDE_HZ)]
    drone = drone_bay.launch(
        thesis_scenario,
        msgspec.json.encode(tags).decode(),
        detection=DetectionSettings(shape=shape, operating_mode="freqAllNeverLock"),
    )
    flights = drone.directory / "flights"
    deadline_s = time.monotonic() + 60.0
    while len(heard := pulses_at_hz(flights)) < 4:
        assert time.monotonic() < deadline_s
        time.sleep(0.5)
    assert heard[-1] == pytest.approx(true_tag.frequency_hz, abs=30.0)
    (directory,) = flights.glob("flight_log_*")
    config = read_detector_config(FlightLayout(directory).tag_config(true_tag.tag_id))
    assert config.operating_mode == "freqAllNeverLock"
