"""Exports hold to their formats, checked by other readers and by schemas."""

import csv
import io
import json
import math
import re
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from lxml import etree
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile
from some import some
from sql import sql
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.export.csv_tables import movebank_csv, movebank_reference_csv
from uavrt.analysis.export.geotiff_export import geotiff_bytes
from uavrt.analysis.export.written import EXPORT_FORMATS, export_survey
from uavrt.analysis.measure.pulse_shapes import split_area_at_date_line, split_at_date_line
from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.clock import iso_utc
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.noted_places import mark_note, vehicle_note
from uavrt.flight.reading.recognise import read_pulse_log, read_pulses
from uavrt.formats.bearings_csv import read_bearing_file
from uavrt.formats.positions_csv import read_position_file
from uavrt.localization.results import Caution, PositionGrid
from uavrt.simulation.scene.scenario import Scenario

# GPX 1.1, of its schema what we write and its order (topografix.com/GPX/1/1/gpx.xsd).
GPX_SCHEMA = """
<xsd:schema xmlns:xsd="http://www.w3.org/2001/XMLSchema"
 xmlns="http://www.topografix.com/GPX/1/1" elementFormDefault="qualified"
 targetNamespace="http://www.topografix.com/GPX/1/1">
 <xsd:element name="gpx"><xsd:complexType><xsd:sequence>
  <xsd:element name="metadata" minOccurs="0"><xsd:complexType><xsd:sequence>
   <xsd:element name="name" type="xsd:string" minOccurs="0"/>
   <xsd:element name="desc" type="xsd:string" minOccurs="0"/>
   <xsd:element name="time" type="xsd:dateTime" minOccurs="0"/>
  </xsd:sequence></xsd:complexType></xsd:element>
  <xsd:element name="wpt" type="wptType" minOccurs="0" maxOccurs="unbounded"/>
  <xsd:element name="trk" minOccurs="0" maxOccurs="unbounded"><xsd:complexType>
   <xsd:sequence><xsd:element name="name" type="xsd:string" minOccurs="0"/>
    <xsd:element name="desc" type="xsd:string" minOccurs="0"/>
    <xsd:element name="trkseg" minOccurs="0" maxOccurs="unbounded"><xsd:complexType>
     <xsd:sequence><xsd:element name="trkpt" type="wptType" minOccurs="0"
      maxOccurs="unbounded"/></xsd:sequence></xsd:complexType></xsd:element>
   </xsd:sequence></xsd:complexType></xsd:element>
  </xsd:sequence>
  <xsd:attribute name="version" fixed="1.1" use="required"/>
  <xsd:attribute name="creator" type="xsd:string" use="required"/>
 </xsd:complexType></xsd:element>
 <xsd:complexType name="wptType"><xsd:sequence>
  <xsd:element name="ele" type="xsd:decimal" minOccurs="0"/>
  <xsd:element name="time" type="xsd:dateTime" minOccurs="0"/>
  <xsd:element name="name" type="xsd:string" minOccurs="0"/>
  <xsd:element name="desc" type="xsd:string" minOccurs="0"/>
  <xsd:element name="type" type="xsd:string" minOccurs="0"/>
 </xsd:sequence>
 <xsd:attribute name="lat" use="required"><xsd:simpleType>
  <xsd:restriction base="xsd:decimal"><xsd:minInclusive value="-90"/>
   <xsd:maxInclusive value="90"/></xsd:restriction></xsd:simpleType></xsd:attribute>
 <xsd:attribute name="lon" use="required"><xsd:simpleType>
  <xsd:restriction base="xsd:decimal"><xsd:minInclusive value="-180"/>
   <xsd:maxExclusive value="180"/></xsd:restriction></xsd:simpleType></xsd:attribute>
 </xsd:complexType>
</xsd:schema>
"""


@pytest.fixture(scope="module")
def survey(write_flight: WriteFlight) -> Survey:
    return read_survey(write_flight())


