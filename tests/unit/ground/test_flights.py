"""Flights on the disk, as the page reads and exports them."""

import csv
import io
import json
import math
import sqlite3
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import made
import numpy as np
import pytest
from pulses import pulse_at as heard_pulse
from some import some
from sql import write_mbtiles
from virtual_time import VirtualClock

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.survey import read_survey
from uavrt.core.clock import Clock, iso_utc
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.core.messages import LiveBearing, Pose, PulsePose
from uavrt.flight.reading.flight_reader import Flight, read_flight
from uavrt.flight.reading.noted_places import Places, home_note, mark_note
from uavrt.ground.store.estimates import AntennaChoice, Estimates, Estimator
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.flight_queue import RETRY_S
from uavrt.ground.store.ground_settings import GroundSettings
from uavrt.ground.store.stored_flights import Columns, FlightLibrary
from uavrt.ground.web.routes import map_routes as maps
from uavrt.ground.web.work.exports import EXPORTS, export
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.flight_estimates import EstimationOptions
from uavrt.localization.estimates.live_bearings import LiveBearings
from uavrt.localization.results import Position
from uavrt.localization.terrain.elevation_files import open_elevation

pytestmark = pytest.mark.slow

START_NS = 1_700_000_000_000_000_000
PLANE = TangentPlane(latitude_deg=46.5, longitude_deg=8.0)
TAG = made.tag(2, 148.7e6, 1.2, name='<b>"lynx" & co</b>')
TURN_S = 60.0
TAG_EAST_M, TAG_NORTH_M = 300.0, 400.0


def pose_at(seconds: float, east_m: float, yaw_deg: float) -> Pose:
    latitude, longitude = PLANE.to_geodetic(east_m, 0.0)
    half = math.radians(yaw_deg) / 2.0
    return made.pose(
        START_NS + round(seconds * 1e9),
        latitude,
        longitude,
        quaternion_wxyz=(math.cos(half), 0.0, 0.0, math.sin(half)),
    )


def pulse_at(pose: Pose, snr_db: float) -> PulsePose:
    pulse = heard_pulse(pose.time_ns, frequency_hz=148_700_010.0, snr_db=snr_db, noise_psd=1e-9)
    return PulsePose(pulse=pulse, pose=pose)


def fly(
    keeper: FlightKeeper,
    *,
    until_s: float = math.inf,
    stations: Sequence[float] = (0.0, 200.0),
    least_snr_db: float = -math.inf,
) -> None:
    """Full turns in place, 200 m apart, with a tag heard by the antenna's pattern."""
    rng = np.random.default_rng(5)
    seconds = 0.0
    for station in stations:
        towards = math.degrees(math.atan2(TAG_EAST_M - station, TAG_NORTH_M))
        for step in range(int(TURN_S * 5)):
            if seconds > until_s:
                return
            pose = pose_at(seconds, station, 360.0 * step / (TURN_S * 5))
            keeper.add_pose(pose)
            if step % 6 == 0:
                gain = float(PATTERNS["RA-23K"].gain_db(towards - 360.0 * step / (TURN_S * 5)))
                snr_db = 30.0 + gain + rng.normal(0.0, 1.0)
                if snr_db >= least_snr_db:
                    keeper.add_pulse(pulse_at(pose, snr_db))
            seconds += 0.2
        for step in range(100):
            keeper.add_pose(pose_at(seconds, station + step * 2.0, 0.0))
            seconds += 0.2


@pytest.fixture(name="keeper")
def keeper_fixture(tmp_path: Path) -> Iterator[FlightKeeper]:
    keeper = FlightKeeper(tmp_path, Clock.start())
    keeper.begin([TAG])
    yield keeper
    keeper.close()


@pytest.fixture(name="flown", scope="module")
def flown_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FlightKeeper]:
    """A keeper of two turns and a mark, to which tests add nothing."""
    keeper = FlightKeeper(tmp_path_factory.mktemp("flown"), Clock.start())
    keeper.begin([TAG])
    fly(keeper)
    keeper.add_note(mark_note(46.501, 8.001, "nest & eggs"), START_NS)
    yield keeper
    keeper.close()


