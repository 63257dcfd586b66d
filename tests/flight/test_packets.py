"""The thesis's packet experiment, flown for some seconds through a lossy radio."""

from pathlib import Path
from typing import Any

import pytest

from uavrt_experiments.packets.flight import fly


@pytest.mark.timeout(150)
def test_a_short_flight_through_a_lossy_radio_brings_every_pulse(tmp_path: Path) -> None:
    match: Any = fly(25.0, 0.012, loss=0.15, seed=4, flight_dir=tmp_path)
    assert match.sent > 10
    assert match.missing == ()
    assert match.repeated == 0
