"""The operating mode of the settings reaches the detectors of a flight in every shape."""

import sqlite3
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest
from until import until

from uavrt.config.settings import DetectionSettings, Shape
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.logs.detector_configs import read_detector_config

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


def test_a_flight_of_each_shape_searches_in_the_mode_of_its_settings_and_says_so(
    drone_bay: Any, thesis_scenario: Any
) -> None:
    (true_tag,) = thesis_scenario.tags
    tags = [replace(true_tag, frequency_hz=true_tag.frequency_hz - BESIDE_HZ)]
    shapes: tuple[Shape, ...] = get_args(Shape)
    drones = [
        drone_bay.launch(
            thesis_scenario,
            tags=tags,
            detection=DetectionSettings(shape=shape, operating_mode="freqAllNeverLock"),
        )
        for shape in shapes
    ]
    for drone in drones:
        flights = drone.directory / "flights"
        until(lambda: len(pulses_at_hz(flights)) >= 4, 60.0)  # noqa: B023 - called at once
        assert pulses_at_hz(flights)[-1] == pytest.approx(true_tag.frequency_hz, abs=30.0)
        (directory,) = flights.glob("flight_log_*")
        config = read_detector_config(FlightLayout(directory).tag_config(true_tag.tag_id))
        assert config.operating_mode == "freqAllNeverLock"