@pytest.fixture(scope="module")
def columns(flown: FlightKeeper) -> Columns:
    return flown.columns()


@pytest.fixture(scope="module")
def found(columns: Columns) -> Estimates:
    return estimates(columns)


def stored(keeper: FlightKeeper) -> tuple[FlightLibrary, str]:
    """What a keeper has on its disk, and its flight's name there."""
    keeper.queue.commit()
    return FlightLibrary(keeper._directory), some(keeper.flight_id)


def estimates(columns: Columns, *given: Any, offset_deg: float = 0.0, **more: Any) -> Estimates:
    antenna = AntennaChoice(offset_deg=offset_deg)
    return Estimator().estimate(columns, antenna, *given, **more)


def test_what_is_on_the_disk_is_what_the_estimates_see(
    flown: FlightKeeper, columns: Columns
) -> None:
    library, flight_id = stored(flown)
    on_disk = library.columns(flight_id)
    np.testing.assert_array_equal(on_disk.pulses, columns.pulses)
    np.testing.assert_array_equal(on_disk.poses, columns.poses)
    assert library.summary(flight_id).pulses == len(
        read_flight(library.path(flight_id)).pulse_poses
    )
    assert library.summary(flight_id).source == "ground"


def test_a_restart_goes_on_with_the_flight_and_takes_no_pulse_twice(
    keeper: FlightKeeper, tmp_path: Path
) -> None:
    fly(keeper, until_s=20.0)
    library, flight_id = stored(keeper)
    keeper.close()
    again = FlightKeeper(tmp_path, Clock.start())
    assert again.resume(flight_id)
    again.load(library.columns(flight_id))
    before = again.pulses
    known = pulse_at(pose_at(0.0, 0.0, 0.0), 30.0)
    assert not again.add_pulse(known)
    assert again.add_pulse(pulse_at(pose_at(999.0, 0.0, 0.0), 30.0))
    assert again.pulses == before + 1
    again.close()
    assert library.summary(flight_id).pulses == before + 1


def test_the_tag_is_found_where_it_is(found: Estimates) -> None:
    assert [one["turn"] for one in found.bearings] == [0, 1]
    for one, station in zip(found.bearings, (0.0, 200.0), strict=True):
        true = math.degrees(math.atan2(TAG_EAST_M - station, TAG_NORTH_M)) % 360.0
        assert one["bearing_deg"] == pytest.approx(true, abs=6.0)
        assert one["accepted"]
        heard = [value for value in one["rose_snr_db"] if value is not None]
        assert one["rose_snr_db"][round(true / 22.5) % 16] >= max(heard) - 2.0
        assert min(heard) < max(heard) - 10.0
    (position,) = found.positions
    east, north = PLANE.to_local(position["latitude_deg"], position["longitude_deg"])
    assert math.hypot(east - TAG_EAST_M, north - TAG_NORTH_M) < position["radius95_m"] + 20.0
    assert position["region50"]
    assert position["heat"]["width"] > 10


def live_bearings_of(flight: Flight) -> list[LiveBearing]:
    """What the drone's own stage says last of each tag and turn, as the flight went on."""
    stage = LiveBearings(tags=flight.info.tags)
    said: dict[tuple[int, int], LiveBearing] = {}
    fed_ns = 0
    for number, pulse in enumerate(flight.pulse_poses):
        now_ns = pulse.pulse.start_time_ns
        stage.add_poses([pose for pose in flight.poses if fed_ns < pose.time_ns <= now_ns])
        stage.add_pulse(pulse)
        fed_ns = now_ns
        if number % 10 == 0:
            said |= {(one.tag_id, one.start_time_ns): one for one in stage.changed()}
    stage.add_poses([pose for pose in flight.poses if pose.time_ns > fed_ns])
    said |= {(one.tag_id, one.start_time_ns): one for one in stage.changed()}
    return [said[key] for key in sorted(said, key=lambda key: key[1])]


