"""Where a tag would be heard along a plan: the page is told what the command line prints."""

import base64
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from tests.unit.analysis.test_coverage import HOME, outline, write_hills
from until import until

from uavrt.cli.prediction.coverage import coverage
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import Tag
from uavrt.ground.store.estimates import AntennaChoice
from uavrt.ground.web.work.map_jobs import MapJobs, OnStep, Record
from uavrt.ground.web.work.plan_maps import PlanMapRequest, plan_map_jobs

PATH = "/api/motion/coverage"
PLANE = TangentPlane(latitude_deg=HOME[0], longitude_deg=HOME[1])
TAG = made.tag(7, 148_752_000.0, 1.5, pulse_width_s=0.015, k=5)
WHIP = AntennaChoice(pattern="monopole")


def places(*metres: tuple[float, float]) -> list[list[float]]:
    """East and north of home, as latitude and longitude."""
    return [[float(one) for one in PLANE.to_geodetic(*place)] for place in metres]


def corners_of(area: Path) -> list[list[float]]:
    (ring,) = json.loads(area.read_text())["coordinates"]
    return [[north, east] for east, north in ring]


WAY = places((0.0, 0.0), (150.0, 0.0))
PLAN = {"way": WAY, "tag_power_dbm": -50}


def answered(ask: Callable[[], Record]) -> Record:
    return until(lambda: answer if (answer := ask())["state"] != "working" else None, 100.0)


def foreseen(wanted: Record, antenna: AntennaChoice = WHIP, *tags: Tag) -> Record:
    jobs, asked = plan_map_jobs(), PlanMapRequest.from_request(wanted, tags, antenna)
    return answered(lambda: jobs.answer(asked))


def printed(capsys: pytest.CaptureFixture[str], plan: Path, **options: Any) -> list[Record]:
    coverage(plan, tag_power=-50.0, as_json=True, **options)
    found: list[Record] = json.loads(capsys.readouterr().out)
    return found


def test_an_area_is_mapped_as_the_command_line_maps_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hills = write_hills(tmp_path)
    area = outline(tmp_path / "area.geojson", -60.0, 60.0, reach_m=60.0)
    write_tags(tmp_path / "tags.toml", [TAG])
    wanted = {
        "outline": corners_of(area),
        "spacing_m": 50,
        "heights_m": [110, 30],
        "speed_m_s": 5.0,
        "tag_id": 7,
        "tag_power_dbm": -50,
    }
    antenna = AntennaChoice(pattern="RA-23K", dem=str(hills))
    page = foreseen(wanted, antenna, TAG)
    told = printed(
        capsys,
        area,
        dem=hills,
        spacing=50.0,
        height=(30.0, 110.0),
        speed=5.0,
        tags=tmp_path / "tags.toml",
        antenna="RA-23K",
    )
    assert page["state"] == "done"
    for mine, theirs in zip(page["heights"], told, strict=True):
        assert mine["height_m"] == theirs["height_m"]
        assert mine["mean_probability"] == theirs["mean_probability"]
        assert mine["share_above_90"] == theirs["share90"]
        assert mine["best"] == theirs["best"]
    (best,) = (one for one in told if one["best"])
    assert page["height_m"] == best["height_m"]
    assert page["mean_probability"] == best["mean_probability"]
    assert page["limitations"] == best["limitations"]
    assert page["tag_id"] == 7
    assert page["cell_m"] == 20.0
    assert base64.b64decode(page["picture"]).startswith(b"\x89PNG")
    west, south = np.min(page["corners"], axis=0)
    east, north = np.max(page["corners"], axis=0)
    assert all(south < one[0] < north and west < one[1] < east for one in corners_of(area))


