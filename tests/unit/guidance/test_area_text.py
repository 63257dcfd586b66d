"""Outlines and ways from GeoJSON, KML and QGroundControl's plans, and texts with neither."""

import contextlib
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.errors import FormatError
from uavrt.guidance.files.area_text import area_in, circle, keep_out_in
from uavrt.guidance.files.path_text import path_in

CORNERS = [(46.5, 8.0), (46.5, 8.002), (46.501, 8.002), (46.501, 8.0)]
RING = [[east, north] for north, east in [*CORNERS, CORNERS[0]]]


def geojson(*rings: object) -> str:
    geometry = {"type": "Polygon", "coordinates": list(rings)}
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature]})


def kml(inner: str = "") -> str:
    corners = " ".join(f"{east},{north},0" for east, north in RING)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark><Polygon>'
        f"<outerBoundaryIs><LinearRing><coordinates>{corners}</coordinates></LinearRing>"
        f"</outerBoundaryIs>{inner}</Polygon></Placemark></Document></kml>"
    )


def plan(items: object, fence: object = None) -> str:
    return json.dumps(
        {
            "fileType": "Plan",
            "version": 1,
            "geoFence": fence or {"circles": [], "polygons": []},
            "mission": {"items": items},
            "rallyPoints": {"points": []},
        }
    )


SURVEY = {"type": "ComplexItem", "complexItemType": "survey", "polygon": CORNERS}
FENCE = {"circles": [], "polygons": [{"inclusion": True, "polygon": CORNERS}]}


@pytest.mark.parametrize(
    "text",
    [
        geojson(RING),
        json.dumps({"type": "Polygon", "coordinates": [RING]}),
        json.dumps({"type": "MultiPolygon", "coordinates": [[RING]]}),
        kml(),
        "\ufeff" + kml(),
        plan([{"type": "SimpleItem", "command": 22}, SURVEY]),
        plan([SURVEY], FENCE),
        plan([], FENCE),
    ],
)
def test_one_outline_is_read_whoever_drew_it(text: str) -> None:
    assert area_in(text, "meadow") == tuple(CORNERS)


def test_a_fence_that_is_a_circle_has_corners_all_round() -> None:
    fence = {
        "circles": [{"inclusion": True, "circle": {"center": [46.5, 8.0], "radius": 80.0}}]
    }
    places = area_in(plan([], fence), "ring.plan")
    assert len(places) == 20
    for place in places:
        assert distance_m(46.5, 8.0, *place) == pytest.approx(80.0, rel=0.005)
    with pytest.raises(FormatError, match="radius"):
        circle((46.5, 8.0), float("nan"))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "contains no usable area"),
        ("[]", "neither GeoJSON nor a plan"),
        ("null", "neither GeoJSON nor a plan"),
        ("{}", "has no 'type'"),
        (geojson(RING, RING), "holes"),
        (kml("<innerBoundaryIs/>"), "holes"),
        (geojson(RING[:2]), "three corners"),
        (geojson([[8.0, 460.5], [8.0, 46.6], [8.1, 46.5]]), "not a position on earth"),
        (plan([SURVEY, SURVEY]), "2 outlines"),
        (plan([]), "0 outlines"),
        ('<!DOCTYPE x [<!ENTITY a "b">]>' + kml(), "entities"),
        ("<kml", "contains no usable area"),
        ("[" * 100_000, "contains no usable area"),
        ("x" * 3_000_000, "too long"),
    ],
)
def test_what_gives_no_single_outline_is_refused_with_the_reason(
    text: str, reason: str
) -> None:
    with pytest.raises(FormatError, match=reason) as refused:
        area_in(text, "meadow")
    assert "Draw one outline" in str(refused.value)


BARN = [[8.0005, 46.5005], [8.0006, 46.5005], [8.0006, 46.5006], [8.0005, 46.5005]]


def feature(geometry: object, **properties: object) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def marked() -> str:
    shapes = [
        feature({"type": "Polygon", "coordinates": [RING]}),
        feature({"type": "Polygon", "coordinates": [BARN]}, keep_out=True, name="barn"),
        feature({"type": "Point", "coordinates": [8.001, 46.5]}, keep_out=True, radius_m=40),
    ]
    return json.dumps({"type": "FeatureCollection", "features": shapes})


