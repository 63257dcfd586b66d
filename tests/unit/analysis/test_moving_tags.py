"""Flights past animals that walk: command line, report, exports and page follow them."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import made
import numpy as np
import pytest
from command_line import Ran
from some import some
from sql import sql
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.export.csv_tables import bearing_rows, movebank_csv, tag_paths_csv
from uavrt.analysis.export.geojson import geojson_text
from uavrt.analysis.export.geopackage import write_geopackage
from uavrt.analysis.export.gpx import NAMESPACE, gpx_text
from uavrt.analysis.export.kmz import kml_text
from uavrt.analysis.report import report_words as words
from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.clock import iso_utc, utc_text
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.formats.bearings_csv import write_bearing_file
from uavrt.ground.store.estimates import AntennaChoice, Estimator
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.localization.estimates.flight_estimates import EstimationOptions
from uavrt.localization.results import Position
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Scenario, SimulatedTag

pytestmark = pytest.mark.slow

WALKER, RESTING = 2, 3
WALK_M_S = 0.6


def past_a_walker() -> Scenario:
    """Six turns around two tags: one walks to the east, one rests."""
    places = [(300.0 * np.cos(a), 300.0 * np.sin(a)) for a in np.radians(np.arange(0, 360, 60))]
    legs = []
    for north, east in places:
        legs += [
            Leg(duration_s=35.0, north_m=float(north), east_m=float(east), height_m=40.0),
            Leg(duration_s=60.0, turn_deg=360.0),
        ]

    def tag(number: int, north_m: float, east_m: float, speed_m_s: float) -> SimulatedTag:
        return made.simulated_tag(
            number,
            148.6e6 + 25e3 * number,
            north_m=north_m,
            east_m=east_m,
            speed_m_s=speed_m_s,
            heading_deg=90.0,
            erp_dbm=-28.0,
        )

    tags = (tag(WALKER, 40.0, -170.0, WALK_M_S), tag(RESTING, -60.0, 50.0, 0.0))
    return Scenario(
        name="walker",
        seed=11,
        duration_s=sum(leg.duration_s for leg in legs),
        flight=Flight(north_m=0.0, east_m=0.0, leg=tuple(legs)),
        tag=tags,
    )


@pytest.fixture(scope="module")
def place(write_flight: WriteFlight) -> Path:
    return write_flight(heard=2, scenario=past_a_walker(), name="flight_log_walker")


@pytest.fixture(scope="module")
def survey(place: Path) -> Survey:
    return read_survey(place)


def way_of(survey: Survey, tag_id: int) -> Position:
    found = some(survey.position_of(tag_id))
    return some(found.position)


def test_the_walker_is_followed_and_the_resting_tag_keeps_its_place(survey: Survey) -> None:
    scenario = past_a_walker()
    plane = TangentPlane(
        latitude_deg=scenario.home.latitude_deg, longitude_deg=scenario.home.longitude_deg
    )
    walker = way_of(survey, WALKER)
    assert [one.name for one in walker.cautions] == ["walk"]
    held = []
    for one in walker.track:
        east, north = plane.to_local(one.latitude_deg, one.longitude_deg)
        since_s = (one.time_ns - scenario.start_time_ns) * 1e-9
        miss_m = float(np.hypot(east + 170.0 - WALK_M_S * since_s, north - 40.0))
        held.append(miss_m <= one.radius95_m)
    assert np.mean(held) >= 0.8
    assert len(held) > 20
    resting = way_of(survey, RESTING)
    assert resting.track == ()
    east, north = plane.to_local(resting.latitude_deg, resting.longitude_deg)
    assert np.hypot(east - 50.0, north + 60.0) < 25.0


def test_bearings_of_a_file_are_of_the_middle_of_their_turns(
    survey: Survey, tmp_path: Path
) -> None:
    """They were taken for those of the turns' beginnings: half a turn's walk apart."""
    path = tmp_path / "bearings.csv"
    write_bearing_file(path, bearing_rows(survey, "flight.csv"))
    told = {one.tag_id: one.position for one in read_positions(path)}
    walker, own = some(told[WALKER]), way_of(survey, WALKER)
    assert abs(walker.track[0].time_ns - own.track[0].time_ns) < 1e9
    assert abs(walker.track[-1].time_ns - own.track[-1].time_ns) < 1e9


def test_bearings_of_a_file_from_several_days_tell_no_walk(
    survey: Survey, tmp_path: Path
) -> None:
    path = tmp_path / "bearings.csv"
    rows = [one for one in bearing_rows(survey, "flight.csv") if one.tag_id == WALKER]
    day_ns = 86_400 * 10**9
    days = [
        replace(
            one,
            start_time_ns=some(one.start_time_ns) + number * day_ns,
            end_time_ns=some(one.end_time_ns) + number * day_ns,
        )
        for number, one in enumerate(rows)
    ]
    write_bearing_file(path, days)
    (walker,) = read_positions(path)
    position = some(walker.position)
    assert position.track == ()
    assert "walk" not in {one.name for one in position.cautions}
    (followed,) = read_positions(path, how=EstimationOptions(method="track"))
    assert followed.position is None
    assert "of one flight" in (followed.reason or "")


def test_command_line_and_report_give_the_same_way(place: Path, survey: Survey) -> None:
    told = {one.tag_id: one.position for one in read_positions(place)}
    walker = some(told[WALKER])
    assert walker.track == way_of(survey, WALKER).track


def test_the_command_line_prints_the_way_of_each_tag(place: Path, ran: Ran) -> None:
    records = ran("localize", place, "--method", "track", "--json").json
    told = {one["tag_id"]: one for one in records}
    assert set(told) == {WALKER, RESTING}
    for one in told.values():
        assert one["method"] == "track"
        times = [each["time_ns"] for each in one["track"]]
        assert times == sorted(times)
        assert len(times) > 20
        for each in one["track"]:
            assert 0.0 < each["radius50_m"] < each["radius95_m"]
            assert each["time"].endswith("Z")


def test_exports_carry_the_way_with_its_times(survey: Survey, tmp_path: Path) -> None:
    way = way_of(survey, WALKER).track
    features = json.loads(geojson_text(survey))["features"]
    lines = [one for one in features if one["properties"]["layer"] == "tag track"]
    points = [one for one in features if one["properties"]["layer"] == "tag track place"]
    assert [one["properties"]["tag_id"] for one in lines] == [WALKER]
    assert len(points) == len(lines[0]["geometry"]["coordinates"]) == len(way)
    assert all({"time", "radius50_m", "radius95_m"} <= set(p["properties"]) for p in points)

    tracks = ET.fromstring(gpx_text(survey)).findall(f"{{{NAMESPACE}}}trk")
    assert len(tracks) == 2  # the drone's and the walker's
    assert len(tracks[1].findall(f".//{{{NAMESPACE}}}time")) == len(way)

    assert f"tag {WALKER} track" in kml_text(survey)

    write_geopackage(survey, tmp_path / "flight.gpkg")
    counted = sql(tmp_path / "flight.gpkg", "SELECT count(*) FROM tag_tracks")
    assert counted == [(len(way),)]


def test_tables_have_the_way_with_a_row_for_each_time(survey: Survey) -> None:
    way = way_of(survey, WALKER).track
    rows = list(csv.DictReader(io.StringIO(tag_paths_csv(survey))))
    assert [one["time_utc"] for one in rows] == [iso_utc(one.time_ns) for one in way]
    assert {one["tag_id"] for one in rows} == {str(WALKER)}
    assert [float(one["radius95_m"]) for one in rows] == [
        pytest.approx(one.radius95_m, abs=0.001) for one in way
    ]
    events = list(csv.DictReader(io.StringIO(movebank_csv(survey))))
    assert len({one["event-id"] for one in events}) == len(events) == len(way) + 1
    walked = [one for one in events if one["tag-local-identifier"] == str(WALKER)]
    for event, one in zip(walked, way, strict=True):
        assert float(event["location-lat"]) == pytest.approx(one.latitude_deg, abs=1e-8)
        assert float(event["location-error-numerical"]) == pytest.approx(
            one.radius95_m, abs=0.01
        )
    times = [one["timestamp"] for one in walked]
    assert times == sorted(set(times))


def test_the_page_says_for_which_time_a_walkers_place_stands(place: Path) -> None:
    library = FlightLibrary(place.parent)
    columns, tags = library.columns(place.name), library.summary(place.name).tags
    shown = {
        one["tag_id"]: one
        for one in Estimator().estimate(columns, AntennaChoice(), (), tags).positions
    }
    walker, resting = shown[WALKER], shown[RESTING]
    assert walker["end_time_ns"] == walker["track"][-1]["time_ns"]
    assert "if it moved in a straight line;" in walker["remarks"][-1]
    assert "straight" not in " ".join(resting["remarks"])


def test_a_walkers_place_says_for_which_time_it_stands(
    place: Path, survey: Survey, ran: Ran
) -> None:
    last_ns = way_of(survey, WALKER).track[-1].time_ns
    assert survey.position_time_ns(WALKER) == last_ns
    (walker, resting) = words.findings(survey)
    rows = dict(walker.facts.rows)
    assert rows["Time"] == [f"{utc_text(last_ns)[11:19]} UTC"]
    assert "if it moved in a straight line;" in rows["Caution"][-1]
    assert "if it moved in a straight line;" not in str(resting.facts)
    plain = ran("localize", place).out
    assert "the tag seems to have walked" in plain
    assert plain.count("if it moved in a straight line;") == 1
    assert f"position at {utc_text(last_ns)}" in plain
