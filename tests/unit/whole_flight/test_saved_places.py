"""What a whole flight found is kept whole: each place, its regions, what was looked for."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from command_line import Ran
from some import some
from sql import sql
from tests.unit.whole_flight.conftest import RATE_HZ, WINDOW_HZ, Rotation, flight_info
from tests.unit.whole_flight.test_from_arrays_and_tracks import FIXED

from uavrt.analysis.export.geojson import geojson_text
from uavrt.analysis.export.geopackage import write_geopackage
from uavrt.analysis.export.kmz import kml_text
from uavrt.analysis.report.report_words import hindsight
from uavrt.analysis.survey import read_survey
from uavrt.config.settings import Settings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError
from uavrt.core.messages import Tag
from uavrt.flight.integrated import read_integrated
from uavrt_experiments.integrate.flights import PLANE, World, add_pulses, passing, silence


def arguments(
    flight: Path, samples: np.ndarray, tag: Tag, window_hz: float = WINDOW_HZ
) -> list[object]:
    path = flight.with_suffix(".cf32")
    samples.tofile(path)
    return [
        *("integrate", flight, "--recording", path, "--sample-rate", RATE_HZ),
        *("--center-frequency", tag.frequency_hz, "--start-time", "2023-11-14T22:13:20Z"),
        *("--frequency-window", window_hz),
    ]


@pytest.fixture
def flight(weak: Rotation, tmp_path: Path) -> Path:
    """A flight with a weak tag that does not tell its antenna."""
    info = flight_info(tmp_path / "flight", weak.tag)
    return made.flight(info, poses=weak.flight.poses)


def test_both_places_of_a_straight_pass_with_a_whip_are_kept_and_shown(
    tmp_path: Path, ran: Ran
) -> None:
    world = World(course=passing(200), slack_s=0.02, window_hz=60.0)
    rng = np.random.default_rng(12)
    samples = silence(rng, world.course)
    truth = world.truth(rng)
    add_pulses(rng, samples, world.pulses(rng, truth, 8.0))
    columns = world.course.poses
    poses = tuple(
        made.pose(
            int(time_ns), latitude, longitude, altitude_relative_m=50.0, altitude_amsl_m=1050.0
        )
        for time_ns, latitude, longitude in zip(
            columns.time_ns, columns.latitude_deg, columns.longitude_deg, strict=True
        )
    )
    whip = replace(Settings(), bearings=replace(Settings().bearings, antenna="monopole"))
    flight = made.flight(flight_info(tmp_path / "pass", world.tag), whip, poses=poses)
    (said,) = ran(*arguments(flight, samples, world.tag, 60.0), "--json").json
    assert (said["antenna"], said["antenna_assumed"]) == ("monopole", False)
    assert said["enr_db"] == pytest.approx(8.0, abs=1.5)
    (verdict,), _ = read_integrated(flight)
    assert verdict.places == len(verdict.parts) == 2
    east = [
        float(PLANE.to_local([one.latitude_deg], [one.longitude_deg])[0][0])
        for one in verdict.parts
    ]
    assert sorted(math.copysign(1.0, one) for one in east) == [-1.0, 1.0]
    assert min(map(abs, east)) > 300.0
    assert [len(said["region50"]), len(said["region95"])] == [
        len(verdict.region50),
        len(verdict.region95),
    ]
    searched = some(verdict.searched)
    assert (searched.frequency_window_hz, searched.antenna) == (60.0, "monopole")
    survey = read_survey(flight)
    features = json.loads(geojson_text(survey))["features"]
    layers = {one["properties"]["layer"]: one for one in features}
    both = [one for one in features if one["properties"]["layer"] == "integrated place"]
    assert len(both) == 2
    kml = kml_text(survey)
    for one in verdict.parts:
        assert f"{one.longitude_deg:.8f},{one.latitude_deg:.8f}" in kml
    assert kml.count("<LinearRing>") == len(verdict.region95)
    write_geopackage(survey, saved := tmp_path / "pass.gpkg")
    parts = "SELECT count(*) FROM integrated_regions WHERE share = 95"
    assert sql(saved, "SELECT count(*) FROM integrated_places") == [(2,)]
    assert sql(saved, parts) == [(len(verdict.region95),)]
    told = " ".join(dict(hindsight(survey, 2).rows)["Place"])
    for one in verdict.parts:
        assert f"{one.latitude_deg:.5f}, {one.longitude_deg:.5f}" in told
    assert held(layers["integrated 95 %"], truth.east_m, truth.north_m, PLANE)
    assert held(layers["integrated 95 %"], -truth.east_m, truth.north_m, PLANE)
    assert not held(layers["integrated 95 %"], 0.0, truth.north_m, PLANE)


def held(feature: dict[str, Any], east_m: float, north_m: float, plane: TangentPlane) -> bool:
    """Whether a place lies in an area of a feature, all of whose rings turn to the left."""
    inside = False
    for (ring,) in feature["geometry"]["coordinates"]:
        longitude, latitude = np.array(ring).T
        east, north = plane.to_local(latitude, longitude)
        x, y = east - east_m, north - north_m
        assert (x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0.0
        turned = np.unwrap(np.arctan2(y, x))
        inside |= bool(abs(turned[-1] - turned[0]) > math.pi)
    return inside


def test_a_flight_that_does_not_tell_its_antenna_says_so_in_words_and_json(
    weak: Rotation, flight: Path, ran: Ran
) -> None:
    asked = arguments(flight, weak.samples, weak.tag)
    words = ran(*asked).out
    assert "antenna: RA-23K" in words
    assert "antenna not specified" in words
    (verdict,), _ = read_integrated(flight)
    assert "antenna not specified" in verdict.remarks
    assert some(verdict.searched).antenna_assumed
    (said,) = ran(*asked, "--json", "--antenna", "RA-23K", "--no-save").json
    assert not said["antenna_assumed"]
    (rest,) = said["limitations"]
    assert rest.startswith("the position assumes that the tag was at rest")
    assert set(FIXED) <= set(said)
    assert said["pulses"] == sum(one["at_rate"] for one in said["integrated_pulses"])


def test_a_tag_outside_the_window_is_missed_and_its_silence_says_nothing(
    weak: Rotation, flight: Path, ran: Ran
) -> None:
    assert abs(weak.offset_hz) > 10.0
    ran(*arguments(flight, weak.samples, weak.tag, 2.0), ends=1)
    (said,) = ran("coverage", flight, "--tag-power", -30, "--json").json
    assert not said["whole_flight"]
    assert "frequencies within 2 Hz" in " ".join(said["limitations"])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("parts", [{"latitude_deg": "north"}]),
        ("region95", [[[1.0, math.nan]]]),
        ("searched", {"frequency_hz": 1.0}),
        ("searched", 5),
    ],
)
def test_damaged_places_are_named(flight: Path, name: str, value: object) -> None:
    record = {
        "tag_id": 2,
        "found": False,
        "false_alarm_probability": 0.5,
        "interval_s": 1.2,
        "frequency_hz": 148.7e6,
    }
    file = flight / "integrated" / "tags.json"
    file.parent.mkdir()
    file.write_text(json.dumps([record]))
    assert read_integrated(flight)[0][0].searched is None
    file.write_text(json.dumps([record | {name: value}]))
    with pytest.raises(FormatError, match="integrate again"):
        read_integrated(flight)
