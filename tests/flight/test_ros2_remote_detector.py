"""A detector on another computer: channel datagrams there, pulses back over ROS 2.

The other computer is 127.0.0.2, or a network namespace with a cable between (where these are
allowed). It gets one channel of the band by UDP, loses 1 % of the datagrams, is cut off, and
comes back.
"""

import ctypes
import os
import random
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from statistics import median
from typing import Any

import made
import numpy as np
import pytest
from until import until

from uavrt.config.settings import Ros2Settings
from uavrt.config.tags.tag_files import write_tags
from uavrt.core.clock import Clock
from uavrt.core.messages import PulseKey, PulsePose, Recorded, SystemStatus
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.radio.channels.channel_datagram import SAMPLES, encode_channel_datagram
from uavrt.simulation.demo.demo_programs import free_udp_port

pytestmark = pytest.mark.timeout(150)

RATE_HZ = 3750.0
CENTER_HZ = 148.74e6
REMOTE_TAG = made.tag(
    *(44, CENTER_HZ + 300.0, 1.0),
    interval_uncertainty_s=0.02,
    interval_jitter_s=0.005,
    # The drone searches for it too, and finds nothing.
    false_alarm_probability=1e-5,
)
OTHER_COMPUTER = "127.0.0.2"


class Band:
    """The drone's channelizer, as far as the other computer sees it: one channel, by UDP.

    A pulse of 30 dB (energy over noise density) each second; each datagram has one chance in
    a hundred of being lost.
    """

    def __init__(self, port: int, host: str = OTHER_COMPUTER, namespace: str = "") -> None:
        self._port, self._host, self._namespace = port, host, namespace
        self._stop = threading.Event()
        self.sent = self.lost = 0
        self.first_ns = 0
        self._thread = threading.Thread(target=self._run, name="band")
        self._thread.start()

    def _run(self) -> None:
        if self._namespace:
            enter(self._namespace)
        generator = np.random.default_rng(5)
        luck = random.Random(5)
        clock = Clock.start()
        self.first_ns = clock.now_ns()
        sample = 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not self._stop.is_set():
                index = sample + np.arange(SAMPLES)
                # Unit noise power over 3750 Hz; 75 samples of amplitude a hold 75 a².
                noise = generator.standard_normal((SAMPLES, 2)) @ (1, 1j) / np.sqrt(2)
                on = (index / RATE_HZ) % 1.0 < 0.02
                tone = np.exp(2j * np.pi * 300.0 * index / RATE_HZ)
                samples = (noise + np.sqrt(1000.0 / 75.0) * on * tone).astype(np.complex64)
                time_ns = self.first_ns + round(sample / RATE_HZ * 1e9)
                sample += SAMPLES
                wait_s = (self.first_ns - clock.now_ns()) * 1e-9 + sample / RATE_HZ
                if self._stop.wait(max(0.0, wait_s)):
                    return
                self.sent += 1
                if luck.random() < 0.01:
                    self.lost += 1
                    continue
                data = encode_channel_datagram(samples, time_ns)
                with suppress(OSError):  # the cable is cut
                    sock.sendto(data, (self._host, self._port))

    def close(self) -> None:
        self._stop.set()
        self._thread.join()


def enter(namespace: str) -> None:
    """Put this thread, and no other, into a network namespace."""
    handle = os.open(f"/run/netns/{namespace}", os.O_RDONLY)
    try:
        assert ctypes.CDLL(None, use_errno=True).setns(handle, 0x40000000) == 0
    finally:
        os.close(handle)


@pytest.fixture
def band() -> Iterator[tuple[Band, int]]:
    port = free_udp_port(OTHER_COMPUTER)
    sender = Band(port)
    yield sender, port
    sender.close()


StartRemote = Callable[..., subprocess.Popen[bytes]]


