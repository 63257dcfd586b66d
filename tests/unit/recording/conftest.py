"""Makers of `numbered` as fixtures."""

from collections.abc import Callable
from pathlib import Path

import numbered
import pytest

from uavrt.messages import FlightInfo, Pose, Pulse, PulsePose


@pytest.fixture
def make_pulse() -> Callable[..., Pulse]:
    return numbered.pulse


@pytest.fixture
def make_pose() -> Callable[..., Pose]:
    return numbered.pose


@pytest.fixture
def make_pulse_pose() -> Callable[..., PulsePose]:
    return numbered.pulse_pose


@pytest.fixture
def make_info(tmp_path: Path) -> Callable[[], FlightInfo]:
    return lambda: numbered.info(tmp_path / "flight_log_2023-11-17_07-16-59")
