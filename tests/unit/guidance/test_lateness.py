"""What comes late is old, however new it looks: nothing is commanded by it."""

import random

import pytest
from flown import Flown
from rough import Rough

from uavrt.core.errors import CommandRefused
from uavrt.guidance.control.authority import ControlStage
from uavrt.guidance.control.lateness import ReportDelay
from uavrt.guidance.control.observed import BootTimeReport
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt.simulation.vehicle.simulated_flying import MODES

BOTH = pytest.mark.parametrize("flavour", ["px4", "ardupilot"])


def behind(flavour: Flavour, late_s: float, phase_s: float = 0.0) -> Flown:
    """One whose link has become so late."""
    flown = Flown(flavour, phase_s=phase_s)
    flown.through = Rough(random.Random(1), late_s=late_s)
    flown.run(late_s + 2.5)
    return flown


@BOTH
@pytest.mark.parametrize("late_s", [0.3, 0.6, 1.0, 1.8])
def test_nothing_is_confirmed_over_a_link_that_tells_late(
    flavour: Flavour, late_s: float
) -> None:
    flown = behind(flavour, late_s)
    with pytest.raises(CommandRefused, match=f"messages arrive {late_s} s late"):
        flown.order("goto", places=(flown.place(100.0, 0.0),), height_m=40.0)


@BOTH
def test_a_return_is_never_undone_by_a_command_on_news_of_long_ago(flavour: Flavour) -> None:
    """The link becomes late between the confirmation and the first command."""
    for seed in range(40):
        flown = Flown(flavour, phase_s=seed * 0.37)
        flown.order("goto", places=(flown.place(100.0, 0.0),), height_m=40.0)
        execution, flown.execution = flown.execution, None
        flown.through = Rough(random.Random(seed), late_s=random.Random(seed).uniform(0.4, 1.8))
        flown.run(0.5 + 0.05 * (seed % 10))
        flown.vehicle.set_mode(MODES[flavour]["return"])
        flown.execution = execution
        flown.run(3.0)
        assert not flown.commands
        assert flown.vehicle.mode == MODES[flavour]["return"]


@BOTH
def test_a_link_a_tenth_of_a_second_late_is_flown_over(flavour: Flavour) -> None:
    flown = behind(flavour, 0.1)
    execution = flown.order("goto", places=(flown.place(60.0, 0.0),), height_m=40.0)
    flown.run(60.0, until=lambda: execution.ended is not None)
    assert execution.ended == "done"


@BOTH
def test_the_operator_reads_why_an_order_was_not_begun(flavour: Flavour) -> None:
    flown = Flown(flavour)
    flown.order("goto", places=(flown.place(100.0, 0.0),), height_m=40.0)
    flown.execution = None
    flown.through = Rough(random.Random(1), late_s=0.6)
    flown.run(10.5)
    assert flown.authority.reason == (
        "the order did not begin within 10 s: the autopilot's messages arrive 0.6 s late"
    )


@BOTH
def test_what_was_overtaken_on_its_way_neither_ends_an_order_nor_is_where_it_is(
    flavour: Flavour,
) -> None:
    ended = 0
    for seed in range(20):
        flown = Flown(flavour, phase_s=seed * 0.7)
        flown.through = Rough(random.Random(seed), jitter_s=0.15, doubled=0.1)
        flown.run(1.0)
        corners = ((40, 10), (45, 60), (80, 55), (85, 5))
        places = tuple(flown.place(*corner) for corner in corners)
        flown.order("survey", places=places, spacing_m=20.0, height_m=40.0)
        flown.run(40.0)
        ended += flown.authority.standing is ControlStage.OUT
    assert ended <= 2


def told(
    lateness: ReportDelay, boot_s: float, after_s: float, late_s: float | None = None
) -> None:
    lateness.observe(BootTimeReport(1000.0 + boot_s + after_s, boot_s, late_s))


def test_without_timesync_the_quickest_message_was_in_time() -> None:
    lateness = ReportDelay()
    told(lateness, 10.0, 0.30)
    told(lateness, 11.0, 0.02)
    assert lateness.fault is None
    told(lateness, 12.0, 0.15)
    assert lateness.fault is None
    told(lateness, 13.0, 0.50)
    assert lateness.fault == "the autopilot's messages arrive 0.5 s late"
    told(lateness, 14.0, 0.05)
    assert lateness.fault is None


def test_clocks_that_part_by_as_much_as_crystals_do_are_not_late() -> None:
    lateness = ReportDelay()
    for second in range(0, 40_000, 10):
        told(lateness, float(second), 1.5e-4 * second)
        assert lateness.fault is None
    told(lateness, 40_000.0, 6.4)
    assert lateness.fault is not None


def test_timesync_knows_of_a_link_that_was_late_from_the_beginning() -> None:
    lateness = ReportDelay()
    told(lateness, 10.0, 0.9, late_s=0.9)
    assert lateness.fault == "the autopilot's messages arrive 0.9 s late"
    told(lateness, 11.0, 14.0, late_s=0.05)
    assert lateness.fault is None
