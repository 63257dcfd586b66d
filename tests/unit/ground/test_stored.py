"""What the ground has taken is stored, or known not to be."""

import itertools
from pathlib import Path

import pytest
from pulses import pulse_at
from some import some
from virtual_time import follow

from uavrt.core.clock import Clock
from uavrt.core.errors import RecordingError
from uavrt.core.messages import BurstInside, PulsePose
from uavrt.flight.logs.pulse_files import read_pulse_file
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store import flight_keeper, flight_queue
from uavrt.ground.store.flight_keeper import FlightKeeper
from uavrt.ground.store.flight_queue import RETRY_S
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.store.stored import PulseLines, read_ground_pulses

START_NS = 1_777_636_800_000_000_000


def pulse(number: int) -> PulsePose:
    return PulsePose(pulse=pulse_at(START_NS + number * 1_200_000_000), pose=None)


def inside(item: PulsePose) -> BurstInside:
    start_ns = item.pulse.start_time_ns
    return BurstInside(
        tag_id=item.pulse.tag_id,
        start_time_ns=start_ns,
        burst_starts_ns=(start_ns, start_ns + 25_000_000),
        burst_snrs_db=(20.0, 21.0),
        also_possible_tag_ids=(4,),
    )


@pytest.fixture
def patient() -> None:
    """Advance the clock by 1 s at each reading, so that a failing disk is tried again."""
    seconds = itertools.count(1000.0, RETRY_S)
    follow(lambda: next(seconds))


@pytest.mark.usefixtures("patient")
def test_two_flights_of_a_disk_that_was_not_there_are_whole_when_it_is(tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.write_text("a file in its place")
    keeper = FlightKeeper(disk, Clock.start())
    for first in (0, 10):
        keeper.begin(())
        assert all(keeper.add_pulse(pulse(first + number)) for number in range(10))
        keeper.queue.commit()
        assert not keeper.queue.stored
        assert keeper.queue.fault is not None
    disk.unlink()
    keeper.queue.commit()
    assert keeper.queue.stored
    assert keeper.queue.fault is None
    keeper.close()
    # Of one second they have one name; no pulse is missing either way.
    found = {one.key for one in read_ground_pulses(disk)}
    assert found == {pulse(number).pulse.key for number in range(20)}


@pytest.mark.usefixtures("patient")
def test_more_pulses_than_may_wait_stay_with_the_drone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(flight_queue, "MOST_WAITING", 5)
    disk = tmp_path / "disk"
    disk.write_text("a file in its place")
    keeper = FlightKeeper(disk, Clock.start())
    with pytest.raises(RecordingError, match="no flight is open"):
        keeper.add_pulse(pulse(0))
    flight_id = keeper.begin(())
    for number in range(5):
        assert keeper.add_pulse(pulse(number))
    for _ in range(2):
        with pytest.raises(RecordingError, match="cannot make"):
            keeper.add_pulse(pulse(5))
        with pytest.raises(RecordingError, match="cannot make"):
            keeper.put_inside(inside(pulse(1)))
    disk.unlink()
    keeper.queue.commit()
    assert keeper.add_pulse(pulse(5))
    keeper.close()
    assert len(read_flight(disk / flight_id).pulse_poses) == 6


def test_what_is_inside_a_burst_of_the_flight_before_reaches_that_flight(
    tmp_path: Path,
) -> None:
    keeper = FlightKeeper(tmp_path, Clock.start())
    before = keeper.begin(())
    keeper.add_pulse(pulse(0))
    after = keeper.begin(())
    assert not keeper.put_inside(inside(pulse(0)))
    assert not keeper.queue.stored
    keeper.queue.commit()
    assert keeper.queue.stored
    keeper.close()
    assert before != after
    (item,) = read_flight(tmp_path / before).pulse_poses
    assert item.pulse.burst_starts_ns == inside(item).burst_starts_ns
    assert item.pulse.also_possible_tag_ids == (4,)


def test_what_comes_before_its_burst_is_refused_until_the_burst_is_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A refused message is not acknowledged, so the drone sends it again."""
    now_s = 100.0
    monkeypatch.setattr(flight_keeper, "monotonic_s", lambda: now_s)
    keeper = FlightKeeper(tmp_path, Clock.start())
    flight_id = keeper.begin(())
    for _ in range(2):
        with pytest.raises(RecordingError, match="not the report of their burst"):
            keeper.put_inside(inside(pulse(0)))
    with pytest.raises(RecordingError, match="not the report of their burst"):
        keeper.put_inside(inside(pulse(1)))
    assert keeper.add_pulse(pulse(0))
    assert keeper.put_inside(inside(pulse(0)))
    now_s += flight_keeper.BURST_TIMEOUT_S
    assert not keeper.put_inside(inside(pulse(1)))
    assert keeper.without_burst == 1, "of a flight that is not here: the drone may forget it"
    keeper.close()
    (item,) = read_flight(tmp_path / flight_id).pulse_poses
    assert item.pulse.burst_starts_ns == inside(item).burst_starts_ns


def test_lines_of_pulses_are_whole_once_and_go_on_after_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "pulses.jsonl"
    lines = PulseLines(path)
    assert [lines.write(pulse(number)) for number in (0, 1, 0)] == [True, True, False]
    lines.close()
    path.write_bytes(path.read_bytes() + b'{"tag_id": 2, "frequ')
    lines = PulseLines(path)
    assert [lines.write(pulse(number)) for number in (1, 2)] == [False, True]
    assert lines.write(inside(pulse(2)))
    lines.close()
    found = read_pulse_file(path)
    assert [one.pulse.key for one in found] == [pulse(n).pulse.key for n in range(3)]
    assert found[2].pulse.burst_snrs_db == (20.0, 21.0)
    assert path.read_bytes().count(b"\n") == 4


def test_lines_that_cannot_be_written_are_refused_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot write") as refused:
        PulseLines(tmp_path / "no" / "pulses.jsonl")
    assert "-o" in some(refused.value.remedy)


def test_what_a_full_disk_did_not_keep_of_the_session_is_kept_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = GroundStore(tmp_path)
    with monkeypatch.context() as full:

        def refuse(*_: object) -> None:
            raise OSError(28, "No space left on device")

        full.setattr("uavrt.ground.store.ground_settings.write_atomically", refuse)
        store.set_flight("flight_log_1")
        store.set_served(3, "uid", None)
    assert GroundStore(tmp_path).current_flight is None
    store.set_served(3, "uid", None)
    again = GroundStore(tmp_path)
    assert again.current_flight == "flight_log_1"
    assert again.vehicle == (3, "uid")
