"""From a recorded flight to bearings and positions, by library and by command."""

import csv
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import made
import numpy as np
import pytest
from command_line import Ran
from file_bearings import read_bearings
from some import some
from tests.unit.analysis.test_tags_of_several_logs import as_log
from turned import turns

from uavrt.analysis.estimates.bearings import heard_in_flight
from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.report.report_words import bearing_table
from uavrt.analysis.survey import read_survey
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import FormatError, UsageError
from uavrt.core.messages import PulsePose
from uavrt.flight.reading.flight_reader import Flight
from uavrt.formats.pulses.tagtracker import write_tagtracker
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.flight_estimates import EstimationOptions, bearings_of
from uavrt.localization.estimates.heard import Heard
from uavrt.localization.results import Position

PLANE = TangentPlane(latitude_deg=35.18, longitude_deg=-111.66)
START_NS = 1_700_000_000_000_000_000
TAG = (150.0, 420.0)
STATIONS = ((-250.0, 0.0), (0.0, 0.0), (250.0, 30.0))
TURN_S, LEG_S = 50.0, 40.0
WAY = turns(
    STATIONS,
    turn_s=TURN_S,
    way_s=LEG_S,
    rest_s=0.0,
    yaw_deg=30.0,
    plane=PLANE,
    start_ns=START_NS,
)


def flown(*, offset_deg: float = 0.0, threshold_db: float = 8.0) -> Flight:
    """A flight with one tag; weak pulses are not heard."""
    rng = np.random.default_rng(4)
    pulses = []
    for time in np.arange(0.4, WAY.end_s - 1, 1.25):
        gain = float(PATTERNS["RA-23K"].gain_db(WAY.seen(time, TAG)[0] - offset_deg))
        snr_db = 24.0 + gain + rng.normal(0, 2.0)
        if snr_db >= threshold_db:
            pose = WAY.pose(time, offset_deg=offset_deg)
            pulses.append(WAY.pulse(time, snr_db, pose, frequency_hz=148e6, noise_psd=1e-10))
    tag = made.tag(2, 148e6, 1.25)
    info = made.flight_info("here", (tag,), start_time_ns=START_NS, center_frequency_hz=148e6)
    return made.recorded_flight(info, WAY.poses(), pulses)


def true_bearing(number: int) -> float:
    return from_there(*STATIONS[number])


def from_there(east: float, north: float) -> float:
    """True direction to the tag."""
    return math.degrees(math.atan2(TAG[0] - east, TAG[1] - north))


def off_m(found: Position) -> float:
    return math.dist(PLANE.to_local(found.latitude_deg, found.longitude_deg), TAG)


def test_a_positions_csv_gives_what_is_in_it(tmp_path: Path, ran: Ran) -> None:
    path = tmp_path / "positions.csv"
    path.write_text(
        "2,bearings.csv,35.1,-111.6,35.2,-111.7,NaN,NaN,\n3,bearings.csv,36.1,-112.6,,,,,\n"
    )
    found = read_positions(path)
    assert [(one.tag_id, one.position.method) for one in found if one.position] == [
        (2, "mle"),
        (2, "rmr"),
        (3, "mle"),
    ]
    (only,) = read_positions(path, how=EstimationOptions(method="rmr"))
    assert some(only.position).latitude_deg == 35.2
    told = ran("localize", path).out
    assert "tag 2: 35.10000, -111.60000, mle, read from the file" in told


@pytest.mark.parametrize("offset_deg", [0.0, 90.0])
def test_each_turn_of_a_flight_gives_a_bearing_wherever_the_antenna_points(
    offset_deg: float,
) -> None:
    """The offset is in the pulses' poses already; the vehicle's have none."""
    found = bearings_of(heard_in_flight(flown(offset_deg=offset_deg)))
    assert len(found) == 3
    for number, one in enumerate(found):
        assert abs(difference_deg(one.bearing.bearing_deg, true_bearing(number))) < 10.0
        assert one.bearing.accepted
        # Misses are counted too: 40 pulses come in a turn, half of them are heard.
        assert one.bearing.pulses >= 36


