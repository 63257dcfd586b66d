"""Surveys with a monopole: positions from strength, and a strongest signal that says it is not
the tag."""

import json
import math
import struct
import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from report_text import draw_in_report, pictures_in_report, said_in_report
from some import some
from tests.unit.analysis.conftest import WriteFlight
from tests.unit.analysis.test_tags_of_several_logs import CORNER, pings

from uavrt.analysis.estimates.bearings import heard_in_flight
from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.estimates.power_survey import signal_of
from uavrt.analysis.export.written import export_survey
from uavrt.analysis.report import report_words as words
from uavrt.analysis.survey import Survey, read_survey
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.antenna import monopole_gain_db
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    estimate,
    power_track,
)
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.flight import Flight, Leg
from uavrt.simulation.scene.scenario import Scenario

pytestmark = pytest.mark.slow

TAG_NORTH_M, TAG_EAST_M = 140.0, 95.0


def lawnmower() -> Scenario:
    """Five lines over 250 m at 40 m, and up to 75 m over the start at the end."""
    legs = [Leg(duration_s=8.0, height_m=40.0)]
    for number, east in enumerate((0.0, 60.0, 120.0, 180.0, 240.0)):
        legs.append(Leg(duration_s=12.0, east_m=east))
        legs.append(Leg(duration_s=40.0, north_m=250.0 if number % 2 == 0 else 0.0))
    legs += [Leg(duration_s=50.0, north_m=0.0, east_m=0.0), Leg(duration_s=30.0, height_m=75.0)]
    return Scenario(
        name="power survey",
        seed=11,
        duration_s=float(sum(leg.duration_s for leg in legs)),
        flight=Flight(leg=tuple(legs)),
        antenna=Antenna(pattern="monopole", gain_dbi=2.0, polarization="any"),
        tag=(
            made.simulated_tag(
                name="frog",
                interval_uncertainty_s=0.02,
                north_m=TAG_NORTH_M,
                east_m=TAG_EAST_M,
                height_m=0.5,
                erp_dbm=-52.0,
            ),
        ),
    )


@pytest.fixture(scope="module")
def flight(write_flight: WriteFlight) -> Path:
    return write_flight(scenario=lawnmower(), tags=1, name="flight_log_power")


@pytest.fixture(scope="module")
def survey(flight: Path) -> Survey:
    return read_survey(flight, EstimationOptions(antenna="monopole"))


def miss_m(latitude_deg: float, longitude_deg: float) -> float:
    home = lawnmower().home
    plane = TangentPlane(latitude_deg=home.latitude_deg, longitude_deg=home.longitude_deg)
    east, north = plane.to_local(latitude_deg, longitude_deg)
    return math.hypot(float(east) - TAG_EAST_M, float(north) - TAG_NORTH_M)


def test_the_tag_is_found_and_the_strongest_signal_is_on_its_ring(survey: Survey) -> None:
    assert survey.bearings == ()
    found = some(some(survey.position_of(2)).position)
    error = miss_m(found.latitude_deg, found.longitude_deg)
    assert error < min(25.0, some(found.radius95_m))
    signal = some(survey.signal_of(2))
    loudest = some(signal.strongest)
    assert miss_m(loudest.latitude_deg, loudest.longitude_deg) > error
    assert loudest.ring_radius_m == pytest.approx(40.0 * math.sqrt(0.8), rel=0.1)
    assert np.nanmax(some(signal.surface).snr_db) <= loudest.snr_db + 1e-9
    # Level at 40 m, and a climb to 75 m at one place, which makes no map.
    assert signal.heights[0].high_m < 50.0
    assert signal.heights[-1].high_m == pytest.approx(75.0, abs=1.0)
    assert signal.layers == ()


def test_pulses_that_must_have_come_count_as_missed(flight: Path) -> None:
    read = read_flight(flight)
    every = power_track(heard_in_flight(read), 2)
    thinned = [one for number, one in enumerate(read.pulse_poses) if number % 3]
    heard = heard_in_flight(read, thinned)
    track = power_track(heard, 2)
    missed = np.isnan(track.snr_db)
    assert not np.isnan(every.snr_db).any()
    # The first and the last are not between two that were heard.
    assert missed.sum() == pytest.approx(len(every.snr_db) / 3, abs=2)
    assert np.allclose(track.latitude_deg, every.latitude_deg[-len(track.snr_db) :], atol=1e-5)
    without = power_track(replace(heard, tags=()), 2)
    assert len(without.snr_db) == len(thinned)
    with pytest.raises(UsageError, match="only 2 of"):
        power_track(heard_in_flight(read, thinned[:2]), 2)


