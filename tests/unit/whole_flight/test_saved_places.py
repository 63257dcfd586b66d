"""What a whole flight found is kept whole: each place, its regions, what was looked for."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import numpy as np
import pytest
from command_line import uavrt
from sql import sql
from tests.unit.whole_flight.conftest import RATE_HZ, WINDOW_HZ, Rotation
from tests.unit.whole_flight.test_from_arrays_and_tracks import FIXED

from uavrt.analysis.export.geojson import geojson_text
from uavrt.analysis.export.geopackage import write_geopackage
from uavrt.analysis.export.kmz import kml_text
from uavrt.analysis.report.report_words import hindsight
from uavrt.analysis.survey import read_survey
from uavrt.config.settings import Settings
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError
from uavrt.core.messages import Pose, Tag
from uavrt.flight.integrated import read_integrated
from uavrt_experiments.detection.signals import START_NS
from uavrt_experiments.integrate.flights import PLANE, World, add_pulses, passing, silence


def flight_with(
    directory: Path, tag: Tag, poses: tuple[Pose, ...], settings: Settings | None
) -> None:
    info = made.flight_info(
        directory,
        (tag,),
        start_time_ns=START_NS,
        center_frequency_hz=tag.frequency_hz,
        sample_rate_hz=RATE_HZ,
    )
    made.flight(info, settings, poses=poses)


def arguments(directory: Path, samples: np.ndarray, tag: Tag, *more: str) -> list[str]:
    path = directory.with_suffix(".cf32")
    samples.tofile(path)
    return [
        *("integrate", str(directory), "--recording", str(path), "--sample-rate"),
        *(str(RATE_HZ), "--center-frequency", str(tag.frequency_hz), "--start-time"),
        *("2023-11-14T22:13:20Z", *more),
    ]


def test_both_places_of_a_straight_pass_with_a_whip_are_kept_and_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    flight_with(tmp_path / "pass", world.tag, poses, whip)
    asked = arguments(tmp_path / "pass", samples, world.tag, "--frequency-window", "60")
    assert uavrt(*asked, "--json") == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert (said["antenna"], said["antenna_assumed"]) == ("monopole", False)
    assert said["enr_db"] == pytest.approx(8.0, abs=1.5)
    (verdict,), _ = read_integrated(tmp_path / "pass")
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
    assert verdict.searched is not None
    assert verdict.searched.frequency_window_hz == 60.0
    assert verdict.searched.antenna == "monopole"
    survey = read_survey(tmp_path / "pass")
    features = json.loads(geojson_text(survey))["features"]
    layers = {one["properties"]["layer"]: one for one in features}
    both = [one for one in features if one["properties"]["layer"] == "integrated place"]
    assert len(both) == 2
    kml = kml_text(survey)
    for one in verdict.parts:
        assert f"{one.longitude_deg:.8f},{one.latitude_deg:.8f}" in kml
    assert kml.count("<LinearRing>") == len(verdict.region95)
    write_geopackage(survey, tmp_path / "pass.gpkg")
    saved = tmp_path / "pass.gpkg"
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
    weak: Rotation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight_with(tmp_path / "old", weak.tag, weak.flight.poses, None)
    asked = arguments(
        tmp_path / "old", weak.samples, weak.tag, "--frequency-window", str(WINDOW_HZ)
    )
    assert uavrt(*asked) == 0
    words = capsys.readouterr().out
    assert "antenna: RA-23K" in words
    assert "antenna not specified" in words
    (verdict,), _ = read_integrated(tmp_path / "old")
    assert "antenna not specified" in verdict.remarks
    assert verdict.searched is not None
    assert verdict.searched.antenna_assumed
    assert uavrt(*asked, "--json", "--antenna", "RA-23K", "--no-save") == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert not said["antenna_assumed"]
    (rest,) = said["limitations"]
    assert rest.startswith("the position assumes that the tag was at rest")
    assert set(FIXED) <= set(said)
    assert said["pulses"] == sum(one["at_rate"] for one in said["integrated_pulses"])


def test_a_tag_outside_the_window_is_missed_and_its_silence_says_nothing(
    weak: Rotation, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert abs(weak.offset_hz) > 10.0
    flight_with(tmp_path / "narrow", weak.tag, weak.flight.poses, Settings())
    asked = arguments(tmp_path / "narrow", weak.samples, weak.tag, "--frequency-window", "2")
    uavrt(*asked)
    capsys.readouterr()
    assert uavrt("coverage", str(tmp_path / "narrow"), "--tag-power", "-30", "--json") == 0
    (said,) = json.loads(capsys.readouterr().out)
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
def test_damaged_places_are_named(
    weak: Rotation, tmp_path: Path, name: str, value: object
) -> None:
    flight_with(tmp_path / "damaged", weak.tag, weak.flight.poses, None)
    record = {
        "tag_id": 2,
        "found": False,
        "false_alarm_probability": 0.5,
        "interval_s": 1.2,
        "frequency_hz": 148.7e6,
    }
    (tmp_path / "damaged" / "integrated").mkdir()
    file = tmp_path / "damaged" / "integrated" / "tags.json"
    file.write_text(json.dumps([record]))
    assert read_integrated(tmp_path / "damaged")[0][0].searched is None
    file.write_text(json.dumps([record | {name: value}]))
    with pytest.raises(FormatError, match="integrate again"):
        read_integrated(tmp_path / "damaged")
