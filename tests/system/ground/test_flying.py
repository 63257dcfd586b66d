"""What the page's server refuses without any drone; `tests/unit/world` flies one."""

from typing import Any

import pytest

from uavrt.core.errors import FormatError
from uavrt.ground.link.motions.area_files import area_of_file


@pytest.mark.parametrize(
    "wish",
    [
        [],
        "hold",
        {"action": "loop"},
        {"action": "goto", "places": [[95, 8]]},
        {"action": "goto", "places": "here"},
        {"action": "rotate", "duration_s": "fast"},
        {"action": "rotate", "height_m": True},
        {"action": "survey"},
        {"action": "search"},
        {"action": "search", "radius_m": 100, "places": [[46.5, 8.0]] * 3},
        {"action": "search", "radius_m": 100, "tags": ["lynx"]},
        {"action": "survey", "places": [[46.5, 8.0]] * 3, "pattern": "star"},
    ],
)
def test_what_is_no_motion_is_refused_before_a_drone_is_looked_for(
    standing: Any, wish: object
) -> None:
    assert standing.ask("POST", "/api/motion/ask", wish).status == 422


def test_without_a_drone_taking_back_says_who_must(standing: Any) -> None:
    answer = standing.ask("POST", "/api/motion/stop", {})
    assert answer.status == 409
    assert "remote control" in answer.json["error"]


def test_a_file_that_gives_no_area_is_named(standing: Any) -> None:
    answer = standing.ask("POST", "/api/motion/area", {"name": "x.kml", "text": "<kml/>"})
    assert answer.status == 422
    assert "x.kml contains no usable area" in answer.json["error"]


@pytest.mark.parametrize("radius_m", [10**400, True, "80", None, 1e999])
def test_a_circle_of_no_number_is_refused(radius_m: Any) -> None:
    with pytest.raises(FormatError, match="radius_m must be a number"):
        area_of_file({"center": [47.0, 8.0], "radius_m": radius_m})
