"""The rotation test in short form: what poses and walls do to the figures."""

from pathlib import Path

import made
import numpy as np
import pytest
from some import some

from uavrt.core.earth.attitude import yaw_deg
from uavrt_experiments.rotation import words
from uavrt_experiments.rotation.cart import BEARING_DEG, Cart, original_samples, with_poses
from uavrt_experiments.rotation.figures import rotation_page
from uavrt_experiments.rotation.original_pose import original_poses
from uavrt_experiments.rotation.reading import doubled, read_turn, wrapped
from uavrt_experiments.rotation.real import real_rotations
from uavrt_experiments.rotation.run import (
    Case,
    cases,
    polarization_table,
    start_sweep,
    true_pulses,
    wall_survey,
)


@pytest.fixture(scope="module")
def found() -> list[Case]:
    return cases(15_000.0)


def test_only_the_originals_poses_fold_a_full_turn_into_a_half_circle(
    found: list[Case],
) -> None:
    assert [case.like_figure_16 for case in found] == [case.original for case in found]
    assert all(len(case.reading.snr_db) > 50 for case in found)


def test_interpolated_poses_show_the_tag_where_it_is(found: list[Case]) -> None:
    open_field, wall = (case for case in found if not case.original)
    for case, bound in ((open_field, 3.0), (wall, 8.0)):
        assert abs(wrapped(case.reading.bearing.bearing_deg - BEARING_DEG)) < bound
        assert case.reading.covered_deg > 340.0


def test_a_start_100_degrees_off_makes_the_thesis_figures(found: list[Case]) -> None:
    both = [case for case in found if case.like_figure_16 and case.like_figure_17]
    assert {case.first_off_deg for case in both} == {100.0}
    assert any("stand for 100°" in line for line in words.verdict_lines(found, wall_survey(4)))


def test_our_bearing_does_not_believe_half_way_poses(found: list[Case]) -> None:
    half_way = [case.reading.bearing for case in found if case.original]
    assert half_way
    assert all(bearing.ambiguous or not bearing.accepted for bearing in half_way)


def test_the_shift_is_half_of_the_heading_at_the_start() -> None:
    sweep = start_sweep([0.0, 40.0, 120.0])
    first = sweep[0][1]
    for away, shift in sweep:
        assert shift - first == pytest.approx(away / 2.0, abs=1.0)


def test_half_way_headings_can_be_undone_but_for_the_first_one() -> None:
    scenario = Cart(seed=5).scenario
    pulses = true_pulses(scenario, np.random.default_rng(5))
    for away in (0.0, 100.0, -150.0):
        samples = original_samples(scenario, BEARING_DEG + away)
        reading = read_turn(original_poses(pulses, samples))
        bearing = doubled(reading, BEARING_DEG)
        assert bearing.accepted
        # Up to 0.5 s old poses, and times that are off by up to 0.9 s, at 6°/s.
        assert abs(wrapped(bearing.bearing_deg - BEARING_DEG)) < 6.0


def test_a_real_flight_is_read_the_same_way(tmp_path: Path) -> None:
    scenario = Cart(seed=2).scenario
    pulses = true_pulses(scenario, np.random.default_rng(2))
    sound = with_poses(scenario, pulses)
    halved = original_poses(pulses, original_samples(scenario, BEARING_DEG + 100.0))
    verdicts = []
    start_ns = scenario.start_time_ns
    poses = [scenario.vehicle_pose(start_ns + step * 200_000_000) for step in range(385)]
    for name, pulse_poses in (("sound", sound), ("halved", halved)):
        info = made.flight_info(tmp_path / name, scenario.tags, start_time_ns=start_ns)
        flight = made.flight(info, poses=poses, pulse_poses=pulse_poses)
        verdicts += real_rotations(
            flight, bearing_deg=BEARING_DEG, start_heading_deg=BEARING_DEG
        )
    good, bad = verdicts
    assert not good.half_way
    assert good.turned_deg == pytest.approx(360.0, abs=15.0)
    assert abs(wrapped(good.reading.bearing.bearing_deg - BEARING_DEG)) < 3.0
    assert bad.half_way
    # The turn was found some degrees after its start, whose heading was given.
    assert abs(wrapped(some(bad.recovered).bearing_deg - BEARING_DEG)) < 12.0
    assert "half-way ones" in "\n".join(bad.lines())


def test_the_page_shows_each_case(found: list[Case]) -> None:
    rows = [(case.name, case.reading, BEARING_DEG) for case in found[:2]]
    page = rotation_page("Rotation", rows, [words.case_lines(found)])
    assert page.count("data:image/svg+xml") == 2
    assert "http" not in page.replace("data:image", "")


def test_our_poses_and_the_originals_agree_while_nothing_moves() -> None:
    scenario = Cart().scenario
    pulses = true_pulses(scenario, np.random.default_rng(1))[:4]
    ours = with_poses(scenario, pulses)
    theirs = original_poses(pulses, original_samples(scenario, BEARING_DEG))
    for one, other in zip(ours, theirs, strict=True):
        first, second = (yaw_deg(p.quaternion_wxyz) for p in (some(one.pose), some(other.pose)))
        assert wrapped(first - second) == pytest.approx(0.0, abs=0.1)


def test_crossed_polarization_costs_pulses_and_some_degrees_but_not_fifty() -> None:
    (row,) = polarization_table([90.0], 7_500.0)
    mismatch, pulses, error, with_wall, error_at_wall = row
    assert mismatch == 90.0
    assert 45 <= pulses <= 61
    assert with_wall >= pulses - 5
    assert abs(some(error)) < 8.0
    assert abs(some(error_at_wall)) < 15.0
    assert "90°" in words.polarization_lines([row])[1]
