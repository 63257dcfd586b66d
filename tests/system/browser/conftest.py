"""Drones that a page commands."""

from collections.abc import Callable, Iterator

import pytest
from willing_drone import WillingDrone


@pytest.fixture
def willing() -> Iterator[Callable[..., WillingDrone]]:
    drones: list[WillingDrone] = []

    def make(port: int, system_id: int = 1) -> WillingDrone:
        drones.append(WillingDrone(port, system_id))
        return drones[-1]

    yield make
    for drone in drones:
        drone.close()