def test_the_drone_says_the_same_of_a_flight_as_the_report(keeper: FlightKeeper) -> None:
    """Four turns that teach the antenna, with pulses that were missed."""
    fly(keeper, stations=(0.0, 200.0, 400.0, 600.0), least_snr_db=13.0)
    library, flight_id = stored(keeper)
    place = library.path(flight_id)
    survey, drone = read_survey(place), live_bearings_of(read_flight(place))
    assert len(survey.bearings) == len(drone) == 4
    for tag_bearing, live in zip(survey.bearings, drone, strict=True):
        in_report = tag_bearing.bearing
        assert live.bearing_deg == pytest.approx(in_report.bearing_deg, abs=0.01)
        assert live.sigma_deg == pytest.approx(in_report.sigma_deg, abs=0.01)
        assert live.interval90_deg == pytest.approx(in_report.interval90_deg, abs=0.01)
        assert live.pulses == tag_bearing.heard < in_report.pulses  # misses are counted there
        assert live.accepted == in_report.accepted


def survey_lines(keeper: FlightKeeper) -> None:
    """Five lines over 250 m with an upright monopole, and pulses too weak to be heard."""
    rng = np.random.default_rng(8)
    seconds = 0.0
    for line, east in enumerate((0.0, 60.0, 120.0, 180.0, 240.0)):
        for along in np.arange(0.0, 250.0, 5.0):
            north = along if line % 2 == 0 else 250.0 - along
            latitude, longitude = PLANE.to_geodetic(east, north)
            pose = replace(
                pose_at(seconds, 0.0, 0.0),
                latitude_deg=float(latitude),
                longitude_deg=float(longitude),
            )
            keeper.add_pose(pose)
            ground = math.hypot(east - 95.0, north - 140.0)
            slant = math.hypot(ground, 40.0)
            snr_db = 28.0 - 22.0 * math.log10(slant / 100.0)
            snr_db += 20.0 * math.log10(max(ground / slant, 0.05)) + rng.normal(0.0, 1.5)
            if snr_db >= 22.0:
                keeper.add_pulse(pulse_at(pose, snr_db))
            seconds += 1.2


def on_page(keeper: FlightKeeper, antenna: AntennaChoice) -> dict[str, Any]:
    """The one position that the page shows."""
    library, flight_id = stored(keeper)
    columns, tags = library.columns(flight_id), library.summary(flight_id).tags
    (shown,) = Estimator().estimate(columns, antenna, (), tags).positions
    return shown


def elsewhere(keeper: FlightKeeper, how: EstimationOptions) -> tuple[Position, Position]:
    """That of the command line and that of the report."""
    library, flight_id = stored(keeper)
    (told,) = read_positions(library.path(flight_id), how=how)
    (reported,) = read_survey(library.path(flight_id), how).positions
    return some(told.position), some(reported.position)


@pytest.mark.parametrize("pattern", ["monopole", "RA-23K"])
def test_page_report_and_command_line_tell_the_same_over_hills(
    keeper: FlightKeeper, tmp_path: Path, pattern: str
) -> None:
    (survey_lines if pattern == "monopole" else fly)(keeper)
    north_west = math.floor(PLANE.latitude_deg), math.floor(PLANE.longitude_deg)
    tile = tmp_path / f"N{north_west[0]:02d}E{north_west[1]:03d}.hgt"
    slope = np.broadcast_to(np.linspace(0.0, 9000.0, 1201), (1201, 1201))
    tile.write_bytes(slope.astype(">i2").tobytes())
    how = EstimationOptions(antenna=pattern, elevation=open_elevation(tile))
    shown = on_page(keeper, AntennaChoice(pattern=pattern, dem=str(tile)))
    for other in elsewhere(keeper, how):
        assert shown["latitude_deg"] == pytest.approx(other.latitude_deg, abs=1e-7)
        assert shown["radius95_m"] == pytest.approx(other.radius95_m, abs=0.1)
    if pattern == "monopole":  # a single bearing has no other level to be compared with
        level = on_page(keeper, AntennaChoice(pattern=pattern))
        assert shown["radius95_m"] != pytest.approx(level["radius95_m"], abs=0.1)