def test_the_report_names_the_strongest_signal_and_does_not_take_it_for_the_tag(
    survey: Survey,
) -> None:
    assert len(pictures_in_report(survey)) == 5  # overview, map, heights, times, noise
    for name in ("Map of Tag", "SNR of Tag 2 frog over height"):
        assert draw_in_report(survey, name).axes
    page = said_in_report(survey)
    (finding,) = words.findings(survey)
    assert "Strongest signal" in dict(finding.facts.details)
    assert dict(finding.facts.rows)["Based on"][0].startswith("the strength of")
    assert "The strongest signal is not at the tag" in page
    assert "principal components" in page  # the sources stay


def test_the_exports_hold_the_signal_map_and_its_loudest_place(
    survey: Survey, tmp_path: Path
) -> None:
    written = {path.name: path for path in export_survey(survey, tmp_path)}
    tiff = written["signal_tag_2.tif"].read_bytes()
    assert tiff[:4] == b"II*\0"
    (entries,) = struct.unpack_from("<H", tiff, 8)
    tags = {
        struct.unpack_from("<H", tiff, 10 + 12 * k)[0]: struct.unpack_from(
            "<HII", tiff, 12 + 12 * k
        )
        for k in range(entries)
    }
    columns, rows, start = (tags[tag][2] for tag in (256, 257, 273))
    pixels = np.frombuffer(tiff, "<f4", rows * columns, start)
    signal = some(survey.signal_of(2))
    assert np.nanmax(pixels) == pytest.approx(np.nanmax(some(signal.surface).snr_db), abs=1e-3)
    content = json.loads(written["flight.geojson"].read_text())
    layers = [one["properties"]["layer"] for one in content["features"]]
    assert layers.count("strongest signal") == 1
    assert "bearing" not in layers
    with zipfile.ZipFile(BytesIO(written["flight.kmz"].read_bytes())) as archive:
        assert "files/signal_2.png" in archive.namelist()
        assert b"the tag is about" in archive.read("doc.kml")


def two_heights() -> PowerTrack:
    """The square at 30 m, then at 80 m, over ground that both held to 2 m; a tag in it."""
    rng = np.random.default_rng(4)
    east, north = np.meshgrid(np.arange(0.0, 250.0, 25.0), np.arange(0.0, 250.0, 25.0))
    height = np.repeat([30.0, 80.0], east.size) + rng.uniform(-2.0, 2.0, 2 * east.size)
    east, north = np.tile(east.ravel(), 2), np.tile(north.ravel(), 2)
    slant = np.sqrt((east - TAG_EAST_M) ** 2 + (north - TAG_NORTH_M) ** 2 + height**2)
    home = lawnmower().home
    plane = TangentPlane(latitude_deg=home.latitude_deg, longitude_deg=home.longitude_deg)
    latitude, longitude = plane.to_geodetic(east, north)
    gain = monopole_gain_db(np.degrees(np.arcsin(height / slant)))
    snr = 40.0 - 25.0 * np.log10(slant / 100.0) + gain + rng.normal(0.0, 1.0, len(east))
    return PowerTrack(
        latitude_deg=latitude, longitude_deg=longitude, height_m=height, snr_db=snr
    )


