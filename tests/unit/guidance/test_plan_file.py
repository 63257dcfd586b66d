"""Surveys as QGroundControl's files, read by others."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from flown import HOME

from uavrt.cli.system.fly import fly
from uavrt.core.errors import ConfigError, FormatError, PlanError
from uavrt.core.messages import KeepOut
from uavrt.guidance.files.area_text import area_in, keep_out_in
from uavrt.guidance.files.mission import survey_items
from uavrt.guidance.files.plan_file import survey_file
from uavrt.guidance.operator_orders import Limits, Order
from uavrt.guidance.plans import survey_places
from uavrt.planning import area


def places(*local: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    return tuple(HOME.to_geodetic(*one) for one in local)


FIELD = places((50, 0), (50, 150), (150, 150), (150, 0))
BARN = KeepOut(places=places((180, 0), (180, 40), (200, 40), (200, 0)))
PERSON = KeepOut(places=places((20, 60)), radius_m=20.0)


def survey(**values: Any) -> Order:
    usual: dict[str, Any] = {
        "places": FIELD,
        "height_m": 60.0,
        "spacing_m": 50.0,
        "keep_out": (BARN, PERSON),
    }
    return Order(order_id=0, action="survey", **usual | values)


def test_it_flies_the_lines_at_their_height_and_returns() -> None:
    mission = json.loads(survey_file(survey(), 5.0))["mission"]
    *ways, home = mission["items"]
    assert [one["command"] for one in ways] == [16] * 4
    assert {(one["frame"], one["params"][6], one["Altitude"]) for one in ways} == {(3, 60, 60)}
    assert home["command"] == 20
    assert [one["doJumpId"] for one in mission["items"]] == [1, 2, 3, 4, 5]
    assert mission["plannedHomePosition"][:2] == ways[0]["params"][4:6]


def test_its_fences_are_what_we_read_as_kept_out_of() -> None:
    text = survey_file(survey(), 5.0)
    assert set(keep_out_in(text, "saved.plan")) == {BARN, PERSON}
    with pytest.raises(FormatError, match="0 outlines"):
        area_in(text, "saved.plan")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"pattern": "points"}, "cannot contain turns"),
        ({"height_m": None}, "needs a height"),
        ({"height_m": 10.0}, "the least permitted is 20 m"),
        ({"places": ()}, "no corners"),
        ({"spacing_m": 1.0}, "line spacing of 1 m"),
        ({"keep_out": (KeepOut(places=places((100, 75)), radius_m=30.0),)}, "keep-out"),
    ],
)
def test_a_survey_that_cannot_be_one_is_not_written(
    values: dict[str, Any], reason: str
) -> None:
    with pytest.raises(PlanError, match=reason):
        survey_file(survey(**values), 5.0)


FENCED = KeepOut(places=places((-50, -50), (-50, 200), (200, 200), (200, -50)))
HOUSE = KeepOut(places=places((40, 60)), radius_m=8.0, name="house")


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        (Limits(fence_m=150.0), "leads 195 m from the vehicle's home"),
        (Limits(stay_in=(FENCED,)), None),
        (Limits(stay_in=(KeepOut(places=places((0, 0)), radius_m=150.0),)), "the path leaves"),
        (Limits(stay_in=(KeepOut(places=places((150, 150)), radius_m=190.0),)), "home lies"),
        (Limits(keep_out=(HOUSE,)), "the path"),  # behind it, seen from home
        (Limits(highest_m=50.0), "the most permitted is 50 m"),
    ],
)
def test_a_survey_for_a_vehicle_keeps_to_its_fence_and_home(
    limits: Limits, reason: str | None
) -> None:
    order, home = survey(keep_out=()), HOME.to_geodetic(0.0, 0.0)
    if reason is None:
        assert survey_items(order, limits, home) == survey_items(order)
        return
    with pytest.raises(PlanError, match=reason) as refused:
        survey_items(order, limits, home)
    assert refused.value.remedy


def meadow(directory: Path) -> Path:
    path = directory / "meadow.geojson"
    ring = [[east, north] for north, east in (*FIELD, FIELD[0])]
    path.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    return path


def test_the_command_line_saves_and_asks_no_drone(tmp_path: Path) -> None:
    saved = tmp_path / "survey.plan"
    fly("survey", area=meadow(tmp_path), height=60.0, save=saved)
    assert json.loads(saved.read_text())["fileType"] == "Plan"
    with pytest.raises(FormatError, match="cannot be written"):
        fly("survey", area=meadow(tmp_path), height=60.0, save=saved)


@pytest.mark.parametrize(
    "ask",
    [
        lambda path: fly("hold", save=path / "hold.plan"),
        lambda path: fly("stop", save=path / "stop.plan"),
        lambda path: fly("survey", area=meadow(path), height=60.0, save=path / "x.json"),
    ],
)
def test_only_surveys_are_saved(tmp_path: Path, ask: Callable[[Path], None]) -> None:
    with pytest.raises(ConfigError, match=r"only a survey can be saved|only as a \.plan file"):
        ask(tmp_path)


@pytest.mark.parametrize("pattern", ["lines", "points"])
def test_a_survey_of_half_a_country_is_refused_before_a_line_is_cut(
    pattern: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page draws it in the process that serves the drone."""
    monkeypatch.delattr(area, "_cut")
    country = ((47.0, 8.0), (52.0, 8.0), (52.0, 13.0), (47.0, 13.0))
    with pytest.raises(PlanError, match="lines; at most"):
        survey_places(survey(places=country, spacing_m=5.0, pattern=pattern), country[0])


def test_long_lines_are_refused_before_their_points_are_placed() -> None:
    strip = places((0, 0), (500_000, 0), (500_000, 20), (0, 20))
    with pytest.raises(PlanError, match="positions for turns; at most"):
        survey_places(survey(places=strip, spacing_m=5.0, pattern="points"), strip[0])