@pytest.mark.parametrize("pattern", ["monopole", "RA-23K"])
def test_page_report_and_command_line_trust_headings_and_heights_alike(
    keeper: FlightKeeper, pattern: str
) -> None:
    if pattern == "monopole":
        survey_lines(keeper)
    else:
        fly(keeper, stations=(0.0, 200.0, 400.0, 600.0), least_snr_db=13.0)
    settings = GroundSettings(antenna=pattern)
    told = settings.changed({"heading_error_deg": "0", "height_error_m": "20,5"})
    how = EstimationOptions(antenna=pattern, heading_sigma_deg=0.0, height_sigma_m=20.5)
    shown = on_page(keeper, told.antenna_choice)
    for other in elsewhere(keeper, how):
        assert shown["latitude_deg"] == pytest.approx(other.latitude_deg, abs=1e-9)
        assert shown["radius95_m"] == pytest.approx(other.radius95_m, abs=0.01)
        assert shown["remarks"] == list(other.remarks)
    if pattern != "monopole":
        assert shown["radius95_m"] != on_page(keeper, settings.antenna_choice)["radius95_m"]
    with pytest.raises(UsageError, match="heading_error_deg"):
        settings.changed({"heading_error_deg": "-1"})


def test_a_turn_that_goes_on_gives_a_wide_interval_that_narrows(keeper: FlightKeeper) -> None:
    widths = []
    for until_s in (14.0, 35.0, 59.0):
        part = FlightKeeper(keeper._directory / f"{until_s}", Clock.start())
        part.begin([TAG])
        fly(part, until_s=until_s)
        (one,) = estimates(part.columns()).bearings
        part.close()
        low, high = one["interval90_deg"]
        widths.append((high - low) % 360.0)
        true = math.degrees(math.atan2(TAG_EAST_M, TAG_NORTH_M))
        assert (true - low) % 360.0 <= widths[-1] + 3.0
    assert widths[2] < widths[0]


def test_poses_out_of_order_spoil_nothing(columns: Columns, found: Estimates) -> None:
    mixed = np.random.default_rng(3).permutation(columns.poses.shape[1])
    shuffled = replace(columns, poses=columns.poses[:, mixed])
    assert estimates(shuffled).bearings == found.bearings


@pytest.mark.parametrize("name", EXPORTS)
def test_every_export_is_well_formed_and_holds_the_flight(
    flown: FlightKeeper, columns: Columns, name: str
) -> None:
    library, flight_id = stored(flown)
    place = library.path(flight_id)
    content = export(name, place, AntennaChoice())
    ends = {iso_utc(one.end_time_ns) for one in read_survey(place).bearings}
    match name:
        case "csv":
            rows = list(csv.DictReader(io.StringIO(content.decode())))
            assert len(rows) == columns.pulses.shape[1]
            assert float(rows[0]["latitude_deg"]) == pytest.approx(46.5)
        case "geojson":
            features = json.loads(content)["features"]
            kinds = [feature["properties"]["layer"] for feature in features]
            assert kinds.count("pulse") == columns.pulses.shape[1]
            assert kinds.count("bearing") == 2
            assert [kinds.count(n) for n in ("mark", "region 50 %", "region 95 %")] == [1, 1, 1]
            (time,) = (
                feature["properties"]["time"]
                for feature in features
                if feature["properties"]["layer"] == "position"
            )
            assert time in ends
        case "gpx":
            root = ElementTree.fromstring(content)
            assert [one.text for one in root.findall("{*}wpt/{*}name")][1] == "nest & eggs"
            assert all(one.text for one in root.findall("{*}wpt/{*}time"))
            assert len(root.findall(".//{*}trkpt")) > 100
        case "kml" | "kmz":
            document = content
            if name == "kmz":
                with zipfile.ZipFile(io.BytesIO(content)) as archive:
                    document = archive.read("doc.kml")
            root = ElementTree.fromstring(document)
            assert len(root.findall(".//{*}MultiGeometry")) == 2
            assert "nest & eggs" in [one.text for one in root.iter() if one.tag[-4:] == "name"]
            assert any(one.text in ends for one in root.iter() if one.tag[-4:] == "when")
            assert b"http" not in document.replace(b"http://www.opengis.net/kml/2.2", b"")
    if name in ("gpx", "kml", "kmz"):
        assert b"<b>" not in content


