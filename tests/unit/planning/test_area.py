"""Areas that cannot be searched are refused with a remedy; ways are looked at all along."""

import numpy as np
import pytest
from some import some

from uavrt.core.errors import PlanError
from uavrt.planning.area import Circle, Polygon, SearchArea, check_reach, survey_lines

SQUARE = Polygon.rectangle(0.0, 400.0, 0.0, 400.0, name="search area")


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        (((0, 0), (100, 100), (100, 0), (0, 100)), "crosses itself"),
        (((0, 0), (100, 0)), "needs three or more corners with finite coordinates"),
        (((0, 0), (100, 0), (50, 0), (50, 80)), "crosses itself"),
        (((0, 0), (100, 0), (100, 0.1)), "too small: 5 m²"),
        (((0, 0), (100, 0), (float("nan"), 5)), "corner"),
    ],
)
def test_an_outline_that_is_none_is_refused(
    corners: tuple[tuple[float, float], ...], said: str
) -> None:
    with pytest.raises(PlanError, match=said) as refused:
        Polygon(corners=corners)
    assert refused.value.remedy is not None


def test_a_star_holds_its_arms_and_not_what_is_between_them() -> None:
    arms = [
        (radius * np.sin(turn), radius * np.cos(turn))
        for radius, turn in zip([100, 30] * 5, np.arange(10) * np.pi / 5, strict=True)
    ]
    star = Polygon(corners=tuple((float(x), float(y)) for x, y in arms))
    inside = star.contains(np.array([0.0, 0.0, 50.0]), np.array([0.0, 80.0, 80.0]))
    assert inside.tolist() == [True, True, False]


def test_an_area_beyond_the_fence_or_heights_the_wrong_way_round_are_refused() -> None:
    fence = Polygon.rectangle(-10.0, 300.0, -10.0, 500.0, name="fence")
    with pytest.raises(PlanError, match=r"beyond the fence at its corners 2, 3"):
        SearchArea(search=SQUARE, fence=fence)
    with pytest.raises(PlanError, match="heights"):
        SearchArea(search=SQUARE, lowest_m=60.0, highest_m=30.0)
    with pytest.raises(PlanError, match="home is outside"):
        SearchArea(search=SQUARE, fence=SQUARE, home_m=(-50.0, 0.0))


def test_an_area_beyond_the_batterys_reach_is_refused() -> None:
    area = SearchArea(search=SQUARE, home_m=(-3000.0, 200.0))
    check_reach(area, 3100.0)
    with pytest.raises(PlanError, match="begins 3000 m from home"):
        check_reach(area, 2900.0)


def test_a_way_is_refused_for_what_lies_between_its_ends() -> None:
    area = SearchArea(
        search=SQUARE,
        fence=SQUARE,
        excluded=(Circle(east_m=200.0, north_m=200.0, radius_m=20.0),),
    )
    reasons = area.refusals(
        (100.0, 200.0), np.array([300.0, 100.0, -20.0]), np.array([200.0, 300.0, 200.0]), 40.0
    )
    assert reasons == ["the path enters a keep-out area", None, "the path leaves the fence"]
    assert area.refusal(np.array([100.0, 300.0]), np.array([200.0, 200.0]), 40.0) is not None
    assert area.refusal(np.array([100.0, 300.0]), np.array([100.0, 100.0]), 40.0) is None


