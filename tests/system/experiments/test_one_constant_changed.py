"""A constant of the estimators is changed for one run, and other figures stay as they are."""

from uavrt_experiments.localization.sensitivity import compared


def test_a_constant_moves_the_figures_that_depend_on_it_alone() -> None:
    assert list(compared("L5", 3, "BEARING_FIX.andrews*1.3")) == ["0 of 2 figures change"]
    *moved, count = compared("L5", 3, "GRID.bearing_range_m*0.2")
    assert any("bearings: median [m]" in one for one in moved)
    assert count == f"{len(moved)} of 2 figures change"