@pytest.fixture(scope="module")
def files(survey: Survey, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The survey in every format."""
    return exported(survey, tmp_path_factory.mktemp("out"))


def rows_of(table: bytes | str) -> list[dict[str, str]]:
    text = table if isinstance(table, str) else table.decode()
    return list(csv.DictReader(io.StringIO(text)))


def features_of(files: dict[str, bytes], layer: str) -> list[dict[str, Any]]:
    """Properties of what lies in a layer of the GeoJSON file."""
    features = json.loads(files["flight.geojson"])["features"]
    return [one["properties"] for one in features if one["properties"]["layer"] == layer]


def exported(survey: Survey, directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in export_survey(survey, directory)}


def test_every_format_is_written_and_says_where_the_tag_is(
    survey: Survey, files: dict[str, bytes]
) -> None:
    assert survey.tag_ids == (2, 3)
    found = some(survey.position_of(2))
    place = f"{some(found.position).latitude_deg:.4f}"
    for name in ("fixes.csv", "positions.csv", "flight.geojson", "flight.gpx", "movebank.csv"):
        assert place[:-1] in files[name].decode(), name
    assert set(files) >= {"flight.kmz", "flight.gpkg", "heat_tag_2.tif", "Pulse-uavrt.csv"}


def test_geojson_follows_rfc_7946(files: dict[str, bytes]) -> None:
    collection = json.loads(files["flight.geojson"])
    assert collection["type"] == "FeatureCollection"
    assert "crs" not in collection
    layers = {feature["properties"]["layer"] for feature in collection["features"]}
    assert layers == {
        *("track", "pulse", "bearing", "bearing 90 %", "position", "position 95 %"),
        *("region 50 %", "region 95 %"),
    }
    for feature in collection["features"]:
        assert set(feature) == {"type", "geometry", "properties"}
        kind, coordinates = feature["geometry"]["type"], feature["geometry"]["coordinates"]
        if kind == "Polygon":
            (ring,) = coordinates
            assert len(ring) >= 4
            assert ring[0] == ring[-1]
            assert signed_area(ring) > 0.0  # right-hand rule: outer rings counter-clockwise
        points = {"Point": [coordinates], "LineString": coordinates}.get(kind)
        for longitude, latitude in points if points else coordinates[0]:
            assert -180.0 <= longitude <= 180.0
            assert -90.0 <= latitude <= 90.0


def signed_area(ring: list[list[float]]) -> float:
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairwise(ring))


def test_a_line_over_the_date_line_is_cut_there() -> None:
    parts = split_at_date_line([(179.0, 10.0), (-179.0, 12.0), (-178.0, 12.0)])
    assert parts == [
        [(179.0, 10.0), (180.0, 11.0)],
        [(-180.0, 11.0), (-179.0, 12.0), (-178.0, 12.0)],
    ]


def test_an_area_over_the_date_line_is_cut_there() -> None:
    area = [(179.5, 10.0), (-179.5, 10.0), (-179.5, 11.0), (179.5, 11.0), (179.5, 10.0)]
    parts = split_area_at_date_line(area)
    assert sorted(sorted(set(part)) for part in parts) == [
        [(-180.0, 10.0), (-180.0, 11.0), (-179.5, 10.0), (-179.5, 11.0)],
        [(179.5, 10.0), (179.5, 11.0), (180.0, 10.0), (180.0, 11.0)],
    ]
    for part in parts:
        assert part[0] == part[-1]
        assert signed_area([list(point) for point in part]) == pytest.approx(1.0)
    inside = [(8.0, 47.0), (9.0, 47.0), (9.0, 48.0), (8.0, 47.0)]
    assert split_area_at_date_line(inside) == [inside]


@pytest.mark.parametrize("latitude", [89.9, -89.9])
@pytest.mark.parametrize("first", [-116.0, 180.0, 5.0])
def test_an_area_around_a_pole_reaches_up_to_it(latitude: float, first: float) -> None:
    step = math.copysign(10.0, latitude)  # counter-clockwise as seen from above
    ring = [(math.remainder(first + step * n, 360.0), latitude) for n in range(36)]
    parts = split_area_at_date_line([*ring, ring[0]])
    points = [point for part in parts for point in part]
    assert min(lon for lon, _ in points) == -180.0
    assert max(lon for lon, _ in points) == 180.0
    assert {abs(lat) for _, lat in points} == {abs(latitude), 90.0}
    areas = [signed_area([list(point) for point in part]) / 2 for part in parts]
    assert min(areas) > 0.0
    assert sum(areas) == pytest.approx(36.0)


def test_gpx_is_valid_by_its_schema(files: dict[str, bytes]) -> None:
    content = files["flight.gpx"]
    schema = etree.XMLSchema(etree.fromstring(GPX_SCHEMA))
    schema.assertValid(etree.fromstring(content))
    assert content.count(b"<trkpt") == pytest.approx(240, abs=2)


def test_kmz_opens_without_network_and_carries_what_it_names(files: dict[str, bytes]) -> None:
    archive = zipfile.ZipFile(io.BytesIO(files["flight.kmz"]))
    assert archive.testzip() is None
    assert archive.namelist()[0] == "doc.kml"
    text = archive.read("doc.kml").decode()
    assert re.findall(r"https?://[^\"]*", text) == ["http://www.opengis.net/kml/2.2"]
    assert "NetworkLink" not in text
    space = "{http://www.opengis.net/kml/2.2}"
    root = ET.fromstring(text)
    for link in root.iter(f"{space}href"):
        assert link.text in archive.namelist()
    styles = {style.get("id") for style in root.iter(f"{space}Style")}
    used = {(url.text or "").removeprefix("#") for url in root.iter(f"{space}styleUrl")}
    assert used <= styles
    names = [name.text for name in root.iter(f"{space}name")]
    assert "tag 2 Kiwi & <Chick>" in names
    assert "tag 3" in names  # listed, never heard: a folder without a position
    picture = Image.open(io.BytesIO(archive.read("files/heat_2.png")))
    assert picture.mode == "RGBA"
    assert np.asarray(picture)[..., 3].max() > 150


def test_another_library_reads_the_gpx_as_it_was_meant(
    survey: Survey, files: dict[str, bytes]
) -> None:
    import gpxpy

    read = gpxpy.parse(files["flight.gpx"].decode())
    assert read.version == "1.1"
    found = some(some(survey.position_of(2)).position)
    (waypoint,) = read.waypoints
    assert waypoint.latitude == pytest.approx(found.latitude_deg, abs=1e-7)
    assert waypoint.longitude == pytest.approx(found.longitude_deg, abs=1e-7)
    (track,) = read.tracks
    points = [point for segment in track.segments for point in segment.points]
    assert len(points) > 200
    assert points[0].latitude == pytest.approx(survey.track[0].latitude_deg, abs=1e-7)
    bounds = read.get_time_bounds()
    lasted_s = (some(bounds.end_time) - some(bounds.start_time)).total_seconds()
    assert lasted_s == pytest.approx(
        (survey.track[-1].time_ns - survey.track[0].time_ns) / 1e9, abs=1.5
    )


def test_geopackage_has_its_identity_its_tables_and_geometries_that_can_be_read(
    survey: Survey, tmp_path: Path
) -> None:
    export_survey(survey, tmp_path, ["geopackage"])
    database = sqlite3.connect(tmp_path / "flight.gpkg")
    assert database.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert database.execute("PRAGMA foreign_key_check").fetchall() == []
    systems = {row[0] for row in database.execute("SELECT srs_id FROM gpkg_spatial_ref_sys")}
    assert systems == {-1, 0, 4326}
    layers = dict(
        database.execute("SELECT table_name, geometry_type_name FROM gpkg_geometry_columns")
    )
    assert layers == {
        "pulses": "POINT",
        "track": "LINESTRING",
        "bearings": "LINESTRING",
        "bearing_wedges": "POLYGON",
        "positions": "POINT",
        "regions95": "POLYGON",
        "region_outlines": "LINESTRING",
    }
    count = len(survey.pulse_poses)
    assert database.execute("SELECT count(*) FROM pulses").fetchone() == (count,)
    for table in layers:
        (blob,) = database.execute(f"SELECT geom FROM {table}").fetchone()
        magic, version, flags, system = struct.unpack_from("<2sBBi", blob)
        assert (magic, version, flags, system) == (b"GP", 0, 1, 4326)
        order, kind = struct.unpack_from("<BI", blob, 8)
        assert order == 1
        assert kind == {"POINT": 1, "LINESTRING": 2, "POLYGON": 3}[layers[table]]
    for table in layers:
        (count,) = database.execute(f"SELECT count(*) FROM rtree_{table}_geom").fetchone()
        assert database.execute(f"SELECT count(*) FROM {table}").fetchone() == (count,)
        (style,) = database.execute(
            "SELECT styleQML FROM layer_styles WHERE f_table_name = ? AND useAsDefault",
            (table,),
        ).fetchone()
        assert ET.fromstring(style.partition(">")[2]).tag == "qgis"
    (west,) = database.execute("SELECT minx FROM rtree_positions_geom").fetchone()
    (blob,) = database.execute("SELECT geom FROM positions").fetchone()
    assert west == pytest.approx(struct.unpack_from("<d", blob, 13)[0], abs=1e-4)
    for table in ("pulses", "bearings", "positions", "regions95"):
        kinds = {row[1]: row[2] for row in database.execute(f"PRAGMA table_info({table})")}
        assert kinds["time"] == "DATETIME"
        (time,) = database.execute(f"SELECT max(time) FROM {table}").fetchone()
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", time)
    found = some(some(survey.position_of(2)).position)
    expected = (found.longitude_deg, found.latitude_deg)
    assert struct.unpack_from("<dd", blob, 13) == expected
    database.close()


def test_a_geopackage_is_cut_at_the_date_line(
    write_flight: WriteFlight, scenario_of: Callable[[int], Scenario], tmp_path: Path
) -> None:
    there = scenario_of(1)
    there = replace(there, home=replace(there.home, longitude_deg=179.998))
    survey = read_survey(write_flight(scenario=there, name="date_line"))
    export_survey(survey, tmp_path, ["geopackage"])
    layers = tmp_path / "flight.gpkg"
    for table in ("track", "bearings", "bearing_wedges", "regions95", "region_outlines"):
        sides = sql(layers, f"SELECT minx, maxx FROM rtree_{table}_geom")
        assert all(east - west < 1.0 for west, east in sides), table
    tracks = sql(layers, "SELECT minx FROM rtree_track_geom")
    assert {west < 0.0 for (west,) in tracks} == {False, True}


def test_the_geotiff_lies_where_the_map_lies_and_is_read_by_another_library(
    survey: Survey, tmp_path: Path
) -> None:
    export_survey(survey, tmp_path, ["geotiff"])
    picture = Image.open(tmp_path / "heat_tag_2.tif")
    assert isinstance(picture, TiffImageFile)
    pixels = np.asarray(picture)
    assert picture.mode == "F"
    assert pixels.sum() == pytest.approx(1.0, abs=1e-3)
    scale_x, scale_y, _ = picture.tag_v2[33550]
    _, _, _, west, north, _ = picture.tag_v2[33922]
    keys = picture.tag_v2[34735]
    assert (2048, 0, 1, 4326) in {tuple(keys[i : i + 4]) for i in range(0, len(keys), 4)}
    row, column = np.unravel_index(np.argmax(pixels), pixels.shape)
    found = some(some(survey.position_of(2)).position)
    east = west + (column + 0.5) * scale_x
    assert east == pytest.approx(found.longitude_deg, abs=2 * scale_x)
    south = north - (row + 0.5) * scale_y
    assert south == pytest.approx(found.latitude_deg, abs=2 * scale_y)


def test_a_geotiffs_first_row_is_the_north_whichever_way_the_grid_runs() -> None:
    axis = np.array([-50.0, 0.0, 50.0])
    probability = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.7, 0.3]])
    maps = [
        PositionGrid(
            latitude_deg=-40.0,
            longitude_deg=175.0,
            east_m=axis,
            north_m=north,
            probability=values,
        )
        for north, values in ((axis, probability), (axis[::-1], probability[::-1]))
    ]
    first, second = (geotiff_bytes(one, "t") for one in maps)
    assert first == second
    assert np.asarray(Image.open(io.BytesIO(first)))[0].tolist() == pytest.approx([0, 0.7, 0.3])


def test_csv_comes_back_as_it_was(survey: Survey, tmp_path: Path) -> None:
    export_survey(survey, tmp_path, ["csv", "uavrt"])
    back = read_pulse_file(tmp_path / "pulses.csv")
    assert [one.pulse for one in back] == [one.pulse for one in survey.pulse_poses]
    for again, one in zip(read_pulses(tmp_path / "Pulse-uavrt.csv"), back, strict=True):
        pose, own = some(again.pose), some(one.pose)
        assert pose.latitude_deg == pytest.approx(own.latitude_deg, abs=1e-7)
        assert pose.longitude_deg == pytest.approx(own.longitude_deg, abs=1e-7)
        assert abs(again.pulse.start_time_ns - one.pulse.start_time_ns) <= 500
    bearings = read_bearing_file(tmp_path / "bearings.csv")
    assert len(bearings) == len(survey.bearings) == 3
    (position,) = read_position_file(tmp_path / "positions.csv")
    assert position.mle is not None
    assert position.mest is not None


def test_movebank_rows_have_its_columns(survey: Survey, files: dict[str, bytes]) -> None:
    (row,) = rows_of(files["movebank.csv"])
    assert row["individual-local-identifier"] == "Kiwi & <Chick>"
    assert row["sensor-type"] == "radio-transmitter"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}", row["timestamp"])
    assert float(row["location-error-numerical"]) > 0.0
    assert row["location-error-percentile"] == "95"
    assert row["algorithm-marked-outlier"] == "false"
    assert all(cell for cell in row.values()), "no column is empty"
    worn = rows_of(movebank_reference_csv(survey))
    assert [one["tag-id"] for one in worn] == ["2", "3"]
    assert worn[0]["animal-id"] == row["individual-local-identifier"]


CONTRADICTED = (
    Caution(name="contradiction", text="bearing 2 contradicts the others"),
    Caution(name="compass", text="the headings seem 12° off"),
)


def cautioned(survey: Survey, cautions: tuple[Caution, ...]) -> Survey:
    """The same flight, whose tag 2 has a position of which something must be told."""
    positions = [
        replace(one, position=replace(one.position, cautions=cautions))
        if one.position is not None
        else one
        for one in survey.positions
    ]
    return replace(survey, positions=tuple(positions))


def test_every_export_tells_what_makes_a_position_less_sure(
    survey: Survey, tmp_path: Path
) -> None:
    doubted = cautioned(survey, CONTRADICTED)
    files = exported(doubted, tmp_path)
    fix, _ = rows_of(files["fixes.csv"])
    (place,) = features_of(files, "position")
    names = ("cautions", "cautions_in_words")
    (values,) = sql(tmp_path / "flight.gpkg", f"SELECT {', '.join(names)} FROM positions")
    row = dict(zip(names, values, strict=True))
    for told in (fix, place, row):
        assert told["cautions"] == "contradiction, compass"
        assert told["cautions_in_words"] == "; ".join(one.text for one in CONTRADICTED)
    with zipfile.ZipFile(io.BytesIO(files["flight.kmz"])) as kmz:
        for text in (files["flight.gpx"], kmz.read("doc.kml"), files["movebank.csv"]):
            assert CONTRADICTED[0].text.encode() in text
    (event,) = rows_of(files["movebank.csv"])
    assert event["algorithm-marked-outlier"] == "true"
    (event,) = rows_of(movebank_csv(cautioned(survey, CONTRADICTED[1:])))
    assert event["algorithm-marked-outlier"] == "false"


def test_marks_are_a_layer_and_a_table(survey: Survey, tmp_path: Path) -> None:
    at_ns = survey.track[5].time_ns
    note = (at_ns, mark_note(47.1, 8.2, "nest, 飛行"))
    files = exported(replace(survey, notes=(note,)), tmp_path)
    (mark,) = rows_of(files["marks.csv"])
    assert mark["text"] == "nest, 飛行"
    assert mark["time_utc"] == iso_utc(at_ns)
    assert (float(mark["latitude_deg"]), float(mark["longitude_deg"])) == (47.1, 8.2)
    ((blob, time, text),) = sql(tmp_path / "flight.gpkg", "SELECT geom, time, text FROM marks")
    assert struct.unpack_from("<dd", blob, 13) == (8.2, 47.1)
    assert time[:19] == iso_utc(at_ns)[:19]
    assert text == "nest, 飛行"
    again = exported(survey, tmp_path)
    assert "marks.csv" not in again, "marks of an earlier export are not this flight's"


def test_beeps_are_a_sensorgnomes_pulses_and_detections_too(
    survey: Survey, tmp_path: Path
) -> None:
    """Each beep is a line and, where it is confirmed, a detection; ours reads both back."""
    export_survey(survey, tmp_path, ["motus"])
    beeps = [one.pulse for one in survey.pulse_poses]
    lines = read_pulse_log(tmp_path / "sensorgnome.txt").pulse_poses
    assert len(lines) == len(beeps) > 50
    for again, beep in zip(lines, beeps, strict=True):
        assert again.pulse.frequency_hz == pytest.approx(beep.frequency_hz, abs=1.0)
        assert again.pulse.snr_db == pytest.approx(beep.snr_db, abs=0.02)
    confirmed = [beep for beep in beeps if beep.confirmed]
    found = read_pulse_log(tmp_path / "detections.csv").pulse_poses
    assert [one.pulse.tag_id for one in found] == [beep.tag_id for beep in confirmed]
    rows = rows_of((tmp_path / "detections.csv").read_bytes())
    assert {row["name"] for row in rows} == {"Kiwi & <Chick>"}
    assert {row["slop"] for row in rows} == {""}, "a beep has no gaps inside"
    assert all(abs(float(row["burstSlop"])) < 0.1 for row in rows)


def of_vehicle(survey: Survey, name: str) -> Survey:
    """The same flight, of which a ground station noted whose it is."""
    return replace(survey, notes=((survey.track[0].time_ns, vehicle_note(2, name)),))


def test_every_export_names_the_vehicle_that_flew(survey: Survey, tmp_path: Path) -> None:
    """Files of several vehicles are laid over each other: each thing tells whose it is."""
    files = exported(of_vehicle(survey, "mast & Söhne"), tmp_path)
    for name in ("fixes.csv", "track.csv"):
        assert {row["vehicle"] for row in rows_of(files[name])} == {"2, mast & Söhne"}, name
    features = json.loads(files["flight.geojson"])["features"]
    assert {one["properties"].get("vehicle") for one in features} == {"2, mast & Söhne"}
    for layer in ("pulses", "track", "bearings", "positions", "regions95"):
        told = set(sql(tmp_path / "flight.gpkg", f"SELECT vehicle FROM {layer}"))
        assert told == {("2, mast & Söhne",)}, layer
    gpx = etree.fromstring(files["flight.gpx"])
    for place in ("metadata/{*}desc", "wpt/{*}desc", "trk/{*}desc"):
        described = some(gpx.find("{*}" + place))
        assert "vehicle 2, mast & Söhne" in (described.text or "")
    etree.XMLSchema(etree.fromstring(GPX_SCHEMA)).assertValid(gpx)
    for content in (files["flight.kml"], kml_of(files["flight.kmz"])):
        document = etree.fromstring(content)[0]
        assert [child.tag.rpartition("}")[2] for child in document[:2]] == [
            *("name", "description")
        ]
        assert document[1].text == "vehicle 2, mast & Söhne"
        assert content.decode().count("vehicle 2, mast &amp; Söhne") >= 3
    (event,) = rows_of(files["movebank.csv"])
    assert event["comments"] == "vehicle 2, mast & Söhne"


def kml_of(kmz: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(kmz)) as archive:
        return archive.read("doc.kml")


def test_a_flight_of_one_vehicle_that_nobody_named_has_no_empty_texts_about_it(
    files: dict[str, bytes],
) -> None:
    fix, _ = rows_of(files["fixes.csv"])
    assert fix["vehicle"] == ""
    assert b"vehicle" not in files["flight.gpx"] + files["flight.kml"] + files["movebank.csv"]
    assert "comments" not in files["movebank.csv"].decode().splitlines()[0]


@pytest.mark.parametrize("form", EXPORT_FORMATS)
def test_a_flight_of_any_name_is_exported_in_each_format(
    survey: Survey, tmp_path: Path, form: str
) -> None:
    named = replace(survey, name="飛行 <1>", notes=((survey.track[0].time_ns, "巣"),))
    written = export_survey(named, tmp_path / "飛行", [form])
    assert written
    assert all(path.stat().st_size for path in written)
    inside = b"".join(path.read_bytes() for path in written)
    if form in ("kml", "gpx", "movebank"):
        assert "飛行".encode() in inside


def test_a_turn_without_a_clear_direction_is_no_bearing_of_the_original_s_file(
    survey: Survey, tmp_path: Path
) -> None:
    """Its lines have no verdict: localize of an export took noise for a bearing ± 13°."""
    first, *others = survey.bearings
    unclear = replace(first, bearing=replace(first.bearing, evidence=-5.0))
    assert not unclear.bearing.accepted
    files = exported(replace(survey, bearings=(unclear, *others)), tmp_path)
    lines = files["bearings.csv"].decode().splitlines()
    assert len(lines) == len(others)
    assert not any(f"{first.bearing.bearing_deg:.6f}" in line for line in lines)
    told = features_of(files, "bearing")
    assert [one["accepted"] for one in told] == [False, *[True] * len(others)]


def test_positions_carry_the_time_of_their_last_bearing(
    survey: Survey, files: dict[str, bytes]
) -> None:
    time = iso_utc(max(one.end_time_ns for one in survey.bearings_of(2)))
    (_, fix, _) = files["fixes.csv"].decode().splitlines()
    assert time in fix.split(",")
    for layer in ("position", "position 95 %"):
        (one,) = features_of(files, layer)
        assert one["time"] == time
    waypoint = some(etree.fromstring(files["flight.gpx"]).find("{*}wpt/{*}time"))
    assert waypoint.text == time


@pytest.mark.parametrize("poses", [True, False])
def test_a_flight_that_heard_nothing_is_exported_without_failing(
    write_flight: WriteFlight, tmp_path: Path, poses: bool
) -> None:
    survey = read_survey(write_flight(heard=0, poses=poses))
    files = exported(survey, tmp_path / "out")
    assert json.loads(files["flight.geojson"])["type"] == "FeatureCollection"
    assert b"no bearing was taken" in files["fixes.csv"]


def test_a_foreign_log_is_exported_like_a_flight(survey: Survey, tmp_path: Path) -> None:
    export_survey(survey, tmp_path, ["uavrt"])
    again = read_survey(tmp_path / "Pulse-uavrt.csv")
    assert again.kind == "tagtracker"
    one, other = (some(some(of.position_of(2)).position) for of in (survey, again))
    north_deg = one.latitude_deg - other.latitude_deg
    east_deg = one.longitude_deg - other.longitude_deg
    assert 111_000 * math.hypot(north_deg, east_deg) < 30.0
    exported(again, tmp_path / "again")
