"""The ROS 2 gateway: CPU and memory, alone and with a subscriber to everything."""

import os
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.harness import Table
from uavrt.config.settings import Ros2Settings, Settings
from uavrt.core.clock import Clock
from uavrt.core.commands import SystemState
from uavrt.core.messages import (
    FlightInfo,
    Pose,
    Poses,
    ProcessStatus,
    Pulse,
    PulsePose,
    SystemStatus,
    Tag,
)
from uavrt.drone.ipc.record_link import LINK_VARIABLE
from uavrt.drone.ipc.tag_assignment import Assignment
from uavrt.drone.ipc.topics import encode_record

START_S, MEASURE_S = 3.0, 30.0
INTERVAL_S = 1.254
BAR_PERCENT = 3.0

SUBSCRIBER = """
import sys
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from uavrt.link.ros2.graph import TOPICS
from uavrt.link.ros2.network.dds import cyclone_config, dds_type
domain = int(sys.argv[1])
config = Domain(domain, cyclone_config(()))
participant = DomainParticipant(domain)
qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000),
          Policy.DataRepresentation(use_cdrv0_representation=True))
topics = [Topic(participant, f"rt/{t.name}", dds_type(t.message)) for t in TOPICS.values()]
readers = [DataReader(participant, topic, qos=qos) for topic in topics]
import time
end, count = time.monotonic() + float(sys.argv[2]), 0
while time.monotonic() < end:
    count += sum(len(reader.take(1000)) for reader in readers)
    time.sleep(0.05)
print(count)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    cpu_percent: float
    memory_mb: float
    heard: int
    """Messages that the subscriber got."""


def run() -> list[Table]:
    cases = [(0, False), (1, True), (100, False), (100, True)]
    rows = []
    for tags, watched in cases:
        cost = measure(tags, watched)
        met = "met" if cost.cpu_percent <= BAR_PERCENT else "NOT met"
        rows.append(
            [
                f"{tags} tags" + (", a subscriber to everything" if watched else ""),
                f"{cost.cpu_percent:.2f}",
                f"{cost.memory_mb:.0f}",
                str(cost.heard) if watched else "",
                f"≤ {BAR_PERCENT:g}: {met}" if tags == 100 else "",
            ]
        )
    notes = [
        f"{MEASURE_S:.0f} s, each tag with a pulse every {INTERVAL_S} s, which goes out with "
        "and without its pose; heartbeats, states and poses besides. The subscriber is a "
        "process of its own on the loopback and is not counted. Memory is the resident set."
    ]
    return [
        Table(
            title="Gateway",
            header=["", "CPU %", "MB", "messages heard", "bar"],
            rows=rows,
            notes=notes,
        )
    ]


def measure(tag_count: int, watched: bool) -> Cost:
    """Feed a gateway in real time as the supervisor would."""
    domain = 1 + os.getpid() % 90
    clock = Clock.start()
    tags = tuple(
        Tag(
            tag_id=number,
            frequency_hz=148e6 + 4e3 * number,
            pulse_width_s=0.02,
            pulse_intervals_s=(INTERVAL_S,),
        )
        for number in range(1, tag_count + 1)
    )
    flight = FlightInfo(
        directory="/data/flights/flight_log_2026-05-01_08-15-00",
        start_time_ns=clock.now_ns(),
        clock_offset_ns=clock.offset_ns,
        center_frequency_hz=148.2e6,
        sample_rate_hz=3e6,
        tags=tags,
    )
    ours, theirs = socket.socketpair()
    with ours, theirs:
        gateway = subprocess.Popen(
            [sys.executable, "-m", "uavrt.drone.processes.ros2_gateway"],
            pass_fds=(theirs.fileno(),),
            env=os.environ | {LINK_VARIABLE: str(theirs.fileno())},
            stderr=subprocess.DEVNULL,
        )
        theirs.close()
        threading.Thread(target=drain, args=(ours,), daemon=True).start()
        assignment = Assignment(
            process="ros2",
            settings=Settings(ros2=Ros2Settings(enabled=True, domain_id=domain)),
            clock_offset_ns=clock.offset_ns,
            flight=flight,
        )
        ours.sendall(encode_record("assignment", assignment))
        listen_s = str(START_S + MEASURE_S)
        listener = (
            subprocess.Popen(
                [sys.executable, "-c", SUBSCRIBER, str(domain), listen_s],
                stdout=subprocess.PIPE,
                text=True,
            )
            if watched
            else None
        )
        feed(ours, clock, tags, flight, START_S)
        before_s, began = cpu_s(gateway.pid), time.monotonic()
        feed(ours, clock, tags, flight, MEASURE_S)
        percent = 100.0 * (cpu_s(gateway.pid) - before_s) / (time.monotonic() - began)
        memory_mb = resident_mb(gateway.pid)
        gateway.terminate()
        heard = int(listener.communicate(timeout=30)[0]) if listener is not None else 0
        gateway.wait(10)
    return Cost(cpu_percent=percent, memory_mb=memory_mb, heard=heard)


def feed(
    link: socket.socket, clock: Clock, tags: tuple[Tag, ...], flight: FlightInfo, seconds: float
) -> None:
    """Send what the hub sends: pulses one by one, poses twice and the state once a second."""
    began = time.monotonic()
    events = [
        (phase + beat * INTERVAL_S, tag.tag_id)
        for index, tag in enumerate(tags)
        for phase in [INTERVAL_S * index / len(tags)]
        for beat in range(int(seconds / INTERVAL_S))
    ]
    events += [(0.5 * number, -1) for number in range(int(2 * seconds))]
    events += [(float(number), 0) for number in range(int(seconds))]
    for due_s, what in sorted(events):
        time.sleep(max(0.0, began + due_s - time.monotonic()))
        now_ns = clock.now_ns()
        if what > 0:
            pulse = a_pulse(what, now_ns)
            link.sendall(encode_record("pulse", pulse))
            with_pose = PulsePose(pulse=pulse, pose=a_pose(now_ns))
            link.sendall(encode_record("pulse_pose", with_pose))
        elif what == 0:
            link.sendall(encode_record("system_status", a_status(now_ns, flight)))
        else:
            poses = tuple(a_pose(now_ns - 50_000_000 * back) for back in range(9, -1, -1))
            link.sendall(encode_record("poses", Poses(poses=poses)))
    time.sleep(max(0.0, began + seconds - time.monotonic()))


def a_pulse(tag_id: int, now_ns: int) -> Pulse:
    return Pulse(
        tag_id=tag_id,
        frequency_hz=148e6 + 4e3 * tag_id,
        start_time_ns=now_ns,
        end_time_ns=now_ns + 20_000_000,
        snr_db=20.5,
        group_snr_db=20.5,
        score=2.5,
        group_index=1,
        group_sequence=1,
        noise_psd=1e-9,
        detection_status="confirmed",
        confirmed=True,
        rate=1,
        predicted_next_start_ns=now_ns + 1_194_000_000,
        predicted_next_end_ns=now_ns + 1_314_000_000,
    )


def a_pose(time_ns: int) -> Pose:
    return Pose(
        time_ns=time_ns,
        latitude_deg=47.0,
        longitude_deg=8.5,
        altitude_amsl_m=500.0,
        altitude_relative_m=40.0,
        quaternion_wxyz=(1.0, 0.0, 0.0, 0.0),
    )


def a_status(now_ns: int, flight: FlightInfo) -> SystemStatus:
    names = ("supervisor", "recorder", "connection", "ros2", "detector-1", "receiver")
    return SystemStatus(
        time_ns=now_ns,
        state=SystemState.DETECTING,
        flight_directory=flight.directory,
        center_frequency_hz=flight.center_frequency_hz,
        tags=flight.tags,
        processes=tuple(
            ProcessStatus(
                process=name,
                running=True,
                pid=1000,
                status="ready",
                ok=True,
                restarts=0,
                cpu_s=1.0,
                memory_mb=50.0,
                counters={f"counter_{number}": float(number) for number in range(20)},
            )
            for name in names
        ),
    )


def drain(link: socket.socket) -> None:
    """Take what the gateway says, as the supervisor would."""
    try:
        while link.recv(65536):
            pass
    except OSError:
        return


def cpu_s(pid: int) -> float:
    """CPU time of all threads of a process, to the scheduler's nanosecond."""
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "schedstat").read_text().split()[0]) * 1e-9 for task in tasks)


def resident_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024.0
