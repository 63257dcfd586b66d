"""A flight of two tags for the tests of recordings."""

from pathlib import Path

import numbered
import pytest

from uavrt.core.messages import FlightInfo


@pytest.fixture
def info(tmp_path: Path) -> FlightInfo:
    return numbered.info(tmp_path / "flight_log_2023-11-17_07-16-59")