def test_what_is_marked_is_kept_out_of_and_is_not_the_area() -> None:
    assert area_in(marked(), "meadow") == tuple(CORNERS)
    barn, person = keep_out_in(marked(), "meadow")
    assert (barn.name, barn.radius_m, len(barn.places)) == ("barn", None, 3)
    assert (person.places, person.radius_m) == (((46.5, 8.001),), 40.0)


def test_a_polygon_of_kml_is_marked_by_its_name() -> None:
    named = kml().replace("<Placemark>", "<Placemark><name>Keep-out: barn</name>")
    barn = named.partition("<Document>")[2].partition("</Document>")[0]
    both = kml().replace("</Document>", f"{barn}</Document>")
    assert area_in(both, "meadow") == tuple(CORNERS)
    assert [one.name for one in keep_out_in(both, "meadow")] == ["Keep-out: barn"]


def test_exclusion_fences_of_a_plan_are_kept_out_of() -> None:
    fence = {
        "circles": [{"inclusion": False, "circle": {"center": [46.5, 8.0], "radius": 30.0}}],
        "polygons": [
            {"inclusion": True, "polygon": CORNERS},
            {"inclusion": False, "polygon": CORNERS[:3]},
        ],
    }
    text = plan([SURVEY], fence)
    assert area_in(text, "meadow") == tuple(CORNERS)
    assert {one.radius_m for one in keep_out_in(text, "meadow", every=True)} == {None, 30.0}


def test_of_a_file_of_buildings_every_outline_counts() -> None:
    assert len(keep_out_in(geojson(RING), "farm", every=True)) == 1
    assert keep_out_in(geojson(RING), "farm") == ()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (json.dumps({"type": "FeatureCollection", "features": []}), "has no area"),
        (plan([SURVEY]), "has no area"),
        (
            json.dumps(feature({"type": "Point", "coordinates": [8, 46]}, keep_out=1)),
            "radius_m",
        ),
        (
            json.dumps(
                feature({"type": "Point", "coordinates": [8, 46]}, keep_out=1, radius_m=-3)
            ),
            "radius of -3",
        ),
        (
            json.dumps(feature({"type": "Polygon", "coordinates": [RING]}) | {"properties": 3}),
            "int",
        ),
        (geojson([[8.0, 460.5], [8.0, 46.6], [8.1, 46.5]]), "not a position on earth"),
        (json.dumps({"type": "MultiPolygon", "coordinates": [[RING]] * 101}), "at most 100"),
    ],
)
def test_what_gives_nothing_to_keep_out_of_is_refused(text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=reason) as refused:
        keep_out_in(text, "farm", every=True)
    assert "Mark them" in str(refused.value)


@given(st.text(max_size=300), st.sampled_from(["", "{", '{"type": "Polygon", ', "<kml>"]))
def test_any_text_is_an_area_or_refused(text: str, begin: str) -> None:
    with contextlib.suppress(FormatError):
        assert len(area_in(begin + text, "some")) >= 3
    with contextlib.suppress(FormatError):
        keep_out_in(begin + text, "some", every=True)


def school(kind: str, inner: Any, **properties: Any) -> dict[str, Any]:
    member = "geometries" if kind == "GeometryCollection" else "coordinates"
    shape = {"type": kind, member: inner}
    return {"type": "Feature", "properties": {"name": "school"} | properties, "geometry": shape}


SQUARE = {"type": "Polygon", "coordinates": [RING]}


def features(*found: dict[str, Any]) -> str:
    barn = school("Polygon", [RING], name="barn", keep_out=True)
    return json.dumps({"type": "FeatureCollection", "features": [barn, *found]})


def test_a_file_of_places_to_keep_out_of_counts_its_points_and_collections() -> None:
    point = school("Point", [8.01, 47.01], radius_m=80)
    both = school("GeometryCollection", [SQUARE, {"type": "Point", "coordinates": [8, 47]}])
    both["properties"]["radius_m"] = 20
    found = keep_out_in(features(point, both), "farm", every=True)
    assert [(one.name, one.radius_m) for one in found] == [
        ("barn", None),
        ("school", 80.0),
        ("school", None),
        ("school", 20.0),
    ]


