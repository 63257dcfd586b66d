"""Our half behind the original's half: channels and pulses by UDP."""

import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import started
from udp_queue import waiting_bytes
from until import until

from uavrt.drone.ipc.pulse_datagram import PulseRecord
from uavrt.radio.channels.channel_datagram import SAMPLES, encode_channel_datagram
from uavrt.simulation.demo.demo_programs import free_udp_port

pytestmark = pytest.mark.timeout(150)

RATE_HZ = 3750.0
START_NS = 1_714_543_200_123_456_789
CONFIG = """\
################
ID:\t2
channelCenterFreqMHz:\t148.710
Fs:\t3750
tagFreqMHz:\t148.7104
tp:\t0.02
tip:\t1.0
tipu:\t0.02
tipj:\t0.005
K:\t3
opMode:\t{mode}
excldFreqs:\t{excluded}
falseAlarmProb:\t0.01
"""


def beeping_channel(seconds: float) -> np.ndarray:
    """A tag of 20 dB, 400 Hz above the centre, that beeps at 0.5 s, 1.5 s …"""
    rng = np.random.default_rng(1)
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    noise = rng.standard_normal((t.size, 2)).view(complex).ravel() / np.sqrt(2)
    on = (t - 0.5) % 1.0 < 0.02
    tone = np.sqrt(10**2 / (0.02 * RATE_HZ)) * np.exp(2j * np.pi * 400.0 * t)
    both: np.ndarray = (noise + np.where(on & (t >= 0.4), tone, 0.0)).astype(np.complex64)
    return both


def send_frames(samples: np.ndarray, port: int, *, lost: set[int], swapped: set[int]) -> None:
    """Send as the original channelizer does, ten times as fast, not all and not in order."""
    frames = [
        encode_channel_datagram(
            samples[first : first + SAMPLES], START_NS + round(first * 1e9 / RATE_HZ)
        )
        for first in range(0, samples.size - SAMPLES + 1, SAMPLES)
    ]
    order = [n for n in range(len(frames)) if n not in lost]
    for n in swapped:
        at = order.index(n)
        order[at], order[at + 1] = order[at + 1], order[at]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for n in order:
            until(lambda: waiting_bytes(port) < 60_000)  # a datagram more would be lost
            sock.sendto(frames[n], ("127.0.0.1", port))
            time.sleep(0.027)


def detect(*arguments: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "uavrt.cli", "detect", *arguments], stderr=subprocess.PIPE
    )


def wait_for_port(port: int) -> None:
    """Until somebody listens: a datagram to a closed port comes back as a refusal."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(("127.0.0.1", port))
        for _ in range(300):
            try:
                sock.send(b"?")
                time.sleep(0.1)
                sock.send(b"?")
                return
            except ConnectionRefusedError:
                continue
    raise AssertionError("nobody listens")


def ended(process: "subprocess.Popen[bytes]") -> str:
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    return said.decode()


@pytest.mark.parametrize("mode", ["freqSearchHardLock", "freqAllNeverLock"])
def test_a_channel_of_the_original_gives_its_pulse_records(tmp_path: Path, mode: str) -> None:
    config = tmp_path / "detectorConfig.txt"
    config.write_text(CONFIG.format(mode=mode, excluded="[Inf, -Inf]"))
    output = tmp_path / "pulses.jsonl"
    port = free_udp_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:
        controller.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        controller.bind(("127.0.0.1", 0))
        process = detect(
            *(f"udp://127.0.0.1:{port}", "--tags", str(config), "-o", str(output)),
            *("--udp-pulses", f"127.0.0.1:{controller.getsockname()[1]}"),
        )
        try:
            wait_for_port(port)
            send_frames(beeping_channel(30.0), port, lost={40}, swapped={60, 80})
            until(lambda: not waiting_bytes(port))
        finally:
            said = ended(process)
        controller.setblocking(False)
        records = []
        while True:
            try:
                records.append(PulseRecord.decode(controller.recv(200)))
            except BlockingIOError:
                break
    pulses = [json.loads(line) for line in output.read_text().splitlines()]
    # Frame 40 holds 10.9 to 11.2 s: no pulse; none is lost by it or by the swaps.
    seconds = {round((pulse["start_time_ns"] - START_NS) * 1e-9 - 0.5) for pulse in pulses}
    assert seconds >= set(range(2, 28)), said
    for pulse in pulses:
        late_s = ((pulse["start_time_ns"] - START_NS) * 1e-9 - 0.5 + 0.5) % 1.0 - 0.5
        assert abs(late_s) < 0.005
        assert abs(pulse["frequency_hz"] - 148_710_400.0) < 10.0
    assert "1024 samples lost" in said
    of_pulses = [r for r in records if r.frequency_hz and r.detection_status < 3]
    assert [r.snr_db for r in of_pulses] == [pulse["snr_db"] for pulse in pulses]
    for record, pulse in zip(of_pulses, pulses, strict=True):
        assert abs(record.start_time_s - pulse["start_time_ns"] / 1e9) < 1e-6
    # One heartbeat a second of our time.
    assert sum(record == PulseRecord(tag_id=2) for record in records) >= 3


def test_what_the_configuration_excludes_is_not_reported(tmp_path: Path) -> None:
    samples = tmp_path / "channel.cf32"
    beeping_channel(12.0).tofile(samples)
    config, output = tmp_path / "detectorConfig.txt", tmp_path / "pulses.jsonl"
    counts = []
    for excluded in ("[Inf, -Inf]", "[-900, -800; 350, 450]"):
        config.write_text(CONFIG.format(mode="freqSearchSoftLock", excluded=excluded))
        radio = ("--sample-rate", "3750", "--center-frequency", "148.71e6")
        started("detect", samples, "--tags", config, "-o", output, *radio, check=True)
        counts.append(len(output.read_text().splitlines()))
    assert counts[0] >= 10
    assert counts[1] == 0


def test_an_unknown_mode_is_named(tmp_path: Path) -> None:
    config = tmp_path / "detectorConfig.txt"
    config.write_text(CONFIG.format(mode="freqGuess", excluded="[Inf, -Inf]"))
    run = started("detect", "x.cf32", "--tags", config, timeout=60)
    assert run.returncode == 2
    assert "freqGuess" in run.stderr
    assert "freqKnownHardLock" in run.stderr
