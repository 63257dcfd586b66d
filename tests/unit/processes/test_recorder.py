"""The recorder in this program, with the test in the supervisor's place."""

import gc
import shutil
import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from some import some
from sql import sql
from virtual_time import VirtualClock

from uavrt.config.settings import AntennaSettings, RecordingSettings, Settings
from uavrt.core.messages import (
    Command,
    CommandReply,
    Delivered,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    Recorded,
    RecordsHandled,
    StatusText,
)
from uavrt.drone.ipc.process import ProcessFrame
from uavrt.drone.ipc.record_link import LineBuffer, RecordSocket
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import decode_record, encode_record
from uavrt.drone.processes import recorder
from uavrt.drone.processes.recorder import MOST_COMMANDS, POSE_TIMEOUT_S, Recorder
from uavrt.drone.processes.recording.commit_times import PULSES_S
from uavrt.drone.supervisor.tree.waiting_records import Outbox
from uavrt.flight.database.flight_database import FlightDatabase
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.pose.mounting import Mounting

S = 1_000_000_000
START_NS = 1_700_000_000 * S
ANTENNA = AntennaSettings(yaw_offset_deg=90.0, offset_forward_m=2.0)


def vehicle(time_ns: int) -> Pose:
    """A vehicle that turns by 30° a second."""
    return made.pose(
        time_ns,
        47.0 + (time_ns - START_NS) / S * 1e-5,
        8.5,
        altitude_amsl_m=500.0,
        yaw_deg=30.0 * (time_ns - START_NS) / S,
    )


