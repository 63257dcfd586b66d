"""A burst goes wherever a pulse goes: recorded, posed, a bearing, exported, integrated."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import made
import pytest
from command_line import Ran
from report_text import said_in_report
from some import some

from uavrt.analysis.export.burst_files import DETECTION_COLUMNS
from uavrt.analysis.export.written import export_survey
from uavrt.analysis.inputs.found_bursts import bursts_of_pulses
from uavrt.analysis.measure.recorded_pulses import detect
from uavrt.analysis.report.report_words import code_table, methods
from uavrt.analysis.survey import Survey, read_survey
from uavrt.config.tags.tag_files import parse_tags, read_tags, write_tags
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import FlightInfo, Pulse, PulsePose
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.flight.reading.recognise import read_pulse_log
from uavrt.radio.opening import open_recording
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import parse_scenario
from uavrt.simulation.simulated_recording import simulate_to_directory

pytestmark = pytest.mark.slow

SCENARIO = """
duration_s = 70
[radio]
sample_rate_hz = 60000
center_frequency_hz = 166360000
[[tag]]
tag_id = 12
frequency_hz = 166370000
pulse_width_s = 0.0025
pulse_intervals_s = [2.3]
gaps_s = [0.022, 0.0488, 0.0366]
crystal_error_ppm = 40
north_m = 200
east_m = 200
erp_dbm = -55
[flight]
height_m = 40
[[flight.leg]]
duration_s = 5
[[flight.leg]]
duration_s = 60
turn_deg = 360
[[flight.leg]]
duration_s = 5
"""


def flown_info(folder: Path, scenario: Scenario) -> FlightInfo:
    return made.flight_info(
        folder / "flight",
        scenario.tags,
        start_time_ns=scenario.start_time_ns,
        center_frequency_hz=166_360_000.0,
        sample_rate_hz=60_000.0,
    )


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight around a coded tag, detected in its recording, with true poses."""
    folder = tmp_path_factory.mktemp("coded")
    scenario = parse_scenario(SCENARIO)
    recording = simulate_to_directory(scenario, folder / "simulated")
    source = open_recording(recording.metadata, None)
    found: list[Pulse] = []
    detect(source, scenario.tags, found.extend)
    source.close()
    middles_ns = [(pulse.start_time_ns + pulse.end_time_ns) // 2 for pulse in found]
    poses = map(scenario.antenna_pose, middles_ns)
    posed = [PulsePose(pulse=a, pose=b) for a, b in zip(found, poses, strict=True)]
    return made.flight(flown_info(folder, scenario), pulse_poses=posed)


@pytest.fixture(scope="module")
def survey(flight: Path) -> Survey:
    return read_survey(flight)


@pytest.fixture
def exported(survey: Survey, tmp_path: Path) -> Path:
    """A folder with the flight as `find_tags` reads it."""
    export_survey(survey, tmp_path, ["motus"])
    return tmp_path


def test_bursts_make_a_bearing(flight: Path, survey: Survey) -> None:
    stored = read_flight(flight)
    assert stored.info.tags[0].gaps_s == (0.022, 0.0488, 0.0366)
    assert len(stored.pulse_poses) == pytest.approx(30, abs=4)
    assert all(len(one.pulse.burst_starts_ns) >= 3 for one in stored.pulse_poses)
    (bearing,) = survey.bearings_of(12)
    assert bearing.bearing.bearing_deg == pytest.approx(45.0, abs=12.0)


def test_a_report_tells_listed_gaps_and_heard_ones(survey: Survey) -> None:
    assert "Received gaps ms" in said_in_report(survey)
    ((tag, listed, heard, bursts),) = some(code_table(survey))[1]
    assert tag == "12"
    assert int(bursts) >= 20
    assert listed == "22.0 48.8 36.6"
    assert [float(gap) for gap in heard.split()] == pytest.approx([22.0, 48.8, 36.6], abs=0.3)
    assert any(text.startswith("Coded tags.") for text in methods(survey))
    info = some(survey.info)
    beep = replace(info.tags[0], gaps_s=())
    beeping = replace(survey, info=replace(info, tags=(beep,)))
    assert code_table(beeping) is None
    assert not any(text.startswith("Coded tags.") for text in methods(beeping))


def test_bursts_are_exported_for_find_tags_and_silence_has_no_such_files(
    survey: Survey, tmp_path: Path
) -> None:
    names = {path.name for path in export_survey(survey, tmp_path, ["motus", "csv"])}
    assert {"sensorgnome.txt", "detections.csv", "pulses.csv"} <= names
    lines = (tmp_path / "sensorgnome.txt").read_text().splitlines()
    assert lines[0].startswith("S,1700205419")
    assert lines[0].endswith(",1,-m,166.370,0,")
    first = [line.split(",") for line in lines if line.startswith("p1,")][:4]
    times = [float(line[1]) for line in first]
    gaps = [b - a for a, b in pairwise(times)]
    assert gaps == pytest.approx([0.022, 0.0488, 0.0366], abs=1e-3)
    assert all(abs(float(line[2])) < 0.1 for line in first)
    assert all(float(line[3]) > float(line[4]) for line in first)
    head, *rows = (tmp_path / "detections.csv").read_text().splitlines()
    assert head == ",".join(DETECTION_COLUMNS)
    assert [row.split(",")[5] for row in rows] == [str(1 + i) for i in range(len(rows))]
    assert "burst_starts_ns" in (tmp_path / "pulses.csv").read_text().splitlines()[0]
    silent = replace(survey, pulse_poses=())
    assert export_survey(silent, tmp_path / "none", ["motus"]) == []


def test_what_was_exported_is_read_again_and_its_bursts_are_found(
    survey: Survey, exported: Path
) -> None:
    tags = some(survey.info).tags
    other = replace(tags[0], tag_id=13, gaps_s=(0.025, 0.0488, 0.0366))
    sent = [one.pulse for one in survey.pulse_poses]
    whole = [pulse for pulse in sent if len(pulse.burst_starts_ns) == 4]
    log = read_pulse_log(exported / "sensorgnome.txt")
    assert len(log.pulse_poses) == sum(len(pulse.burst_starts_ns) for pulse in sent)
    bursts = [one.pulse for one in bursts_of_pulses(log.pulse_poses, [other, *tags])]
    assert {burst.tag_id for burst in bursts} == {12}
    found = {burst.start_time_ns // 10**6 for burst in bursts}
    # Of weak bursts the gaps are off by more than the tolerance.
    assert found <= {pulse.burst_starts_ns[0] // 10**6 for pulse in whole}
    assert len(found) >= 0.8 * len(whole)
    assert all(burst.confirmed for burst in bursts)
    detections = read_pulse_log(exported / "detections.csv")
    confirmed = [pulse for pulse in sent if pulse.confirmed]
    assert [one.pulse.tag_id for one in detections.pulse_poses] == [12] * len(confirmed)
    again = export_survey(read_survey(exported / "detections.csv"), exported / "2", ["csv"])
    (table,) = (path.read_text() for path in again if path.name == "pulses.csv")
    assert table.count("\n") == 1 + len(confirmed)


def test_bursts_of_equal_pulses_name_both_codes(survey: Survey, exported: Path) -> None:
    (tag,) = some(survey.info).tags
    near = replace(tag, tag_id=13, gaps_s=(0.0224, 0.0488, 0.0366))
    log = read_pulse_log(exported / "sensorgnome.txt")
    found = [one.pulse for one in bursts_of_pulses(log.pulse_poses, [tag, near])]
    both = [one for one in found if {one.tag_id, *one.also_possible_tag_ids} == {12, 13}]
    assert len(both) > len(found) / 2
    assert not any(one.confirmed for one in both)


def test_a_coded_tag_is_measured_as_one_not_as_several_that_beep(
    flight: Path, ran: Ran
) -> None:
    recording = flight.parent / "simulated" / "simulation.sigmf-meta"
    written, told = ran("tags", "measure", recording)
    assert "this looks coded: " in told
    (tag,) = parse_tags(written.encode(), name="tags.toml")
    assert tag.gaps_s == pytest.approx((0.022, 0.0488, 0.0366), abs=5e-4)
    crystal_ms = 2300.0 * 1.00004
    every_ms = float(told.split("bursts     every ")[1].split()[0])
    assert every_ms == pytest.approx(crystal_ms, abs=0.02)
    assert tag.pulse_intervals_s[0] == pytest.approx(1e-3 * crystal_ms, abs=1e-4)


def test_near_codes_of_a_list_are_named_wherever_it_is_given(
    flight: Path, survey: Survey, exported: Path, ran: Ran
) -> None:
    (tag,) = some(survey.info).tags
    listed = exported / "tags.toml"
    write_tags(listed, [tag, replace(tag, tag_id=13, gaps_s=(0.0224, 0.0488, 0.0366))])
    said = "warning: codes 12 and 13 are too similar: their gaps differ by 0.4 ms"
    simulated = flight.parent / "simulated"
    pulses, where = exported / "sensorgnome.txt", ("-o", exported / "bursts.csv")
    attach = ("attach", pulses, simulated / "telemetry.csv", *where, "--clock-offset", 0)
    assert said in ran(*attach, "--tags", listed).err
    samples = ("--recording", simulated / "simulation.sigmf-meta", "--frequency-window", 120)
    assert said in ran("integrate", flight, "--tags", listed, *samples, ends=2).err


def test_a_simulated_list_confirms_the_bursts_of_its_own_recording(
    flight: Path, exported: Path
) -> None:
    listed = read_tags(flight.parent / "simulated" / "tags.toml")
    assert (listed[0].interval_uncertainty_s, listed[0].k) == (0.004, 10)
    log = read_pulse_log(exported / "sensorgnome.txt")
    for tag in (listed[0], replace(listed[0], interval_uncertainty_s=0.0)):
        found = [one.pulse for one in bursts_of_pulses(log.pulse_poses, [tag])]
        assert len(found) > 20
        assert sum(one.confirmed for one in found) > 0.9 * len(found)


TWO_PLACES = """
duration_s = 100
seed = 5
[radio]
sample_rate_hz = 60000
center_frequency_hz = 166360000
[[tag]]
tag_id = 12
frequency_hz = 166370000
pulse_width_s = 0.0025
pulse_intervals_s = [2.3]
gaps_s = [0.022, 0.0488, 0.0366]
k = 10
interval_uncertainty_s = 0.004
north_m = 200
east_m = 200
erp_dbm = -58
[[tag]]
tag_id = 14
frequency_hz = 166370000
pulse_width_s = 0.0025
pulse_intervals_s = [2.3]
gaps_s = [0.022, 0.031, 0.0544]
k = 10
interval_uncertainty_s = 0.004
first_pulse_s = 1.6
north_m = -150
east_m = 100
erp_dbm = -50
[flight]
height_m = 40
[[flight.leg]]
duration_s = 40
turn_deg = 360
[[flight.leg]]
duration_s = 20
east_m = 200
[[flight.leg]]
duration_s = 40
turn_deg = 360
"""


def test_a_whole_flight_places_a_code_beside_one_that_shares_three_of_its_pulses(
    tmp_path: Path, ran: Ran
) -> None:
    scenario = parse_scenario(TWO_PLACES)
    recording = simulate_to_directory(scenario, tmp_path / "simulated")
    times_ns = [scenario.start_time_ns + number * 200_000_000 for number in range(501)]
    flight = made.flight(
        flown_info(tmp_path, scenario), poses=map(scenario.antenna_pose, times_ns)
    )
    sender = scenario.tags[0]
    silent = replace(sender, tag_id=13, gaps_s=(0.0366, 0.0488, 0.031))
    write_tags(tmp_path / "listed.toml", [sender, silent])
    found, other = ran(
        *("integrate", flight, "--recording", recording.metadata, "--no-save", "--json"),
        *("--tags", tmp_path / "listed.toml", "--frequency-window", 40),
    ).json
    assert found["found"]
    assert len(found["integrated_pulses"]) == pytest.approx(40, abs=6)
    assert found["radius95_m"] < 400.0
    begun = scenario.antenna_pose(scenario.start_time_ns)
    plane = TangentPlane(latitude_deg=begun.latitude_deg, longitude_deg=begun.longitude_deg)
    latitude, longitude = plane.to_geodetic(200.0, 200.0)
    assert any(_around(ring, float(latitude), float(longitude)) for ring in found["region95"])
    assert other["other_trains"]
    assert not other["found"]
    assert all(one["other_code"] for one in other["other_trains"])


def _around(ring: list[list[float]], latitude: float, longitude: float) -> bool:
    """Whether an outline goes around a place: a ray crosses it an odd number of times."""
    crossed = False
    for (north, east), (north2, east2) in pairwise(ring):
        if (north > latitude) != (north2 > latitude):
            at = east + (latitude - north) / (north2 - north) * (east2 - east)
            crossed ^= longitude < at
    return crossed
