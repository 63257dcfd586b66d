"""What survives the supervisor, and what does not."""

import os
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from operated import Operator
from some import some
from virtual_time import VirtualClock

from uavrt.core.clock import Clock
from uavrt.core.commands import SystemState
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Command, FlightInfo
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.saved_state import STATE_NAME, SavedState, StateStore
from uavrt.drone.supervisor.mission.wall_clock import (
    REPEAT_AFTER_S,
    REPORTED_CORRECTION_S,
    WallClockWatch,
)

TAG = made.tag()


def new_mission(directory: Path) -> Mission:
    return Operator(directory).mission


def commanded(directory: Path, *names: str) -> Mission:
    """A mission that was given these commands."""
    operator = Operator(directory)
    for name in names:
        details: dict[str, Any] = {"add_tag": {"tag": TAG}, "start_detection": {"gain": 17}}
        reply = operator.say(name, **details.get(name, {}))
        assert reply.accepted, reply.message
    return operator.mission


START = ("start_tags", "add_tag", "end_tags", "start_detection")


def test_a_flight_goes_on_with_its_tags_gain_clock_and_directory(tmp_path: Path) -> None:
    before = commanded(tmp_path, *START[:3])
    before.flights.clock = Clock(before.flights.clock.offset_ns - 12_345_678_901)
    before.command(Command(name="start_detection", request_id=1, gain=17))
    after = new_mission(tmp_path)
    assert after.resume()
    assert after.state is SystemState.DETECTING
    assert after.upload.tags == before.upload.tags
    assert after.flights.flight == before.flights.flight
    assert after.settings.now.radio.gain == 17
    assert after.flights.clock == before.flights.clock


@pytest.mark.parametrize(
    ("commands", "state"),
    [
        ((), SystemState.IDLE),
        (START[:1], SystemState.IDLE),
        (START[:2], SystemState.IDLE),
        (START[:3], SystemState.HAS_TAGS),
        (START, SystemState.DETECTING),
        ((*START, "stop_detection"), SystemState.HAS_TAGS),
    ],
)
def test_what_was_acknowledged_is_there_again(
    tmp_path: Path, commands: tuple[str, ...], state: SystemState
) -> None:
    commanded(tmp_path, *commands)
    after = new_mission(tmp_path)
    after.resume()
    assert after.state is state
    assert bool(after.upload.tags) == (state in (SystemState.HAS_TAGS, SystemState.DETECTING))


def test_after_an_end_in_good_order_everything_begins_afresh(tmp_path: Path) -> None:
    before = commanded(tmp_path, *START)
    before.delete_saved_state()
    after = new_mission(tmp_path)
    assert not after.resume()
    assert after.state is SystemState.IDLE
    assert not after.upload.tags