@pytest.fixture
def start_remote(
    tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> Iterator[StartRemote]:
    """Start the other computer's program."""
    tags = tmp_path / "remote_tags.toml"
    write_tags(tags, (REMOTE_TAG,))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    started: list[subprocess.Popen[bytes]] = []

    def start(
        port: int,
        host: str = OTHER_COMPUTER,
        interface: str = "lo",
        prefix: tuple[str, ...] = (),
    ) -> subprocess.Popen[bytes]:
        started.append(
            subprocess.Popen(
                [
                    *(*prefix, sys.executable, "-m", "uavrt.cli", "detect"),
                    f"udp://{host}:{port}",
                    *("--tags", str(tags), "--sample-rate", str(RATE_HZ)),
                    *("--center-frequency", str(CENTER_HZ), "--ros2", interface),
                    *("-o", str(tmp_path / f"remote{len(started)}.jsonl")),
                ]
            )
        )
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def test_a_detector_on_another_computer_takes_part_in_the_flight_and_may_be_cut_off(
    drone_bay: Any,
    thesis_scenario: Any,
    ros_domain: int,
    band: tuple[Band, int],
    start_remote: StartRemote,
) -> None:
    sender, port = band
    remote = start_remote(port)
    tags = [*thesis_scenario.tags, REMOTE_TAG]
    settings = Ros2Settings(enabled=True, domain_id=ros_domain, accept_pulses=True)
    drone = drone_bay.launch(thesis_scenario, tags=tags, ros2=settings)
    newest: list[SystemStatus] = []
    recorded: Counter[int] = Counter()
    posed: set[PulseKey] = set()

    def pulses() -> dict[int, int]:
        """Pulses of each tag that are recorded with a pose."""
        for _, record in drone.status.read(0.3):
            if isinstance(record, SystemStatus):
                newest[:] = [record]
            elif isinstance(record, PulsePose) and record.pose is not None:
                posed.add(record.pulse.key)
            elif isinstance(record, Recorded):
                recorded.update(key[0] for key in record.pulses if key in posed)
        return dict(recorded)

    def more_of(*tag_ids: int) -> None:
        before = Counter(pulses())
        until(lambda: all(pulses().get(tag, 0) >= before[tag] + 3 for tag in tag_ids), 60.0)

    own = thesis_scenario.tags[0].tag_id
    more_of(own, REMOTE_TAG.tag_id)
    remote.kill()
    remote.wait()
    time.sleep(6.0)  # what was found before the cut has its pose and is recorded
    cut = pulses()[REMOTE_TAG.tag_id]
    more_of(own)  # the cut does not touch the drone's own tag
    assert pulses()[REMOTE_TAG.tag_id] == cut
    start_remote(port)
    more_of(own, REMOTE_TAG.tag_id)
    # A hundredth of the datagrams was lost, and each recorded pulse is a true one. One whose
    # first half was in a lost datagram begins with its second half, 10 ms late.
    until(lambda: sender.lost >= 1, 60.0)
    assert sender.lost < sender.sent / 10
    flight = read_flight(newest[0].flight_directory or "")
    found = [item.pulse for item in flight.pulse_poses if item.pulse.tag_id == 44]
    offsets_ns = [(p.start_time_ns - sender.first_ns) % 10**9 for p in found]
    late_ns = [min(one, 10**9 - one) for one in offsets_ns]
    assert median(late_ns) < 1_000_000
    assert max(late_ns) < 10_500_000
    assert all(abs(p.frequency_hz - REMOTE_TAG.frequency_hz) < 10.0 for p in found)
    restarts = {p.process: p.restarts for p in newest[0].processes}
    assert set(restarts.values()) == {0}


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


@pytest.fixture
def two_computers() -> Iterator[tuple[str, str]]:
    """Two network namespaces with a cable between: 10.99.7.1 at eth0, 10.99.7.2 at eth0."""
    names = (f"uavrt-a-{os.getpid()}", f"uavrt-b-{os.getpid()}")
    try:
        for name in names:
            ip("netns", "add", name)
        cable = f"link add eth0 netns {names[0]} type veth peer name eth0 netns {names[1]}"
        ip(*cable.split())
        for number, name in enumerate(names, 1):
            ip("-n", name, "address", "add", f"10.99.7.{number}/24", "dev", "eth0")
            ip("-n", name, "link", "set", "eth0", "up")
            ip("-n", name, "link", "set", "lo", "up")
    except (OSError, subprocess.CalledProcessError) as error:
        for name in names:
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)
        pytest.skip(f"network namespaces are not allowed here: {error}")
    yield names
    for name in names:
        ip("netns", "delete", name)


def test_two_computers_with_a_cable_find_each_other_and_survive_its_cut(
    launch: Any,
    ros_domain: int,
    two_computers: tuple[str, str],
    start_remote: StartRemote,
    tmp_path: Path,
) -> None:
    drone, other = two_computers
    port = 20_000
    settings = Ros2Settings(
        enabled=True, domain_id=ros_domain, interfaces=("eth0",), accept_pulses=True
    )
    flight = made.flight_info(
        tmp_path,
        (REMOTE_TAG,),
        start_time_ns=Clock.start().now_ns(),
        center_frequency_hz=CENTER_HZ,
    )
    gateway = launch(settings, flight, prefix=("ip", "netns", "exec", drone))
    start_remote(port, "10.99.7.2", "eth0", ("ip", "netns", "exec", other))
    sender = Band(port, "10.99.7.2", drone)
    try:
        first = gateway.receive("pulse", 4, timeout_s=60.0)
        ip("-n", drone, "link", "set", "eth0", "down")
        gateway.receive("health", 3)
        ip("-n", drone, "link", "set", "eth0", "up")
        after_ns = gateway.clock.now_ns()
        while (pulse := gateway.receive("pulse", timeout_s=60.0)[0]).start_time_ns < after_ns:
            first.append(pulse)
    finally:
        sender.close()
    assert {one.tag_id for one in first} == {REMOTE_TAG.tag_id}
    assert gateway.process.poll() is None
