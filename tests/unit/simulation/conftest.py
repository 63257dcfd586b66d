from collections.abc import Callable
from dataclasses import replace
from typing import Any

import made
import pytest

from uavrt.simulation import Antenna, Flight, Propagation, Radio, Scenario, SimulatedTag

type_of_maker = Callable[..., Scenario]


@pytest.fixture
def plain_tag() -> SimulatedTag:
    """100 m north of home, received with a calculable level."""
    return made.simulated_tag(
        1, 150_001_000.0, 1.0, north_m=100.0, height_m=30.0, erp_dbm=-80.0
    )


@pytest.fixture
def make_scenario(plain_tag: SimulatedTag) -> type_of_maker:
    """A drone at rest 30 m above home, no reflections, no fading, 48 kS/s."""

    def make(**changes: Any) -> Scenario:
        scenario = Scenario(
            seed=5,
            radio=Radio(sample_rate_hz=48_000.0, center_frequency_hz=150e6, dc_offset=0.0),
            antenna=Antenna(pattern="isotropic", gain_dbi=0.0, polarization="any"),
            propagation=Propagation(),
            tag=(plain_tag,),
            flight=Flight(height_m=30.0, wobble_deg=0.0),
        )
        return replace(scenario, **changes)

    return make