def test_an_offset_of_the_antenna_turns_the_bearings_on_the_page_and_in_exports(
    flown: FlightKeeper, columns: Columns, found: Estimates
) -> None:
    library, flight_id = stored(flown)
    exported = export("geojson", library.path(flight_id), AntennaChoice(offset_deg=90.0))
    kinds = [feature["properties"] for feature in json.loads(exported)["features"]]
    in_file = next(one for one in kinds if one["layer"] == "bearing")
    for turned in (estimates(columns, offset_deg=90.0).bearings[0], in_file):
        by_deg = turned["bearing_deg"] - found.bearings[0]["bearing_deg"]
        assert by_deg % 360.0 == pytest.approx(90.0, abs=0.5)


def test_what_is_in_doubt_of_a_pulse_is_in_the_records_the_columns_and_the_table(
    keeper: FlightKeeper,
) -> None:
    plain = pulse_at(pose_at(1.0, 0.0, 0.0), 20.0)
    other = pulse_at(pose_at(2.0, 0.0, 0.0), 20.0)
    doubts = ("also_possible_tag_ids", "ghost_of_tag_id", "clipped")
    pulse = replace(other.pulse, also_possible_tag_ids=(4, 6), ghost_of_tag_id=8, clipped=True)
    keeper.add_pulse(plain)
    keeper.add_pulse(replace(other, pulse=pulse))
    library, name = stored(keeper)
    certain, doubtful = library.records(name, 0, 10)
    assert [certain[key] for key in doubts] == [[], None, False]
    assert [doubtful[key] for key in doubts] == [[4, 6], 8, True]
    columns = library.columns(name)
    for key, number in (("also_possible_tag_id", 4), ("ghost_of_tag_id", 8), ("clipped", 1)):
        assert columns[key][1] == number
        assert not columns[key][0] > 0
    np.testing.assert_array_equal(keeper.columns().pulses, columns.pulses)
    table = export("csv", library.path(name), AntennaChoice()).decode()
    rows = list(csv.DictReader(io.StringIO(table)))
    shown = [[row[key] for key in list(row)[-3:]] for row in rows]
    assert shown == [["", "", "false"], ["4 6", "8", "true"]]


def test_no_name_leads_out_of_the_directory(tmp_path: Path) -> None:
    library = FlightLibrary(tmp_path / "flights")
    (tmp_path / "flight.sqlite").touch()
    (tmp_path / "flights").mkdir()
    for name in ("..", ".", "", "../flights", "a/../..", "/", "\0", "x\0"):
        with pytest.raises(UsageError):
            library.path(name)


def test_a_full_disk_is_told_and_mended(
    keeper: FlightKeeper, clock_of_test: VirtualClock, tmp_path: Path
) -> None:
    directory = tmp_path / (keeper.flight_id or "")
    keeper.queue.commit()
    with sqlite3.connect(directory / "flight.sqlite") as other:
        other.execute("BEGIN EXCLUSIVE")
        keeper.add_pulse(pulse_at(pose_at(1.0, 0.0, 0.0), 20.0))
        keeper.queue.commit()
        assert "cannot write" in some(keeper.queue.fault)
        other.rollback()
    other.close()
    clock_of_test.now_s += RETRY_S
    keeper.queue.commit()
    assert keeper.queue.fault is None
    assert len(read_flight(directory).pulse_poses) == 1


