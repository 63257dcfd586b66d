"""Bursts for find_tags: a port for each nominal frequency, and detections that say which."""

import csv
from pathlib import Path

import made
import pytest

from uavrt.analysis.export.written import export_survey
from uavrt.analysis.survey import read_survey
from uavrt.core.messages import Pulse, PulsePose, Tag
from uavrt.flight.logs.pulse_files import PulseWriter
from uavrt.flight.reading.recognise import read_pulse_log

START_NS = 1_700_205_419_500_000_000
LOW = made.tag(
    16,
    166_350_000.0,
    9.7,
    name="Wren",
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.041, 0.0266),
)
HIGH = made.tag(
    12,
    166_370_500.0,
    2.3,
    name="Robin",
    pulse_width_s=0.0025,
    interval_uncertainty_s=0.004,
    k=10,
    gaps_s=(0.022, 0.0488),
)


def _burst(tag: Tag, number: int, off_hz: float) -> Pulse:
    first_ns = START_NS + (0 if tag is LOW else 400_000_000)
    start_ns = first_ns + round(number * tag.pulse_intervals_s[0] * 1e9)
    starts_ns = [start_ns]
    for gap_s in tag.gaps_s:
        starts_ns.append(starts_ns[-1] + round(gap_s * 1e9))
    return made.pulse(
        start_ns,
        tag_id=tag.tag_id,
        frequency_hz=tag.frequency_hz + off_hz,
        end_time_ns=starts_ns[-1] + 2_500_000,
        group_sequence=number,
        noise_psd=1e-9,
        burst_starts_ns=tuple(starts_ns),
        burst_snrs_db=(20.0, 19.0, 21.0),
    )


BURSTS = [
    *(_burst(LOW, number, -7.0) for number in range(2)),
    *(_burst(HIGH, number, 120.0) for number in range(5)),
]


def _flight(folder: Path, tags: tuple[Tag, ...]) -> Path:
    info = made.flight_info(
        folder,
        tags,
        start_time_ns=START_NS,
        center_frequency_hz=166_360_000.0,
        sample_rate_hz=60_000.0,
    )
    made.flight(info, pulse_poses=tuple(PulsePose(pulse=one, pose=None) for one in BURSTS))
    return folder


def test_each_nominal_frequency_has_a_port_that_is_tuned_to_it(tmp_path: Path) -> None:
    flight = _flight(tmp_path / "flight", (LOW, HIGH))
    export_survey(read_survey(flight), tmp_path, ["motus"])
    lines = (tmp_path / "sensorgnome.txt").read_text().splitlines()
    assert lines[:8] == [
        "S,1700205419.500000,1,-m,166.350,0,",
        "S,1700205419.500000,2,-m,166.3705,0,",
        "p1,1700205419.500000,-0.007,-70.00,-90.00",
        "p1,1700205419.541000,-0.007,-71.00,-90.00",
        "p1,1700205419.567600,-0.007,-69.00,-90.00",
        "p2,1700205419.900000,0.120,-70.00,-90.00",
        "p2,1700205419.922000,0.120,-71.00,-90.00",
        "p2,1700205419.970800,0.120,-69.00,-90.00",
    ]
    assert len(lines) == 2 + 3 * len(BURSTS)
    assert max(abs(float(line.split(",")[2])) for line in lines[2:]) < 0.2


def test_two_frequencies_are_read_again_where_they_were(tmp_path: Path) -> None:
    flight = _flight(tmp_path / "flight", (LOW, HIGH))
    export_survey(read_survey(flight), tmp_path, ["motus"])
    again = read_pulse_log(tmp_path / "sensorgnome.txt").pulse_poses
    sent = {start_ns: one.frequency_hz for one in BURSTS for start_ns in one.burst_starts_ns}
    assert len(again) == 3 * len(BURSTS)
    for one in again:
        near = [hz for ns, hz in sent.items() if abs(ns - one.pulse.start_time_ns) < 1000]
        assert one.pulse.frequency_hz in [pytest.approx(hz, abs=1.0) for hz in near]
    assert {one.pulse.tag_id for one in again} == {1, 2}


def test_without_a_list_ports_follow_from_what_was_heard(tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    with path.open("w", newline="") as stream:
        writer = PulseWriter(stream, "csv", bursts=True)
        for one in BURSTS:
            writer.write(one)
    export_survey(read_survey(path), tmp_path / "out", ["motus"])
    lines = (tmp_path / "out" / "sensorgnome.txt").read_text().splitlines()
    tuned = [line for line in lines if line.startswith("S,")]
    assert [line.split(",")[4] for line in tuned] == ["166.350", "166.371"]
    offsets = [float(line.split(",")[2]) for line in lines if line.startswith("p")]
    assert max(map(abs, offsets)) <= 0.5


@pytest.mark.parametrize("listed", [True, False])
def test_detections_say_what_their_frequency_is_an_offset_from(
    tmp_path: Path, listed: bool
) -> None:
    flight = _flight(tmp_path / "flight", (LOW, HIGH) if listed else ())
    export_survey(read_survey(flight), tmp_path, ["motus"])
    with (tmp_path / "detections.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    nominal = {"16": ("1", "166.350"), "12": ("2", "166.3705" if listed else "166.371")}
    assert {row["id"]: (row["ant"], row["nomFreq"]) for row in rows} == nominal
    assert {row["freqsd"] for row in rows} == {""}  # a burst has one frequency
    log = read_pulse_log(tmp_path / "detections.csv")
    sent = sorted(BURSTS, key=lambda one: one.start_time_ns)
    heard = [one.pulse.frequency_hz for one in log.pulse_poses]
    assert sorted(heard) == pytest.approx(sorted(one.frequency_hz for one in sent), abs=1.0)
    export_survey(read_survey(tmp_path / "detections.csv"), tmp_path / "again", ["csv"])
    with (tmp_path / "again" / "pulses.csv").open() as stream:
        assert all(float(row["frequency_hz"]) > 166e6 for row in csv.DictReader(stream))
