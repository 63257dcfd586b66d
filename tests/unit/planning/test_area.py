"""Areas that cannot be searched are refused with a remedy; ways are looked at all along."""

import numpy as np
import pytest

from uavrt.errors import PlanError
from uavrt.planning import Circle, Polygon, SearchArea, survey_lines
from uavrt.planning.area import check_reach

SQUARE = Polygon.rectangle(0.0, 400.0, 0.0, 400.0, name="search area")


@pytest.mark.parametrize(
    ("corners", "said"),
    [
        (((0, 0), (100, 100), (100, 0), (0, 100)), "crosses itself"),
        (((0, 0), (100, 0)), "2 corner"),
        (((0, 0), (100, 0), (50, 0), (50, 80)), "crosses itself"),
        (((0, 0), (100, 0), (100, 0.1)), "holds 5 m²"),
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
    with pytest.raises(PlanError, match=r"beyond the fence at its corner\(s\) 2, 3"):
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
    with pytest.raises(PlanError, match="no home"):
        check_reach(area, 5000.0, home_known=False)


def test_a_way_is_refused_for_what_lies_between_its_ends() -> None:
    area = SearchArea(
        search=SQUARE, fence=SQUARE, voids=(Circle(east_m=200.0, north_m=200.0, radius_m=20.0),)
    )
    reasons = area.refusals(
        (100.0, 200.0), np.array([300.0, 100.0, -20.0]), np.array([200.0, 300.0, 200.0]), 40.0
    )
    assert reasons == ["enters a place to keep away from", None, "leaves the fence"]
    assert area.refusal(np.array([100.0, 300.0]), np.array([200.0, 200.0]), 40.0) is not None
    assert area.refusal(np.array([100.0, 300.0]), np.array([100.0, 100.0]), 40.0) is None


def test_a_hill_on_the_way_comes_too_near() -> None:
    def hill(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
        return np.asarray(30.0 * np.exp(-(((east_m - 200.0) / 40.0) ** 2)) + 0.0 * north_m)

    area = SearchArea(search=SQUARE, ground=hill)
    east, north = np.array([0.0, 400.0]), np.array([100.0, 100.0])
    assert area.refusal(east, north, 55.0) is None
    assert area.refusal(east, north, 45.0) == "comes below 20 m above ground"
    assert area.refusal(east, north, 130.0) == "goes above 120 m above ground"


def test_survey_lines_cover_the_area() -> None:
    way = np.array(survey_lines(SQUARE, 80.0))
    assert len(way) == 10
    assert SQUARE.contains(*(200.0 + 0.999 * (way - 200.0)).T).all()
    assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(5 * 400 + 4 * 80)
