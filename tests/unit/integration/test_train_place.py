"""Regions of where a tag is, when the fall with distance is not known."""

from dataclasses import replace

import numpy as np

from uavrt.integration.train_place import Cells
from uavrt_experiments.integrate.flights import PLANE
from uavrt_experiments.integrate.several import fly_past, worlds


def test_a_region_holds_for_each_fall_with_distance() -> None:
    # A fall of a tenth of the belief puts the tag to the west, the others to the east.
    by_fall = np.array([[0.96, 0.02, 0.02], [0.02, 0.02, 0.96]])
    cells = Cells(
        plane=PLANE,
        bearing_deg=np.array([270.0, 0.0, 90.0]),
        range_m=np.full(3, 1000.0),
        width_deg=np.full(3, 5.0),
        ratio=np.full(3, 1.1),
        probability=np.array([0.1, 0.9]) @ by_fall,
        by_fall=by_fall,
    )
    assert cells.region(0.85).tolist() == [True, False, True]
    assert cells.holds(-1000.0, 0.0, 0.85)


def test_a_strong_tag_as_far_from_both_flights_is_placed() -> None:
    """Where it may be, distances are alike; elsewhere on the ground they are not."""
    each = tuple(
        replace(one, course=replace(one.course, tag_at=lambda _: (0.0, 1640.0)))
        for one in worlds(2, 1000.0)
    )
    flown = fly_past(np.random.default_rng((1, 1)), each, 26.0)
    assert flown.found
    assert flown.off_m is not None
    assert flown.off_m < 200.0
