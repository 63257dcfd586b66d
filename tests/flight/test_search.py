"""The real processes search for a simulated animal by themselves, until somebody takes over."""

import json
import math
import os
import random
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import mavsdk
import pytest
from command_line import started
from mavsdk.plugins.action import Action
from tests.flight.conftest import FLIGHT_RATE_HZ, THESIS_TAG, DroneBay
from tests.flight.test_fly import Field
from until import until

from uavrt.core.earth.geodesy import distance_m
from uavrt.core.messages import SearchNote
from uavrt.flight.reading.flight_reader import read_search_notes
from uavrt.simulation.scene.antenna import Antenna
from uavrt.simulation.scene.demo_world import search_scenario
from uavrt.simulation.scene.flight import Flight
from uavrt.simulation.scene.scenario import Radio, Scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.vehicle.airframe import Flavour
from uavrt_experiments.resources.usage import pss_mb

pytestmark = [pytest.mark.slow, pytest.mark.timeout(300)]
KILLS = int(os.environ.get("UAVRT_KILLS", "1"))
GUIDE_MB = 80.0
VICTIMS = ("guide", "connection", "supervisor")


def animal() -> Scenario:
    """One that rests 85 m from where the drone hovers; it beeps fast, so it is found soon."""
    tag = replace(
        THESIS_TAG, pulse_intervals_s=(0.6,), north_m=70.0, east_m=50.0, erp_dbm=-60.0
    )
    return Scenario(
        duration_s=600.0,
        seed=3,
        radio=Radio(center_frequency_hz=148_705_000.0, sample_rate_hz=FLIGHT_RATE_HZ),
        antenna=Antenna(pattern="RA-23K"),
        tag=(tag,),
        flight=Flight(height_m=40.0),
    )


def searching(bay: DroneBay, flavour: Flavour, work: Path) -> Field:
    scenario = animal()
    return Field(bay, flavour, work, scenario, tags=scenario.tags)


def test_demos_say_that_a_search_was_cut_short(tmp_path: Path) -> None:
    """One drone, and at the same time two that search together at one ground station."""
    world = search_scenario(1)
    slower = replace(world, radio=replace(world.radio, sample_rate_hz=FLIGHT_RATE_HZ))
    file = tmp_path / "world.toml"
    write_scenario(slower, file)
    words = ("demo", "--search", "--json", "--duration", "12", "--scenario", file)
    runs = (
        ("--flight-dir", tmp_path / "one"),
        ("--flight-dir", tmp_path / "two", "--drones", "2"),
    )
    with ThreadPoolExecutor() as pool:
        one, two = pool.map(lambda more: started(*words, *more, timeout=200), runs)

    assert one.returncode == 1, one.stderr
    summary = json.loads(one.stdout.splitlines()[-1])
    assert not all(tag["found"] for tag in summary["tags"].values())
    assert set(summary["tags"]) == {"2", "4", "6"}
    assert 20.0 < summary["guide_memory_mb"] <= GUIDE_MB
    assert "the search time is over" in one.stderr
    # The first goal, and the way home.
    assert summary["commands"] >= 2
    (flight,) = (tmp_path / "one").glob("flight_log_*")
    assert {note.event for note in read_search_notes(flight)} >= {"begun", "decision"}

    assert two.returncode == 1, two.stderr  # the time is over before all are found
    summary = json.loads(two.stdout.splitlines()[-1])
    assert set(summary["drones"]) == {"1", "2"}
    assert summary["apart_m"] >= 25.0
    for number in ("1", "2"):
        assert f"drone {number}: " in two.stderr
        flights = (tmp_path / "two" / f"drone-{number}").glob("flight_log_*")
        notes = read_search_notes(next(flights))
        assert {note.event for note in notes} >= {"begun", "decision"}
        assert notes[0].height_m == pytest.approx(40.0 if number == "1" else 52.0, abs=2.0)


def notes_until_the_end(field: Field) -> tuple[SearchNote, ...]:
    (flight,) = (field.drone.directory / "flights").glob("flight_log_*")

    def notes() -> tuple[SearchNote, ...]:
        return read_search_notes(flight)

    until(lambda: notes() and notes()[-1].event == "ended")
    return notes()