def test_each_flight_has_the_wall_clocks_time_at_its_start_and_keeps_it(
    tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    mission = commanded(tmp_path, *START[:3])
    clock_of_test.wall_offset_s += 3600  # by GPS, after uavrt had started
    first = mission.flights.begin(None)
    assert first.start_time_ns == clock_of_test.time_ns()
    assert mission.flights.clock.offset_ns == first.clock_offset_ns
    clock_of_test.wall_offset_s -= 3600
    assert mission.flights.clock.wall_correction_ns() == -3600 * 10**9
    mission.flight_ended()
    second = mission.flights.begin(None)
    assert second.start_time_ns == clock_of_test.time_ns()


def test_the_last_flights_outlive_the_supervisor_while_their_pulses_may_be_missing(
    tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    mission = commanded(tmp_path, *START[:3])
    flown = []
    for _ in range(5):
        clock_of_test.now_s += 2.0
        flown.append(mission.flights.begin(148.7e6).directory)
        mission.flight_ended()
    assert list(mission.flights.last) == flown[-3:]
    after = new_mission(tmp_path)
    after.resume()
    assert list(after.flights.last) == flown[-3:]
    reboot(tmp_path)
    clock_of_test.wall_offset_s += 7e5
    next_week = new_mission(tmp_path)
    next_week.resume()
    assert not next_week.flights.last


@given(st.lists(st.floats(-7200.0, 7200.0), max_size=30))
def test_every_correction_of_the_wall_clock_is_noted_once(corrections_s: list[float]) -> None:
    watch = WallClockWatch()
    noted_s = 0.0
    for correction_s in corrections_s:
        for repeat in range(3):
            text = watch.check(round(correction_s * 1e9))
            new = (
                repeat == 0
                and abs(round(correction_s * 1e9) / 1e9 - noted_s) >= REPORTED_CORRECTION_S
            )
            assert (text is not None) == new
            if new:
                noted_s = round(correction_s * 1e9) / 1e9
                assert f"{noted_s:+.3f} s from it" in str(text)
    watch.flight_started(0.0)
    assert watch.check(0) is None


def test_a_wrong_time_is_told_once_more_to_a_later_station(clock_of_test: VirtualClock) -> None:
    clock_of_test.wall_offset_s = 0.0
    watch = WallClockWatch()
    assert str(watch.flight_started(100.0)).startswith("Drone's clock: ")
    told = [second for second in range(100, 130) if watch.repeated_warning(float(second))]
    assert told == [100 + REPEAT_AFTER_S]


def reboot(directory: Path) -> None:
    """Mark the saved state as one of the previous boot."""
    store = StateStore(directory)
    store.keep(replace(some(store.read()), boot_id="the boot before"))


def rebooted(directory: Path, clock: VirtualClock, off_s: float) -> tuple[FlightInfo, Mission]:
    """A flight cut off by the battery, and the mission of the next boot."""
    before = commanded(directory, *START)
    flight = some(before.flights.flight)
    database = Path(flight.directory) / "flight.sqlite"
    database.write_bytes(b"")
    os.utime(database, ns=(clock.time_ns(), clock.time_ns()))
    reboot(directory)
    clock.wall_offset_s += off_s
    return flight, new_mission(directory)


def test_after_a_brown_out_flight_and_clock_are_new(
    tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    flight, after = rebooted(tmp_path, clock_of_test, 40.0)
    assert after.resume()
    assert after.flights.flight is not None
    assert after.flights.flight.directory != flight.directory
    assert after.flights.flight.center_frequency_hz == flight.center_frequency_hz
    assert after.flights.clock.offset_ns == after.flights.flight.clock_offset_ns
    assert after.flights.last == deque([flight.directory])  # it may have more for the ground


def test_last_weeks_flight_starts_no_radio(tmp_path: Path, clock_of_test: VirtualClock) -> None:
    _, after = rebooted(tmp_path, clock_of_test, 7 * 86_400.0)
    assert not after.resume()
    assert after.state is SystemState.HAS_TAGS
    assert after.upload.tags == {2: TAG}


def test_a_flight_whose_directory_is_gone_goes_on_in_a_new_one(tmp_path: Path) -> None:
    before = commanded(tmp_path, *START)
    Path(some(before.flights.flight).directory).rmdir()
    after = new_mission(tmp_path)
    assert after.resume()
    assert Path(some(after.flights.flight).directory).is_dir()


@example(garbage=b'\x80"', keep=12)  # no UTF-8
@given(st.binary(max_size=200), st.integers(0, 400))
def test_a_damaged_file_is_put_aside_and_stops_nothing(
    tmp_path_factory: pytest.TempPathFactory, garbage: bytes, keep: int
) -> None:
    directory = tmp_path_factory.mktemp("flights")
    store = StateStore(directory)
    state = SavedState(
        boot_id="b", clock_offset_ns=1, state=SystemState.HAS_TAGS, tags=(TAG,), flight=None
    )
    store.keep(state)
    assert store.read() == state
    path = directory / STATE_NAME
    whole = path.read_bytes()
    torn = whole[:keep] + garbage
    path.write_bytes(torn)
    loaded = store.read()
    assert (loaded is None) == (not path.exists())


def test_only_one_supervisor_flies_from_a_directory(tmp_path: Path) -> None:
    first, second = StateStore(tmp_path), StateStore(tmp_path)
    first.claim()
    with pytest.raises(ConfigError, match="already running"):
        second.claim()


def test_a_disk_that_cannot_be_written_costs_the_memory_only(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    store = StateStore(blocked / "flights")
    store.claim()
    mission = new_mission(tmp_path)
    store.keep(
        SavedState(boot_id="b", clock_offset_ns=0, state=mission.state, tags=(), flight=None)
    )
    assert store.read() is None