def test_a_log_of_one_turn_is_one_bearing_and_pca_takes_all_its_pulses(tmp_path: Path) -> None:
    flight = flown()
    first = [one for one in flight.pulse_poses if one.pulse.start_time_ns < START_NS + 5e10]
    path = as_log(tmp_path / "turn.jsonl", tuple(first))
    (found,) = read_bearings(path, how=EstimationOptions(bearing_method="pca"))
    assert found.bearing.pulses == len(first)
    assert found.start_time_ns <= first[0].pulse.start_time_ns
    assert found.end_time_ns >= first[-1].pulse.start_time_ns
    assert found.end_time_ns - found.start_time_ns < 5e10


def test_a_log_of_a_whole_flight_is_cut_into_its_turns(tmp_path: Path) -> None:
    path = as_log(tmp_path / "flight.jsonl", flown(threshold_db=-20.0).pulse_poses)
    assert len(read_bearings(path)) == 3


def test_pulses_without_poses_are_refused_with_the_reason() -> None:
    blind = [PulsePose(pulse=one.pulse, pose=None) for one in flown().pulse_poses]
    with pytest.raises(UsageError, match="autopilot"):
        Heard.of_records(blind)
    assert bearings_of(Heard.of_records([])) == []


BEARINGS = """\
2,a.csv,{0:.6f},0.9,35.180000,-111.662745,40,2147,1684766889.8,1684767153.8
2,b.csv,{1:.6f},NaN,35.180000,-111.660000,,2147.2,1684767889.8,1684768153.8
2,c.csv,{2:.6f},0.06,35.180270,-111.657255,40,2147,1684768889.8,1684769153.8
7,c.csv,12.5,0.06,35.180270,-111.657255,40,2147,1684768889.8,1684769153.8
"""


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """Bearings as the original program lists them."""
    path = tmp_path / "bearings.csv"
    path.write_text(BEARINGS.format(*map(true_bearing, range(3))), encoding="utf-8")
    return path


@pytest.mark.parametrize("method", ["mle", "rmr", "mest", "bayes"])
def test_a_bearings_csv_of_the_original_gives_positions(table: Path, method: str) -> None:
    positions = read_positions(table, how=EstimationOptions(method=method))
    assert [one.tag_id for one in positions] == [2, 7]
    assert off_m(some(positions[0].position)) < 12.0
    if method != "bayes":
        assert positions[1].position is None
        assert "two" in (positions[1].reason or "")


def test_a_copy_of_a_flight_is_no_further_evidence(tmp_path: Path) -> None:
    """Received by radio and fetched by Wi-Fi, a flight lies there twice."""
    flight = flown(threshold_db=-20.0)
    whole = as_log(tmp_path / "fetched.jsonl", flight.pulse_poses)
    part = as_log(tmp_path / "received.jsonl", flight.pulse_poses[::2])
    (alone,) = read_positions(whole)
    said: list[str] = []
    for paths in ((whole, part), (part, whole), (whole, whole), (tmp_path,)):
        (found,) = read_positions(*paths, warn=said.append)
        assert some(found.position).radius95_m == some(alone.position).radius95_m
    assert len(said) == 4
    assert said[0] == f"{part} is a copy of {whole}, of the same flight: left out"


def test_pulse_logs_several_flights_and_a_folder_give_positions(tmp_path: Path) -> None:
    flight = flown(threshold_db=-20.0)
    whole = as_log(tmp_path / "flight.jsonl", flight.pulse_poses)
    (alone,) = read_positions(whole)
    cuts = [0.0, *(bearing.end_time_ns + 1 for bearing in read_bearings(whole)[:2]), math.inf]
    parts = []
    for number, (begin, end) in enumerate(pairwise(cuts)):
        part = tmp_path / "archive" / f"flight_{number}"
        part.mkdir(parents=True)
        pulses = [p for p in flight.pulse_poses if begin <= p.pulse.start_time_ns < end]
        with (part / f"Pulse-{number}.csv").open("w", encoding="utf-8") as stream:
            write_tagtracker(stream, pulses)
        parts.append(part)
    for given in ([tmp_path / "archive"], parts):
        (found,) = read_positions(*given)
        position = some(found.position)
        assert position.stations == 3
        assert off_m(position) < min(60.0, some(position.radius95_m))
    assert some(alone.position).stations == 3
    (one,) = read_positions(parts[0])
    assert some(one.position).stations == 1
    (tmp_path / "nothing").mkdir()
    with pytest.raises(FormatError, match="no flight"):
        read_positions(tmp_path / "nothing")


