"""Kills at random moments lose and double nothing of a flight."""

import random
import signal
import time
from pathlib import Path

import numbered
from command_line import launched
from some import some

from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight

WRITER = """
import sys
sys.path.insert(0, sys.argv[3])
from flight_writer import write
write(sys.argv[1], int(sys.argv[2]))
"""


FLIGHT_WRITER = '''
"""Writes pulses as fast as it can and prints each number once it is recorded."""
import sys
from uavrt.core.messages import Pose, Poses, Pulse, PulsePose
from uavrt.flight.flight_recorder import FlightRecorder

def write(directory: str, first: int) -> None:
    recorder = FlightRecorder.reopen(directory)
    number = first
    while True:
        batch = []
        for number in range(number, number + 1 + number % 4):
            start = 1_700_205_419_230_494_976 + number * 1_000_001
            pulse = Pulse(tag_id=2 + 2 * (number % 2), frequency_hz=148.71e6,
                start_time_ns=start, end_time_ns=start + 20_000_000, snr_db=20.0,
                group_snr_db=20.0, score=2.0, group_index=1, group_sequence=number,
                noise_psd=1e-12, detection_status="detected", confirmed=False, rate=1,
                predicted_next_start_ns=None, predicted_next_end_ns=None)
            pose = Pose(time_ns=start, latitude_deg=47.4, longitude_deg=8.5,
                altitude_amsl_m=488.0, altitude_relative_m=30.0,
                quaternion_wxyz=(1.0, 0.0, 0.0, 0.0))
            batch.append(PulsePose(pulse=pulse, pose=pose))
        number += 1
        recorder.write_pulses(one.pulse for one in batch)
        recorder.commit()
        recorder.write_pulses(batch)
        recorder.write(*(one.pose for one in batch))
        recorder.commit()
        sys.stdout.write(f"{number}\\n")
        sys.stdout.flush()
'''


def test_kills_at_random_moments_lose_and_double_nothing(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight_log_2023-11-17_07-16-59")
    FlightRecorder.create(info).close()
    (tmp_path / "flight_writer.py").write_text(FLIGHT_WRITER)
    moments = random.Random(11)
    recorded = 0
    for _ in range(6):
        before = recorded
        writer = launched("-c", WRITER, info.directory, str(recorded), tmp_path)
        some(writer.stdout).readline()  # it is at work
        time.sleep(moments.uniform(0.0, 0.12))
        writer.send_signal(signal.SIGKILL)
        reports = writer.communicate()[0].splitlines(keepends=True)
        finished = [line for line in reports if line.endswith("\n")]
        recorded = int(finished[-1]) if finished else before + 1
        numbers = [one.pulse.group_sequence for one in read_flight(info.directory).pulse_poses]
        assert numbers == list(range(len(numbers)))
        assert len(numbers) >= recorded
        recorded = len(numbers)
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