def test_map_files_are_listed_and_their_tiles_turned_over(tmp_path: Path) -> None:
    path = tmp_path / "valley.mbtiles"
    facts = {"format": "png", "bounds": "7,46,9,47"}
    write_mbtiles(path, facts, [(3, 4, 5, b"\x89PNG north")])
    (tmp_path / "broken.pmtiles").write_bytes(b"nothing of the kind")
    (tmp_path / "notes.txt").touch()
    broken, valley = maps.map_list(tmp_path)
    assert "PMTiles" in broken["fault"]
    assert valley["bounds"] == [7.0, 46.0, 9.0, 47.0]
    # MBTiles counts rows from the south: row 5 of 8 is row 2 from the north.
    assert maps.tile(path, 3, 4, 2) == (b"\x89PNG north", "image/png", None)
    assert maps.tile(path, 3, 4, 5) is None
    with pytest.raises(UsageError):
        maps.map_path(tmp_path, "../valley.mbtiles")


def test_a_turn_flown_while_the_radio_was_silent_gives_its_bearing_afterwards(
    columns: Columns, found: Estimates
) -> None:
    """The vehicle's poses of that time never come; the pulses, each with its pose, do."""
    _, second = found.bearings
    silent = (columns.poses[0] > second["start_time_ns"] - 5e9) & (
        columns.poses[0] < second["end_time_ns"] + 5e9
    )
    lost = Columns(pulses=columns.pulses, poses=columns.poses[:, ~silent])
    _, afterwards = estimates(lost).bearings
    assert afterwards["bearing_deg"] == pytest.approx(second["bearing_deg"], abs=2.0)
    assert afterwards["pulses"] >= 0.8 * second["pulses"]


def test_a_drone_that_was_carried_after_its_landing_has_no_live_turn(
    keeper: FlightKeeper, tmp_path: Path
) -> None:
    """Two turns at one height by the barometer; the second one by hand, after the landing."""
    keeper.add_state(START_NS, armed=True, landed=None)
    keeper.add_state(START_NS, armed=True, landed=None)
    fly(keeper)
    first, _ = estimates(keeper.columns()).bearings
    keeper.add_state(START_NS + 75 * 10**9, armed=True, landed=True)
    keeper.add_state(START_NS + 80 * 10**9, armed=False, landed=True)
    (live,) = estimates(keeper.columns()).bearings
    assert live["start_time_ns"] == first["start_time_ns"]
    library, flight_id = stored(keeper)
    assert estimates(library.columns(flight_id)).bearings == [live]
    assert len(read_survey(library.path(flight_id)).bearings) == 1
    keeper.close()
    again = FlightKeeper(tmp_path, Clock.start())
    assert again.resume(flight_id)
    again.load(library.columns(flight_id))
    assert estimates(again.columns()).bearings == [live]
    again.close()


def test_a_drones_own_bearing_of_a_turn_on_the_ground_is_not_taken(
    columns: Columns, found: Estimates
) -> None:
    """It was sent before anything said that the vehicle had not taken off yet."""
    drones = drones_bearing(found.bearings[0])
    nothing = Columns(pulses=columns.pulses[:, :0], poses=columns.poses)
    assert len(estimates(nothing, [drones]).bearings) == 1
    ground = replace(nothing, on_ground_ns=((START_NS, START_NS + 70 * 10**9),))
    assert estimates(ground, [drones]).bearings == []