def test_a_hill_on_the_way_comes_too_near() -> None:
    def hill(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
        return np.asarray(30.0 * np.exp(-(((east_m - 200.0) / 40.0) ** 2)) + 0.0 * north_m)

    area = SearchArea(search=SQUARE, ground=hill)
    east, north = np.array([0.0, 400.0]), np.array([100.0, 100.0])
    assert area.refusal(east, north, 55.0) is None
    assert area.refusal(east, north, 45.0) == "the path comes below 20 m above ground"
    assert area.refusal(east, north, 130.0) == "the path goes above 120 m above ground"


def test_survey_lines_cover_the_area() -> None:
    way = np.array(survey_lines(SQUARE, 80.0))
    assert len(way) == 10
    assert SQUARE.contains(*(200.0 + 0.999 * (way - 200.0)).T).all()
    assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(5 * 400 + 4 * 80)


SHED = Polygon.rectangle(100.0, 140.0, 90.0, 110.0, name="shed")


@pytest.mark.parametrize("void", [SHED, Circle(east_m=120.0, north_m=100.0, radius_m=20.0)])
def test_a_way_keeps_its_margin_from_a_building(void: Polygon | Circle) -> None:
    area = SearchArea(search=SQUARE, excluded=(void,), margin_m=5.0)
    past, near = np.array([50.0, 200.0]), np.array([50.0, 96.0])
    assert area.entered_area(past, np.array([126.0, 126.0])) is None
    assert area.entered_area(near, np.array([100.0, 100.0])) is not None
    # Blown into the margin it may leave, and not go nearer.
    assert area.entered_area(np.array([97.0, 50.0]), np.array([100.0, 100.0])) is None
    assert area.entered_area(np.array([97.0, 99.0]), np.array([100.0, 100.0])) is not None


@pytest.mark.parametrize("void", [SHED, Circle(east_m=120.0, north_m=100.0, radius_m=20.0)])
def test_behind_a_building_there_is_no_straight_way_home(void: Polygon | Circle) -> None:
    area = SearchArea(
        search=SQUARE, excluded=(void,), margin_m=5.0, straight_home=True, home_m=(10.0, 100.0)
    )
    behind, beside = np.array([200.0, 300.0]), np.array([150.0, 200.0])
    reason = some(area.entered_area(behind, np.array([100.0, 100.0])))
    assert reason.startswith("the path leads home over")
    assert area.entered_area(beside, np.array([200.0, 300.0])) is None
    assert (
        area.refusals((10.0, 150.0), np.array([200.0, 10.0]), np.array([100.0, 300.0]), 40.0)[1]
        is None
    )


def test_home_is_not_beside_a_building() -> None:
    area = SearchArea(search=SQUARE, excluded=(SHED,), margin_m=5.0, home_m=(97.0, 100.0))
    with pytest.raises(PlanError, match="home lies in or at the edge of the keep-out 'shed'"):
        area.check_home()


def test_distances_of_ways_from_an_outline_are_those_of_their_nearest_points() -> None:
    rng = np.random.default_rng(3)
    corners = ((0.0, 0.0), (60.0, 10.0), (30.0, 25.0), (50.0, 60.0), (-10.0, 40.0))
    shape = Polygon(corners=corners)
    start = (-80.0, 30.0)
    east, north = rng.uniform(-120.0, 120.0, (2, 40))
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    x = start[0] + share * (east - start[0])
    y = start[1] + share * (north - start[1])
    assert shape.path_distance_m(start, east, north) == pytest.approx(
        shape.off_m(x, y).min(axis=0), abs=0.06
    )


LEAVES = (
    Polygon(corners=((-50.0, -50.0), (50.0, -50.0), (50.0, 150.0), (-50.0, 150.0))),
    Circle(east_m=0.0, north_m=50.0, radius_m=120.0),
)


@pytest.mark.parametrize("within", LEAVES)
def test_no_way_leaves_an_area_to_stay_in_nor_comes_near_its_edge(
    within: Polygon | Circle,
) -> None:
    search = Polygon.rectangle(-40.0, 40.0, -40.0, 40.0)
    area = SearchArea(search=search, within=(within,), margin_m=5.0)
    area.check_home()
    for north, fits in ((140.0, True), (160.0, isinstance(within, Circle)), (180.0, False)):
        reason = area.entered_area(np.array([0.0, 0.0]), np.array([0.0, north]))
        assert (reason is None) == fits
    edge = 47.0 if isinstance(within, Polygon) else 117.0
    assert area.entered_area(np.array([0.0, edge]), np.array([50.0, 50.0])) is not None
    assert area.entered_area(np.array([0.0, edge - 4.0]), np.array([50.0, 50.0])) is None
    outside = some(area.entered_area(np.array([200.0, 210.0]), np.array([50.0, 50.0])))
    assert "leaves" in outside


def test_the_way_home_stays_within_a_bent_area() -> None:
    """An L: from its far arm the straight way home leads out of it."""
    corners = ((-20, -20), (150, -20), (150, 20), (20, 20), (20, 150), (-20, 150))
    bent = Polygon(corners=tuple((float(x), float(y)) for x, y in corners), name="meadow")
    search = Polygon.rectangle(-10.0, 10.0, -10.0, 10.0)
    area = SearchArea(search=search, within=(bent,), margin_m=1.0, home_m=(0.0, 140.0))
    reason = area.entered_area(np.array([0.0, 0.0, 100.0]), np.array([140.0, 0.0, 0.0]))
    assert reason == "the path leads home out of the meadow"
    assert area.entered_area(np.array([0.0, 0.0]), np.array([140.0, 0.0])) is None


def test_home_outside_of_an_area_to_stay_in_is_refused() -> None:
    within = Circle(east_m=100.0, north_m=0.0, radius_m=50.0, name="meadow")
    area = SearchArea(search=Polygon.rectangle(60.0, 140.0, -20.0, 20.0), within=(within,))
    with pytest.raises(PlanError, match="home lies outside of the meadow"):
        area.check_home()


def test_the_distance_from_an_edge_within_is_that_of_many_points() -> None:
    rng = np.random.default_rng(4)
    bent = Polygon(corners=((0, 0), (100, 0), (100, 100), (60, 100), (60, 30), (0, 30)))
    ends = rng.uniform(0.0, 100.0, (2, 40))
    start = (80.0, 50.0)
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    along = [s + share * (e - s) for s, e in zip(start, ends, strict=True)]
    looked = bent.depth_m(along[0], along[1]).min(axis=0)
    assert np.allclose(bent.path_depth_m(start, *ends), looked, atol=0.1)