def test_a_way_without_a_list_is_mapped_with_all_defaults(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = {"type": "LineString", "coordinates": [[east, north] for north, east in WAY]}
    (tmp_path / "way.geojson").write_text(json.dumps(line))
    page = foreseen(PLAN)
    (told,) = printed(capsys, tmp_path / "way.geojson")
    assert (page["tag_id"], page["height_m"], page["speed_m_s"]) == (None, 60.0, 8.0)
    assert page["mean_probability"] == told["mean_probability"]
    assert page["share_above_90"] == told["share90"]
    assert page["limitations"] == told["limitations"]
    assert "level" in str(page["limitations"])


def test_a_wide_plan_has_wider_squares_that_the_answer_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    far = places((0.0, 0.0), (9_000.0, 0.0))
    line = {"type": "LineString", "coordinates": [[east, north] for north, east in far]}
    (tmp_path / "way.geojson").write_text(json.dumps(line))
    page = foreseen(PLAN | {"way": far, "speed_m_s": 100})
    assert page["cell_m"] > 20.0
    (told,) = printed(capsys, tmp_path / "way.geojson", speed=100.0, cell=page["cell_m"])
    assert page["mean_probability"] == told["mean_probability"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"way": WAY},
        {"tag_power_dbm": -50},
        PLAN | {"outline": WAY},
        PLAN | {"tag_power_dbm": True},
        PLAN | {"tag_power_dbm": 300},
        PLAN | {"way": "here"},
        PLAN | {"way": WAY[:1]},
        PLAN | {"way": [WAY[0], [91.0, 0.0]]},
        PLAN | {"way": [WAY[0], [True, False]]},
        PLAN | {"way": [WAY[0], [float("nan"), 0.0]]},
        PLAN | {"way": [WAY[0], [10**400, 0]]},
        PLAN | {"way": [WAY[0], [*WAY[0], 3.0]]},
        PLAN | {"way": [[0.0, 0.0], [0.0, 180.0]]},
        PLAN | {"way": WAY * 5000},
        PLAN | {"heights_m": []},
        PLAN | {"heights_m": 60},
        PLAN | {"heights_m": [0]},
        PLAN | {"heights_m": ["60"]},
        PLAN | {"heights_m": [float("inf")]},
        PLAN | {"heights_m": [30, 40, 50, 60, 70, 80]},
        PLAN | {"speed_m_s": 1e-300},
        PLAN | {"speed_m_s": None},
        PLAN | {"tag_id": "7"},
        PLAN | {"tag_id": True},
        PLAN | {"tag_id": 10**30},
        {"outline": WAY, "tag_power_dbm": -50},
        {"outline": [*WAY, WAY[0]], "spacing_m": 0.001, "tag_power_dbm": -50},
    ],
)
def test_a_question_that_is_none_is_refused(wrong: Any) -> None:
    with pytest.raises((FormatError, UsageError)):
        PlanMapRequest.from_request(wrong, (TAG,), WHIP)


@pytest.mark.parametrize(
    ("plan", "why"),
    [
        ({"outline": places((0, 0), (9000, 0), (9000, 40_000)), "spacing_m": 5}, "1000 are"),
        ({"outline": places((0, 0), (90, 90), (90, 0), (0, 90))}, "crosses itself"),
        ({"outline": places((0, 0), (50, 0), (100, 0))}, "too small: 0 m²"),
        ({"way": places((0, 0), (20_000, 0)), "speed_m_s": 0.5}, "in total can be calculated"),
        ({"way": places((0, 0), (20_000, 0)) * 1000}, "in total can be calculated"),
    ],
    ids=["lines", "crossing", "nothing", "slow", "long"],
)
def test_a_plan_that_cannot_be_mapped_says_why(plan: Record, why: str) -> None:
    answer = foreseen({"tag_power_dbm": -50} | plan)
    assert answer["state"] == "failed"
    assert why in answer["error"]


def test_everybody_may_ask_and_nothing_moves(served: Any) -> None:
    served.ask("POST", "/api/commander", {}, {"X-Page": "another"})

    def ask(wanted: object) -> Any:
        return served.ask("POST", PATH, wanted, {"X-Page": "viewer"})

    done = answered(lambda: ask(PLAN).json)
    assert done["antenna"] == served.ask("GET", "/api/settings").json["antenna"]
    assert done["mean_probability"] > 0.0
    assert ask(PLAN | {"tag_id": 5}).status == 404
    assert ask(PLAN | {"way": None}).status == 422
    assert ask(b"{").status == ask([1]).status == 422
    assert served.ask("GET", PATH).status == 405
    other = served.ask("POST", PATH, PLAN, {"Origin": "http://evil.example"})
    assert other.status == 403


def test_another_map_replaces_the_first_and_its_page_is_informed() -> None:
    given_up = []

    def make(asked: str, on_step: OnStep) -> str:
        try:
            for _ in range(20_000 if asked == "slow" else 1):
                on_step(1, 2)
                time.sleep(0.005)
        except Exception:
            given_up.append(asked)
            raise
        return asked

    jobs = MapJobs(make, lambda found: {"map": found}, "a map of a test")
    assert jobs.answer("slow")["state"] == "working"
    done = answered(lambda: jobs.answer("quick"))
    assert done == {"state": "done", "map": "quick"}
    again = jobs.answer("slow", again=True)
    assert again["state"] == "failed"
    assert "another map" in again["error"]
    assert jobs.found("quick") == "quick"
    until(lambda: given_up == ["slow"])