def test_it_finds_an_animal_and_returns(drone_bay: DroneBay, tmp_path: Path) -> None:
    field = searching(drone_bay, "px4", tmp_path)
    program = field.ordered("search", "--radius", "130", "--accuracy", "40")
    guide, sizes_mb = field.drone.pid_of("guide"), [0.0]

    def over() -> bool:
        sizes_mb.append(pss_mb(guide))
        return program.ended

    field.qgc.until(over, 200.0)
    assert 10.0 < max(sizes_mb) <= GUIDE_MB
    assert "returning: the autopilot flies home" in field.events()
    assert program.exit_code == 0
    notes = notes_until_the_end(field)
    assert notes[0].event == "begun"
    assert {"decision", "found"} <= {note.event for note in notes}
    (told,) = notes[-1].tags
    assert told.found_s is not None
    assert told.radius95_m <= 40.0
    truth = field.drone.scenario.tag_position(2, field.drone.scenario.start_time_ns)
    assert distance_m(told.latitude_deg, told.longitude_deg, *truth) < 60.0
    field.qgc.close()


def test_a_takeover_in_the_middle_of_a_decision_ends_a_search_for_good(
    drone_bay: DroneBay, tmp_path: Path
) -> None:
    field = searching(drone_bay, "ardupilot", tmp_path)
    qgc = field.qgc
    program = field.ordered("search", "--radius", "130", "--accuracy", "5")
    qgc.until(lambda: program.ended or field.commands() >= 3, 60.0)
    assert not program.ended
    guide, place = field.drone.pid_of("guide"), qgc.place
    assert place is not None
    qgc.close()
    with pilot_by_mavsdk(field.drone.ground_port) as pilot:
        os.kill(guide, signal.SIGSTOP)  # it thinks for longer than any pilot waits
        try:
            # In our own mode: only its target shows that it is somebody else's.
            pilot.goto_location(place.lat / 1e7 + 0.001, place.lon / 1e7, place.alt / 1e3, 0.0)
            time.sleep(0.2)
            sent = field.commands()
        finally:
            os.kill(guide, signal.SIGCONT)
        until(lambda: program.ended, 5.0)
        assert "another program has set a target" in field.events()
        time.sleep(8.0)
    assert field.commands() == sent
    assert notes_until_the_end(field)[-1].text == "0 of 1 found"


@contextmanager
def pilot_by_mavsdk(port: int) -> Iterator[Action]:
    """A second station that nobody here wrote, at the autopilot's ground port."""
    sdk = mavsdk.Mavsdk(mavsdk.Configuration.create_manual(255, 190, True))
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        until(sdk.get_systems, 20.0)
        yield Action(sdk.get_systems()[0])
    finally:
        sdk.destroy()


def hovers(field: Field) -> None:
    """Wait until it stands, at the end of the leg that it was given at the latest."""

    def stands() -> bool:
        place = field.qgc.place
        return place is not None and math.hypot(place.vx, place.vy) < 50.0  # cm/s

    field.qgc.until(stands, 60.0)
    place = field.qgc.place
    assert place is not None
    field.qgc.listen(5.0)
    assert field.qgc.off_m(place) < 2.0


@pytest.mark.parametrize("number", range(KILLS))
def test_a_search_that_is_killed_anywhere_leaves_the_drone_hovering(
    drone_bay: DroneBay, tmp_path: Path, number: int
) -> None:
    """``UAVRT_KILLS=50`` kills as often as the promise names."""
    rng = random.Random(number)
    flavour: Flavour = rng.choice(("px4", "ardupilot"))
    victim = VICTIMS[number % len(VICTIMS)]
    field = searching(drone_bay, flavour, tmp_path)
    program = field.ordered("search", "--radius", "130", "--accuracy", "5")
    field.qgc.listen(rng.uniform(0.0, 12.0))
    supervisor = field.drone.supervisor.pid
    os.kill(
        supervisor if victim == "supervisor" else field.drone.pid_of(victim), signal.SIGKILL
    )
    field.qgc.listen(0.3)
    sent = field.commands()
    hovers(field)
    assert field.commands() == sent
    program.stop()
    if victim != "supervisor":
        status = field.fly("status")
        field.qgc.until(lambda: status.ended, 30.0)
        assert '"event": "out"' in field.events()
    assert field.commands() == sent
    field.qgc.close()
