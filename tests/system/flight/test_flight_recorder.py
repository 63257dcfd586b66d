"""Kills at random moments lose and double nothing of a flight."""

import os
import random
import time
from pathlib import Path

import numbered
from forked import forked
from some import some

from uavrt.core.messages import PulsePose
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight


def pulse_pose(number: int) -> PulsePose:
    return numbered.pulse_pose(number, 2 + 2 * (number % 2))


def write(directory: str, number: int, told: int) -> None:
    """Write pulses as fast as it can, and tell each number once it is recorded."""
    recorder = FlightRecorder.reopen(directory)
    while True:
        batch = [pulse_pose(number + n) for n in range(1 + number % 4)]
        number += len(batch)
        recorder.write_pulses(one.pulse for one in batch)
        recorder.commit()
        recorder.write_pulses(batch)
        recorder.write(*(some(one.pose) for one in batch))
        recorder.commit()
        os.write(told, f"{number}\n".encode())


def test_kills_at_random_moments_lose_and_double_nothing(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight_log_2023-11-17_07-16-59")
    FlightRecorder.create(info).close()
    moments = random.Random(11)
    recorded = 0
    for _ in range(6):
        reading, told = os.pipe()
        writer = forked(write, info.directory, recorded, told)
        os.close(told)
        with open(reading) as reports:
            reports.readline()  # it is at work
            time.sleep(moments.uniform(0.0, 0.12))
            writer.kill()
            writer.join()
            finished = [line for line in reports if line.endswith("\n")]
        promised = int(finished[-1]) if finished else recorded + 1
        starts = [one.pulse.start_time_ns for one in read_flight(info.directory).pulse_poses]
        recorded = len(starts)
        assert starts == [pulse_pose(n).pulse.start_time_ns for n in range(recorded)]
        assert recorded >= promised
    assert recorded > 50
    FlightRecorder.reopen(info.directory).close()
    flight = read_flight(info.directory)
    with_pose = [one for one in flight.pulse_poses if one.pose is not None]
    # A pulse whose own commit ended and whose pose's did not has none, in the logs neither.
    assert len(with_pose) >= recorded - 4 * 6
    logged = read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")
    starts = [one.pulse.start_time_ns for one in logged]
    assert sorted(starts) == [one.pulse.start_time_ns for one in with_pose]
    assert len(set(starts)) == len(starts)