def test_a_line_that_is_no_bearing_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bearings.csv"
    path.write_text("2,a.csv,12.0\n", encoding="utf-8")
    with pytest.raises(FormatError, match="line 1"):
        read_positions(path)


def test_the_commands_print_lists_for_other_programs(
    ran: Ran, table: Path, tmp_path: Path
) -> None:
    pulses = as_log(tmp_path / "flight.csv.jsonl", flown().pulse_poses)
    bearings = ran("bearing", pulses, "--method", "ls_db", "--json").json
    assert len(bearings) == 3
    for one in bearings:
        assert set(one) >= {"tag_id", "bearing_deg", "sigma_deg", "method"}
    (position, _) = ran("localize", table, "--json").json
    assert position["tag_id"] == 2
    assert position["method"] == "bayes"
    assert 0 < position["radius50_m"] < position["radius95_m"]
    assert "tag 7" in ran("localize", table, "--method", "mle").out


def test_localize_names_tags_and_says_what_cannot_be_checked(
    ran: Ran, table: Path, tmp_path: Path
) -> None:
    listed = tmp_path / "TagInfo.txt"
    listed.write_text("2, lynx, 148700000, 1254, 0, 20, 60, 10, 3, 0.01\n", encoding="utf-8")
    told = ran("localize", table, "--tags", listed).out
    assert "tag 2 (lynx): " in told
    assert "tag 7: " in told
    assert "cannot be checked" in told


def mounted_across(tmp_path: Path) -> Path:
    """A pulse log of an antenna that points to the right, which the headings leave out."""
    pulses = [one.pulse for one in flown(offset_deg=90.0, threshold_db=-20.0).pulse_poses]
    of_the_drone = [
        PulsePose(pulse=one, pose=WAY.pose((one.start_time_ns - START_NS) * 1e-9))
        for one in pulses
    ]
    return as_log(tmp_path / "flight.jsonl", of_the_drone)


def test_every_command_that_makes_bearings_takes_the_offset_and_tells_the_same_of_them(
    ran: Ran, tmp_path: Path
) -> None:
    log = mounted_across(tmp_path)
    told = ("--antenna-offset", "90")
    bearings = ran("bearing", log, *told, "--json").json
    assert len(bearings) == 3
    for number, one in enumerate(bearings):
        assert abs(difference_deg(one["bearing_deg"], true_bearing(number))) < 10.0
    (position,) = ran("localize", log, *told, "--json").json
    place = PLANE.to_local(position["latitude_deg"], position["longitude_deg"])
    assert math.dist(place, TAG) < 40.0
    ran("export", log, *told, "--format", "csv", "-o", tmp_path / "export")
    with (tmp_path / "export" / "fixes.csv").open(encoding="utf-8") as stream:
        (fix,) = csv.DictReader(stream)
    assert float(fix["latitude_deg"]) == pytest.approx(position["latitude_deg"], abs=1e-6)
    assert float(fix["longitude_deg"]) == pytest.approx(position["longitude_deg"], abs=1e-6)
    survey = read_survey(log, EstimationOptions(offset_deg=90.0))
    assert [one.bearing.bearing_deg for one in survey.bearings] == [
        one["bearing_deg"] for one in bearings
    ]
    # An operator reads the same of each arc and of the circle, everywhere.
    for one, row in zip(bearings, bearing_table(survey)[1], strict=True):
        assert row[-1] == ("; ".join(one["remarks"]) or "clear")
    for remark in one["remarks"]:
        assert remark in ran("bearing", log, *told).out
    assert position["remarks"][-1] in ran("localize", log, *told).out


def test_bearings_that_are_made_already_are_not_turned_again(table: Path) -> None:
    with pytest.raises(UsageError, match="antenna offset"):
        read_positions(table, how=EstimationOptions(offset_deg=90.0))


def test_a_turn_that_the_autopilot_says_was_landed_has_no_bearing() -> None:
    """The barometer still says 40 m."""
    flight = flown()
    third_ns = START_NS + round(2 * (TURN_S + LEG_S) * 1e9)
    landed = replace(flight, on_ground_ns=((third_ns, 2**62),))
    assert len(bearings_of(heard_in_flight(flight))) == 3
    found = bearings_of(heard_in_flight(landed))
    assert len(found) == 2
    assert all(one.start_time_ns < third_ns for one in found)