def drones_bearing(ours: dict[str, Any]) -> LiveBearing:
    """A bearing from the drone that knows of one pulse more than ours of that turn."""
    turn = ("start_time_ns", "end_time_ns", "latitude_deg", "longitude_deg")
    return made.live_bearing(
        TAG.tag_id,
        **{name: ours[name] for name in turn},
        bearing_deg=123.0,
        sigma_deg=2.0,
        interval90_deg=(119.7, 126.3),
        level_db=30.0,
        pulses=ours["pulses"] + 1,
    )


def test_what_two_vehicles_heard_of_a_tag_goes_into_one_position(tmp_path: Path) -> None:
    """Each turned at one place only: alone neither knows how far away the tag is."""
    each = []
    for number, station in enumerate((0.0, 200.0)):
        keeper = FlightKeeper(tmp_path / str(number), Clock.start())
        keeper.begin([TAG])
        fly(keeper, stations=(station,))
        each.append(estimates(keeper.columns()))
        columns = keeper.columns()
        keeper.close()
    alone, last = each
    both = estimates(columns, companions=[alone])
    (together,) = both.positions
    assert together["stations"] == 2
    assert together["radius95_m"] < 0.5 * min(
        one["radius95_m"] for found in each for one in found.positions
    )
    east, north = PLANE.to_local(together["latitude_deg"], together["longitude_deg"])
    assert math.hypot(east - TAG_EAST_M, north - TAG_NORTH_M) <= together["radius95_m"]
    assert both.bearings == last.bearings  # its own alone
    assert both.outline == last.outline != alone.outline
    other_hz = {TAG.tag_id: TAG.frequency_hz + 50e3}
    elsewhere = replace(alone, found=replace(alone.found, frequencies_hz=other_hz))
    apart = estimates(columns, companions=[elsewhere])
    assert apart.positions == last.positions  # the same number there is another animal's
    unheard = replace(columns, pulses=columns.pulses[:, :0])
    (by_the_other,) = estimates(unheard, companions=[alone], listed=[TAG]).positions
    assert by_the_other["stations"] == 1
    other = replace(TAG, frequency_hz=TAG.frequency_hz + 50e3)
    assert estimates(unheard, companions=[alone], listed=[other]).positions == []


def test_a_bearing_of_the_drones_own_stands_where_it_knows_of_more_pulses(
    columns: Columns, found: Estimates
) -> None:
    """A link that lost four of five pulses; the drone's message of the first turn came."""
    few = Columns(pulses=columns.pulses[:, ::5], poses=columns.poses)
    ours = estimates(few)
    first = ours.bearings[0]
    drones = drones_bearing(first)
    merged = estimates(few, [drones])
    assert [one["from_drone"] for one in merged.bearings] == [True, False]
    assert merged.bearings[0]["bearing_deg"] == 123.0
    assert merged.bearings[0]["turn"] == first["turn"]
    assert merged.bearings[1] == ours.bearings[1]
    assert merged.positions[0]["stations"] == 2
    assert merged.positions != ours.positions
    # With all pulses here, the drone's message tells nothing new.
    assert estimates(columns, [drones]).bearings == found.bearings
    # A tag of which no pulse has come at all still has a bearing.
    other = estimates(few, [replace(drones, tag_id=77)])
    assert sorted(one["tag_id"] for one in other.bearings) == [TAG.tag_id, TAG.tag_id, 77]


def test_home_and_marks_come_back_from_the_flights_notes(keeper: FlightKeeper) -> None:
    library, flight_id = stored(keeper)
    assert library.places(flight_id) == Places(home=None, marks=())
    for note in (
        home_note(-35.17824, -111.656587),
        mark_note(46.5, 8.0),
        mark_note(46.6, -8.0, "nest: seen\ntwice"),
        "mark at the river",
    ):
        keeper.add_note(note, START_NS)
    keeper.queue.commit()
    found = library.places(flight_id)
    assert found.home == (-35.17824, -111.656587)
    assert [(one.latitude_deg, one.longitude_deg, one.text) for one in found.marks] == [
        (46.5, 8.0, ""),
        (46.6, -8.0, "nest: seen\ntwice"),
    ]