def test_a_survey_at_two_heights_has_a_map_of_each_and_one_from_the_side(
    survey: Survey, tmp_path: Path
) -> None:
    track = two_heights()
    position = estimate_position(None, track, follow=True)
    assert miss_m(position.latitude_deg, position.longitude_deg) < 10.0
    signal = signal_of(2, track, position)
    low, high = signal.layers
    assert (low.pulses, high.pulses) == (100, 100)
    assert 28.0 <= low.low_m < low.high_m < 33.0 < 78.0 <= high.low_m < high.high_m < 83.0
    # Each layer's peak lies on that layer's own ring: 0.9 of the height from the tag.
    for layer, ring_m in ((low, 27.0), (high, 72.0)):
        loudest = layer.strongest
        assert loudest.ring_radius_m == pytest.approx(ring_m, abs=3.0)
        assert miss_m(loudest.latitude_deg, loudest.longitude_deg) > 10.0
    section = some(signal.section)
    # From the side: at 80 m it is nearly silent above the tag and loud beside it.
    top = section.snr_db[-1][np.isfinite(section.snr_db[-1])]
    assert top[0] < top.max() - 6.0
    assert np.isnan(section.snr_db[len(section.snr_db) // 2]).all()  # nobody flew at 55 m

    flown = replace(survey, signals=(signal,))
    (layers,) = (one for one in pictures_in_report(flown) if one.name.startswith("Maps of"))
    assert "strongest signal of the layer" in layers.caption
    assert len(draw_in_report(flown, layers.name).axes) >= 2
    written = {path.name: path for path in export_survey(flown, tmp_path)}
    files = {name for name in written if name.startswith("signal_tag_2")}
    assert len(files) == 3
    features = json.loads(written["flight.geojson"].read_text())["features"]
    loudest_places = [
        (one["properties"]["heights_from_m"], one["properties"]["heights_to_m"])
        for one in features
        if one["properties"]["layer"] == "strongest signal"
    ]
    assert loudest_places[0] == (None, None)
    assert loudest_places[1:] == [
        (round(one.low_m, 1), round(one.high_m, 1)) for one in (low, high)
    ]
    with zipfile.ZipFile(BytesIO(written["flight.kmz"].read_bytes())) as archive:
        content = archive.read("doc.kml").decode()
        assert {"files/signal_2_0.png", "files/signal_2_1.png"} <= set(archive.namelist())
    assert content.count("<altitudeMode>absolute</altitudeMode>") == 2


def test_the_command_line_finds_the_tag_by_strength(flight: Path, ran: Ran) -> None:
    (found,) = ran("localize", flight, "--antenna", "monopole", "--json").json
    assert found["bearings"] == 0
    assert found["powers"] > 200
    assert miss_m(found["latitude_deg"], found["longitude_deg"]) < 25.0
    with pytest.raises(UsageError, match="needs bearings"):
        read_positions(flight, how=EstimationOptions(method="mle", antenna="monopole"))


def test_a_tag_that_was_hardly_heard_says_so(flight: Path) -> None:
    read = read_flight(flight)
    heard = heard_in_flight(read, read.pulse_poses[:2], antenna="monopole")
    found = estimate(heard)
    assert found.tracks == {}
    assert found.positions[0].position is None
    assert "only 2 of" in (found.positions[0].reason or "")


def test_a_ping_csv_of_ucsd_gives_a_position_once_the_height_is_told(
    tmp_path: Path, ran: Ran
) -> None:
    tag_m = (130.0, 190.0)
    log = pings(tmp_path / "pings.csv", 173_500_000.0, tag_m)
    command = ("localize", log, "--antenna", "monopole")
    (found,) = ran(*command, "--json", "--height", 40).json
    estimates = tmp_path / "estimates.csv"
    east, north = (corner + at for corner, at in zip(CORNER, tag_m, strict=True))
    estimates.write_text(
        "Run,Timestamp,Frequency,Easting,Northing,EPSG Code\n"
        f"1,1700000100,173500000,{CORNER[0]},{CORNER[1]},32632\n"
        f"1,1700000900,173500020,{east},{north},32632\n"
    )
    (theirs,) = ran("localize", estimates, "--json").json  # the later of the two
    assert theirs["method"] == "ucsd"
    plane = TangentPlane(
        latitude_deg=theirs["latitude_deg"], longitude_deg=theirs["longitude_deg"]
    )
    apart_m = np.hypot(*plane.to_local(found["latitude_deg"], found["longitude_deg"]))
    assert apart_m < min(15.0, found["radius95_m"])
    assert "--height" in ran(*command).out
    # The same in report and export, and without being told of UCSD's whip.
    reported = read_survey(log, EstimationOptions(height_m=40.0))
    assert some(reported.positions[0].position).latitude_deg == found["latitude_deg"]
    export = ("export", log, "--format", "csv", "-o", tmp_path)
    ran(*export, "--height", 40)
    (line,) = (tmp_path / "fixes.csv").read_text().splitlines()[1:]
    assert line.startswith("1,")
    assert "--height 40" in ran(*export).err