def poses(first_s: float, last_s: float) -> Poses:
    steps = range(round(first_s * 20), round(last_s * 20) + 1)
    return Poses(poses=tuple(vehicle(START_NS + step * S // 20) for step in steps))


def pulse(at_s: float, tag_id: int = 2) -> Pulse:
    return replace(made.pulse(START_NS + round(at_s * S)), tag_id=tag_id)


def posed(one: Pulse) -> PulsePose:
    return PulsePose(pulse=one, pose=vehicle(one.start_time_ns))


class Drone:
    """An outbox that outlives recorders, and recorders that may be killed at any moment."""

    def __init__(self, directory: Path, clock: VirtualClock) -> None:
        self.clock = clock
        self.flights = directory
        self.info = made.flight_info(
            directory / "flight_log_1", (made.tag(2, 148.71e6, 1.0),), start_time_ns=START_NS
        )
        self.last_flights: tuple[str, ...] = ()
        self.outbox = Outbox(keeps=True)
        self.said: list[tuple[str, Any]] = []
        self.recorder: Recorder
        self._socks: tuple[socket.socket, socket.socket]
        self.start()

    def start(self) -> None:
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        self._socks, self._lines = (ours, theirs), LineBuffer()
        settings = Settings(
            antenna=ANTENNA, recording=RecordingSettings(directory=str(self.flights))
        )
        assignment = Assignment(
            process="recorder",
            settings=settings,
            clock_offset_ns=0,
            flight=self.outbox.flight,
            last_flights=self.last_flights,
        )
        self.recorder = Recorder(ProcessFrame(RecordSocket(theirs), assignment))
        self.frame = self.recorder._frame
        if assignment.flight is not None:
            self.recorder.open(assignment.flight)

    def fly(self) -> None:
        self.send("flight", self.info)
        self.turn()

    def send(self, topic: str, record: object) -> None:
        self.outbox.put(encode_record(topic, record))
        self.outbox.write_to(self._socks[0])

    def find(self, one: Pulse) -> None:
        """Give it a pulse, and the pulse with its pose."""
        self.send("pulse", one)
        self.send("pulse_pose", posed(one))

    def turn(self, after_s: float = 0.0) -> None:
        """Let the recorder work, `after_s` later."""
        self.clock.now_s += after_s
        self.recorder.turn(self.frame.receive())
        self.frame.link.flush()
        self._listen()

    def _listen(self) -> None:
        try:
            data = self._socks[0].recv(1 << 20)
        except BlockingIOError:
            return
        for topic, record in map(decode_record, self._lines.feed(data)):
            if isinstance(record, RecordsHandled):
                self.outbox.remove_acknowledged(record.records)
            else:
                self.said.append((topic, record))

    def kill(self) -> None:
        """SIGKILL: what it holds in memory, and what is unread in its socket, is gone."""
        flight = self.recorder._flight
        database = None if flight is None else flight.database._open
        if database is not None:
            if database.in_transaction:
                database.execute("ROLLBACK")
            database.close()
        self.recorder._lock.release()
        for sock in self._socks:
            sock.close()
        self.outbox.process_ended(by_itself=False)

    def restart(self) -> None:
        self.kill()
        self.start()
        self.outbox.write_to(self._socks[0])

    def end(self) -> None:
        self.recorder.end()
        self._listen()

    def heard(self, topic: str) -> list[Any]:
        return [record for name, record in self.said if name == topic]

    def stored(self) -> dict[Pulse, Pose | None]:
        return {one.pulse: one.pose for one in read_flight(self.info.directory).pulse_poses}

    def logged(self) -> list[PulsePose]:
        return list(read_pulse_pose_log(Path(self.info.directory) / "pulse_pose_log.txt"))


@pytest.fixture
def landed(tmp_path: Path, clock_of_test: VirtualClock) -> Iterator[Drone]:
    waiting = Drone(tmp_path, clock_of_test)
    yield waiting
    waiting.kill()


@pytest.fixture
def drone(landed: Drone) -> Drone:
    """In flight."""
    landed.fly()
    return landed


def test_a_pulse_is_told_as_recorded_once_on_the_disk_within_3_s(drone: Drone) -> None:
    one = pulse(5.0)
    drone.find(one)
    drone.turn(0.1)
    drone.turn(PULSES_S - 0.2)
    assert drone.heard("recorded") == []
    assert drone.stored() == {}
    drone.turn(0.3)
    assert drone.heard("recorded") == [Recorded(pulses=(one.key,))]
    assert list(drone.stored()) == [one]
    flight = some(drone.recorder._flight)
    assert flight.database.connected().execute("PRAGMA synchronous").fetchone() == (2,)


def test_commits_for_pulses_are_3_s_apart_however_many_come(drone: Drone) -> None:
    flight = some(drone.recorder._flight)
    before = flight.database.syncs
    for step in range(300):
        one = pulse(step * 0.1)
        drone.find(one)
        drone.turn(0.1)
    assert 9 <= flight.database.syncs - before <= 11
    assert sum(len(told.pulses) for told in drone.heard("recorded")) >= 270


def test_what_a_killed_recorder_did_not_commit_its_successor_gets(drone: Drone) -> None:
    pulses = [pulse(0.5 * number) for number in range(40)]
    for number, one in enumerate(pulses):
        drone.send("poses", poses(0.5 * number, 0.5 * number + 0.45))
        drone.find(one)
        drone.send("delivered", Delivered(time_ns=1, store=7, pulses=((2, one.start_time_ns),)))
        drone.send("status_text", StatusText(severity=6, text=str(number)))
        if number % 3:
            drone.turn(0.5)
        if number % 7 == 6:
            drone.restart()
    drone.end()
    assert set(drone.stored()) == set(pulses)
    assert [one.pulse.start_time_ns for one in drone.logged()] == [
        one.start_time_ns for one in pulses
    ]
    flight = read_flight(drone.info.directory)
    assert [text.text for _, text in flight.status_texts] == [str(n) for n in range(40)]
    assert len(flight.poses) == 400
    assert sql(drone.info.directory, "SELECT count(*) FROM deliveries") == [(40,)]


def test_what_a_killed_supervisor_had_sent_reaches_the_disk(drone: Drone) -> None:
    one, other = pulse(1.0), pulse(2.0)
    drone.find(one)
    drone.turn(0.1)
    drone.send("pulse", other)  # unread when the supervisor ends
    drone._socks[0].close()
    drone.recorder.end()
    assert set(drone.stored()) == {one, other}
    assert len(drone.logged()) == 2


def test_a_pulse_whose_pose_never_comes_gets_one_from_the_recorded_poses(drone: Drone) -> None:
    one = pulse(2.03)
    drone.send("pulse", one)
    for second in range(5):
        drone.send("poses", poses(second, second + 0.95))
        drone.turn(1.0)
    assert drone.heard("pulse_pose") == []
    drone.turn(POSE_TIMEOUT_S)
    (made,) = drone.heard("pulse_pose")
    truth = Mounting.from_settings(ANTENNA).antenna_pose(
        vehicle((one.start_time_ns + one.end_time_ns) // 2)
    )
    assert made.pulse == one
    assert not made.pose.extrapolated
    assert made.pose.latitude_deg == pytest.approx(truth.latitude_deg, abs=1e-9)
    assert made.pose.quaternion_wxyz == pytest.approx(truth.quaternion_wxyz, abs=1e-4)
    drone.turn(PULSES_S)
    assert drone.heard("recorded") == [Recorded(pulses=(made.pulse.key,))]
    assert drone.stored() == {one: made.pose}
    (told,) = drone.heard("status_text")
    assert "1 reconstructed" in told.text
    assert drone.recorder._counters()["poses_made_up"] == 1


def test_a_pulse_without_any_pose_is_recorded_passed_on_and_told(drone: Drone) -> None:
    drone.send("poses", poses(0.0, 1.0))
    one = pulse(9.0)  # the vehicle was last heard of 8 s before
    drone.send("pulse", one)
    drone.turn(1.0)
    drone.turn(drone.recorder._awaited._timeout_s)
    assert drone.heard("pulse_pose") == [PulsePose(pulse=one, pose=None)]
    drone.end()
    assert drone.stored() == {one: None}
    assert [line.pose for line in drone.logged()] == [None]
    assert "1 pulses have none" in drone.heard("status_text")[0].text


def test_no_pulse_is_waited_for_when_a_later_one_of_its_tag_is_posed(drone: Drone) -> None:
    first, second, third = pulse(1.0), pulse(2.0), pulse(1.5, tag_id=4)
    for one in (first, second, third):
        drone.send("pulse", one)
    drone.send("poses", poses(0.0, 3.0))
    drone.send("pulse_pose", posed(second))
    drone.turn(0.1)
    # The other tag's pulse may still get its own.
    assert [made.pulse for made in drone.heard("pulse_pose")] == [first]


def test_whoever_restarts_takes_up_the_pulses_without_poses(drone: Drone) -> None:
    lost = [pulse(1.0 + number) for number in range(3)]
    for one in lost:
        drone.send("pulse", one)
    drone.send("poses", poses(0.0, 5.0))
    drone.turn(0.1)
    drone.recorder._commit()
    drone.recorder._report_taken()  # nobody sends it again
    drone.turn(0.1)
    assert not drone.outbox.holds("pulse")
    drone.restart()
    drone.turn(1.0)
    drone.turn(drone.recorder._awaited._timeout_s)
    assert [made.pulse for made in drone.heard("pulse_pose")] == lost
    drone.end()
    assert all(pose is not None for pose in drone.stored().values())


def test_a_commit_in_the_middle_of_a_burst_does_not_take_the_rest_of_it(drone: Drone) -> None:
    first, second, third = (pulse(float(number)) for number in range(3))
    for one in (first, second):
        drone.send("pulse", one)
    drone.send("pulse_pose", posed(second))  # now the first is made up for, and committed
    drone.find(third)
    drone.turn(0.1)
    drone.restart()
    drone.turn(0.1)
    drone.end()
    assert set(drone.stored()) == {first, second, third}


def test_commands_whose_reply_never_comes_take_bounded_memory(drone: Drone) -> None:
    for number in range(1000):
        drone.send("command", Command(name="radio_status", request_id=number, source="a"))
        drone.turn(0.01)
    assert len(drone.recorder._commands) == MOST_COMMANDS
    reply = CommandReply(request_id=999, name="radio_status", accepted=True, message="")
    drone.send("command_reply", reply)
    drone.end()
    assert sql(drone.info.directory, "SELECT request_id, accepted FROM commands") == [(999, 1)]


def test_the_end_of_a_flight_waits_for_no_pose(drone: Drone) -> None:
    one = pulse(1.0)
    drone.send("pulse", one)
    drone.turn(0.1)
    drone.send("flight_end", drone.info)
    drone.turn(0.1)
    assert drone.heard("pulse_pose") == [PulsePose(pulse=one, pose=None)]
    assert drone.heard("recorded") == [Recorded(pulses=(one.key,))]
    assert not drone.outbox.holds("flight_end")
    assert not (Path(drone.info.directory) / "flight.sqlite-wal").exists()


def test_a_flight_that_was_cut_off_and_is_over_gets_its_poses_too(
    landed: Drone, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "MOST_READ_AT_ONCE", 100)
    old = replace(landed.info, directory=str(landed.flights / "flight_log_0"))
    cut_off = FlightRecorder.open(old)
    pulses = [pulse(1.0 + 0.001 * number) for number in range(150)]
    cut_off.write_pulses(pulses)
    cut_off.write(*poses(0.0, 4.0).poses)
    cut_off.close()
    landed.last_flights = (old.directory,)
    landed.restart()
    for _ in range(20):
        landed.turn(0.3)
    assert [made.pulse for made in landed.heard("pulse_pose")] == pulses
    stored = read_flight(old.directory).pulse_poses
    assert all(one.pose is not None for one in stored)
    assert len(read_pulse_pose_log(Path(old.directory) / "pulse_pose_log.txt")) == 150


def test_untaken_records_of_a_flight_stay_out_of_the_next(drone: Drone) -> None:
    one = pulse(1.0)
    drone.send("pulse", one)
    drone.kill()  # and away while the flight ends and the next begins
    second = replace(drone.info, directory=str(drone.flights / "flight_log_2"))
    for topic, record in (
        ("pulse_pose", posed(one)),
        ("flight_end", drone.info),
        ("flight", second),
        ("pulse", pulse(20.0)),
    ):
        drone.outbox.put(encode_record(topic, record))
    drone.start()
    drone.outbox.write_to(drone._socks[0])
    drone.turn(1.0)
    drone.end()
    assert set(drone.stored()) == {one}
    later = read_flight(second.directory).pulse_poses
    assert [item.pulse for item in later] == [pulse(20.0)]


@pytest.mark.parametrize("what", ["pulse", "delivered"])
def test_a_failing_disk_is_not_said_to_have_anything(
    drone: Drone, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:

    def full(*_: object, **__: object) -> None:
        raise OSError("No space left on device")

    one = pulse(1.0)
    with monkeypatch.context() as failing:
        failing.setattr(FlightDatabase, "insert", full)
        drone.find(one)
        if what == "delivered":
            drone.send("delivered", Delivered(time_ns=1, store=7, pulses=((2, 1),)))
        for _ in range(20):
            drone.turn(1.0)
    assert drone.heard("recorded") == []
    assert drone.outbox.holds(what)
    drone.turn(2.0)
    assert drone.heard("recorded") == [Recorded(pulses=(one.key,))]


def test_an_ordinary_flight_writes_less_than_its_bar(drone: Drone) -> None:
    # Two of eight tags heard, groups of three; everything else that a drone records.
    gc.collect()  # databases that earlier tests left open write as they are closed
    before, seconds = written_bytes(), 120
    counters = {f"a_counter_of_a_process_{number}": 1e6 + number for number in range(12)}
    for second in range(seconds):
        drone.send("poses", poses(second, second + 0.95))
        for name in ("recorder", "connection", "detector-1", "receiver"):
            drone.send("health", made.health(name, START_NS + second * S, counters=counters))
        for tag_id in range(2, 18, 2):
            report = made.search_report(tag_id, START_NS + second * S, frequency_hz=148.7e6)
            drone.send("search_report", report)
        for one in (pulse(second + 0.1, 2), pulse(second + 0.7, 10)):
            drone.find(one)
            key = ((one.tag_id, one.start_time_ns),)
            drone.send("delivered", Delivered(time_ns=1, store=7, pulses=key))
        for _ in range(4):
            drone.turn(0.25)
    flight = some(drone.recorder._flight)
    assert flight.database.syncs < 0.45 * seconds
    drone.end()
    megabytes_an_hour = (written_bytes() - before) / 1e6 * 3600 / seconds
    assert 5.0 < megabytes_an_hour < 40.0
    assert len(drone.stored()) == 2 * seconds


def written_bytes() -> int:
    """Bytes that this thread has given to write calls, on whatever file system."""
    lines = Path("/proc/thread-self/io").read_text().splitlines()
    return int(dict(line.split(": ") for line in lines)["wchar"])


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
    landed: Drone, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.rmtree(landed.flights)
    landed.flights.write_text("a file in its place")
    landed.fly()
    passing(landed, WITHIN_S)
    assert len(complaints(capsys)) == 1


def test_a_removed_database_is_reported_and_written_again_within_5_s(drone: Drone) -> None:
    one, other = pulse(1.0), pulse(8.0)
    drone.find(one)
    passing(drone, 6)
    (Path(drone.info.directory) / "flight.sqlite").unlink()
    passing(drone, WITHIN_S)
    texts = [told.text for told in drone.heard("status_text")]
    assert texts == [
        "Recorder: the flight's database was removed or replaced, and is written again"
    ]
    drone.find(other)
    drone.end()
    assert set(drone.stored()) == {one, other}
