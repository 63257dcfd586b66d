"""Orders that nobody takes over end by arrival; a takeover ends one at once.

Random orders in wind, through the motion handler and the frames of the link, with a simulated
PX4 or ArduCopter. ``UAVRT_FLIGHTS=1000`` sets the number of flights, ``UAVRT_TAKEOVERS=100``
the number of instants at which a pilot takes over.
"""

import os

import pytest
from campaigns import BEGUN, CROSSED, TAKEOVERS, WELL, ended, fault_of, takeover_fault

from uavrt.simulation.vehicle.airframe import Flavour

FLIGHTS = int(os.environ.get("UAVRT_FLIGHTS", "4"))
INSTANTS = int(os.environ.get("UAVRT_TAKEOVERS", "3"))
SHARES = {"survey": 1.0, "search": 0.6, "takeoff": 1.0, "rotation": 0.5}
"""Flights of each kind; a search takes the longest."""
BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])


@BOTH
@pytest.mark.parametrize("action", list(BEGUN))
@pytest.mark.timeout(36_000)
def test_an_order_that_nobody_takes_over_ends_by_arrival(flavour: Flavour, action: str) -> None:
    seeds = range(max(2, round(SHARES[action] * FLIGHTS)))
    faults = [fault_of(action, flavour, seed) for seed in seeds]
    assert not list(filter(None, faults))


@pytest.mark.parametrize("acceptance_m", [1.0, 1.5, 3.0])
def test_a_survey_ends_by_arrival_whatever_acceptance_radius_px4_has(
    acceptance_m: float,
) -> None:
    """The heading setpoint follows the bearing to this distance from the target."""
    reasons = []
    for seed in range(max(2, FLIGHTS // 3)):
        flown = BEGUN["survey"]("px4", seed)
        flown.vehicle.acceptance_m = acceptance_m
        reasons.append(ended(flown))
    assert set(reasons) <= set(WELL)


POSSIBLE: list[tuple[Flavour, str]] = [
    *(("px4", name) for name, (_, shown_s, _) in TAKEOVERS.items() if shown_s),
    *(("ardupilot", name) for name, (_, _, shown_s) in TAKEOVERS.items() if shown_s),
]


@pytest.mark.parametrize(("flavour", "name"), POSSIBLE)
@pytest.mark.timeout(36_000)
def test_no_command_follows_a_takeover(flavour: Flavour, name: str) -> None:
    results = [takeover_fault(name, flavour, seed) for seed in range(INSTANTS)]
    assert not [one for one in results if one not in (None, CROSSED)]


@pytest.mark.parametrize("seed", [27, 58])
def test_a_turn_that_begins_as_ours_ends_is_not_undone_by_our_next_command(seed: int) -> None:
    """PX4's setpoint had moved by less than 1° when the next heading was sent."""
    assert takeover_fault("turn at our target", "px4", seed) is None
