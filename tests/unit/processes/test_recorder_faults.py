"""The recorder reports a flight that it cannot write within five seconds, pulses or not."""

import shutil
from pathlib import Path

import pytest
from tests.unit.processes.test_recorder import Drone, posed, pulse
from tests.unit.processes.test_recorder import drone as drone

from uavrt.core.messages import StatusText
from uavrt.flight.reading.flight_reader import read_flight

WITHIN_S = 5


def passing(drone: Drone, seconds: int) -> None:
    """Let seconds pass in which there is only a text to write."""
    for _ in range(seconds * 2):
        drone.send("status_text", StatusText(severity=6, text="something to write"))
        drone.turn(0.5)


def complaints(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What the supervisor makes texts for the operator of."""
    printed = capsys.readouterr()
    return [
        line
        for line in (printed.out + printed.err).splitlines()
        if "cannot write the flight" in line
    ]


def test_a_flight_without_pulses_that_cannot_be_written_is_reported_within_5_s(
    drone: Drone, capsys: pytest.CaptureFixture[str]
) -> None:
    drone.fly()
    passing(drone, 20)
    assert complaints(capsys) == []
    flight = Path(drone.info.directory)
    flight.rename(flight.with_name("away"))
    flight.write_text("a file in its place")
    passing(drone, WITHIN_S)
    assert len(complaints(capsys)) == 1, "once"
    flight.unlink()
    passing(drone, WITHIN_S)
    assert complaints(capsys) == []
    assert len(read_flight(flight).status_texts) >= 2 * (20 + WITHIN_S)


def test_a_flight_that_cannot_begin_is_reported_within_5_s(
    drone: Drone, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(drone.flights)
    drone.flights.write_text("a file in its place")
    drone.fly()
    passing(drone, WITHIN_S)
    assert len(complaints(capsys)) == 1


def test_a_database_that_was_removed_is_reported_and_written_again_within_5_s(
    drone: Drone,
) -> None:
    drone.fly()
    one, other = pulse(1.0), pulse(8.0)
    drone.send("pulse", one)
    drone.send("pulse_pose", posed(one))
    passing(drone, 6)
    (Path(drone.info.directory) / "flight.sqlite").unlink()
    passing(drone, WITHIN_S)
    texts = [told.text for told in drone.heard("status_text")]
    assert texts == [
        "Recorder: the flight's database was removed or replaced, and is written again"
    ]
    drone.send("pulse", other)
    drone.send("pulse_pose", posed(other))
    drone.end()
    assert set(drone.stored()) == {one, other}
