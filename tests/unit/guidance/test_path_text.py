"""Ways from GeoJSON, KML and QGroundControl's plans."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.errors import FormatError
from uavrt.guidance.files.path_text import path_in

WAY = ((46.5, 8.0), (46.51, 8.002), (46.52, 8.0))
LINE = [[east, north] for north, east in WAY]


def plan(*items: object) -> str:
    return json.dumps({"fileType": "Plan", "version": 1, "mission": {"items": items}})


def waypoint(north: float, east: float, command: int = 16) -> dict[str, object]:
    params = [0, 0, 0, None, north, east, 60]
    return {"type": "SimpleItem", "command": command, "params": params}


KML = (
    '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><LineString>'
    f"<coordinates>{' '.join(f'{e},{n},0' for n, e in WAY)}</coordinates>"
    "</LineString></Placemark></kml>"
)
SURVEY = {"TransectStyleComplexItem": {"VisualTransectPoints": [list(one) for one in WAY]}}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"type": "LineString", "coordinates": LINE}),
        json.dumps(
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": LINE}}
        ),
        KML,
        plan(*(waypoint(*one) for one in WAY)),
        plan(waypoint(0, 0, 22), *(waypoint(*one) for one in WAY), waypoint(0, 0, 20)),
        plan(SURVEY),
    ],
)
def test_a_way_is_read_from_each_program(text: str) -> None:
    assert path_in(text, "a file") == WAY


def test_an_area_alone_is_no_way() -> None:
    ring = [*LINE, LINE[0]]
    assert path_in(json.dumps({"type": "Polygon", "coordinates": [ring]}), "a file") == ()


@given(st.text(max_size=200))
def test_no_text_ends_in_another_error(text: str) -> None:
    with contextlib.suppress(FormatError):
        assert path_in(text, "a file") != WAY


def test_what_is_of_another_kind_is_told_in_words() -> None:
    """'list' object has no attribute 'get', it said."""
    with pytest.raises(FormatError, match="neither GeoJSON nor a plan"):
        path_in("[1]", "a file")
    with pytest.raises(FormatError, match="an object has no 'type'"):
        path_in("{}", "a file")


@pytest.mark.parametrize("text", ["", "{}", "[1]", plan(waypoint(99.0, 8.0), waypoint(1, 1))])
def test_what_holds_no_places_is_named(text: str) -> None:
    with pytest.raises(FormatError, match="a file contains no usable path"):
        path_in(text, "a file")