@pytest.mark.parametrize(
    ("kind", "inner"),
    [
        ("LineString", RING),
        ("MultiPoint", [[8.0, 47.0]]),
        ("GeometryCollection", []),
        ("GeometryCollection", [SQUARE, {"type": "LineString", "coordinates": RING}]),
        ("MultiPolygon", []),
        ("Polygon", []),
        ("Circle", [8.0, 47.0]),
    ],
)
def test_no_place_to_keep_out_of_is_left_out_in_silence(kind: str, inner: Any) -> None:
    marked_one = features(school(kind, inner, keep_out=True))
    for text, every in ((marked_one, False), (features(school(kind, inner)), True)):
        with pytest.raises(FormatError, match='"school" is a'):
            keep_out_in(text, "farm", every=every)
    with pytest.raises(FormatError, match='"school" is a'):
        area_in(marked_one, "farm")


def test_a_point_to_keep_out_of_without_a_radius_is_named() -> None:
    with pytest.raises(FormatError, match='the excluded point "school" has no radius_m'):
        keep_out_in(features(school("Point", [8.01, 47.01])), "farm", every=True)


RING_KML = "<coordinates>8,47 8.001,47 8,47.001</coordinates>"
BARN_KML = f"<Placemark><name>keep out barn</name><Polygon>{RING_KML}</Polygon></Placemark>"


@pytest.mark.parametrize(
    "shape",
    [
        f"<LinearRing>{RING_KML}</LinearRing>",
        f"<MultiGeometry><Polygon>{RING_KML}</Polygon><LineString>{RING_KML}</LineString>"
        "</MultiGeometry>",
        "<Point><coordinates>8,47</coordinates></Point>",
        "",
    ],
)
def test_no_placemark_to_keep_out_of_is_left_out_in_silence(shape: str) -> None:
    for name, every in (("keep out school", False), ("school", True)):
        placemark = f"<Placemark><name>{name}</name>{shape}</Placemark>"
        with pytest.raises(FormatError, match=f'"{name}" is a'):
            keep_out_in(f"<kml>{BARN_KML}{placemark}</kml>", "farm", every=every)
    label = f"<Placemark><name>label</name>{shape}</Placemark>"
    if "Polygon" not in shape:
        assert len(keep_out_in(f"<kml>{BARN_KML}{label}</kml>", "farm")) == 1


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"type": "Polygon", "coordinates": []}),
        json.dumps({"type": "Polygon", "coordinates": [""]}),
        json.dumps({"type": "MultiPolygon", "coordinates": [[]]}),
        json.dumps({"type": "Polygon", "coordinates": [[[10**400, 47], [8, 47], [8, 48]]]}),
        "<kml><Polygon><coordinates>8 8.1 8.2</coordinates></Polygon></kml>",
    ],
)
def test_broken_corners_are_refused(text: str) -> None:
    with pytest.raises(FormatError, match="contains no usable area"):
        area_in(text, "broken")
    with pytest.raises(FormatError, match="no usable keep-out areas"):
        keep_out_in(text, "broken", every=True)


WAY = ((46.5, 8.0), (46.51, 8.002), (46.52, 8.0))
LINE = [[east, north] for north, east in WAY]


def waypoint(north: float, east: float, command: int = 16) -> dict[str, object]:
    params = [0, 0, 0, None, north, east, 60]
    return {"type": "SimpleItem", "command": command, "params": params}


WAY_KML = (
    '<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><LineString>'
    f"<coordinates>{' '.join(f'{e},{n},0' for n, e in WAY)}</coordinates>"
    "</LineString></Placemark></kml>"
)
TRANSECTS = {"TransectStyleComplexItem": {"VisualTransectPoints": [list(one) for one in WAY]}}


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"type": "LineString", "coordinates": LINE}),
        json.dumps(
            {"type": "Feature", "geometry": {"type": "LineString", "coordinates": LINE}}
        ),
        WAY_KML,
        plan([waypoint(*one) for one in WAY]),
        plan([waypoint(0, 0, 22), *(waypoint(*one) for one in WAY), waypoint(0, 0, 20)]),
        plan([TRANSECTS]),
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


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", ""),
        ("{}", "an object has no 'type'"),
        ("[1]", "neither GeoJSON nor a plan"),
        (plan([waypoint(99.0, 8.0), waypoint(1, 1)]), ""),
    ],
)
def test_what_holds_no_way_is_named_with_the_reason(text: str, reason: str) -> None:
    with pytest.raises(FormatError, match=rf"a file contains no usable path.*{reason}"):
        path_in(text, "a file")
