"""Whatever happens in whatever order: nothing moves the drone without a present confirmation.

``UAVRT_DEPTH=12`` explores as deep as the promise names.
"""

import os

import pytest
from authority_world import EVENTS, KEYS, World
from explored import explore

from uavrt.simulation.flying import Flavour

DEPTH = int(os.environ.get("UAVRT_DEPTH", "6"))


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
@pytest.mark.timeout(1800)
def test_no_interleaving_moves_the_drone_unconfirmed_and_take_back_always_works(
    flavour: Flavour,
) -> None:
    start = World(flavour)
    start.beat()
    counts = explore(start, tuple(EVENTS), DEPTH, KEYS)
    print(f"{flavour}, depth {DEPTH}: {dict(counts)}")
    for standing in ("out", "confirmed", "in command"):
        assert counts[standing] > 20, counts
