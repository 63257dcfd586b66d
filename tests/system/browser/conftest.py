"""Drones that a page commands."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from page_driver import Ground, Scene, Watched
from willing_drone import WillingDrone

from uavrt.drone.processes.connection_parts import ground_status


@pytest.fixture
def willing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., WillingDrone]]:
    """Start drones for ground stations at these ports; their processors have 51.5 °C."""
    zone = tmp_path / "thermal_zone"
    zone.write_text("51500\n")
    monkeypatch.setattr(ground_status, "THERMAL_ZONE", zone)
    drones: list[WillingDrone] = []

    def make(port: int, system_id: int = 1, **world: Any) -> WillingDrone:
        drones.append(WillingDrone(port, system_id, **world))
        return drones[-1]

    yield make
    for drone in drones:
        drone.close()


@pytest.fixture
def scene(
    tmp_path: Path,
    start_ground: Callable[..., Ground],
    watch: Callable[..., Watched],
    willing: Callable[..., WillingDrone],
) -> Scene:
    return Scene(tmp_path, start_ground, watch, willing)
