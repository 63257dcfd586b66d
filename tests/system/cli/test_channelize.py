"""``uavrt channelize`` between programs that it does not know."""

import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from command_line import launched, started, uavrt
from some import some
from udp_queue import waiting_bytes
from until import until

from uavrt.dsp.filters import compatible_bank_taps
from uavrt.radio.channels.channel_datagram import channel_port, decode_channel_datagram
from uavrt.radio.udp_address import listen
from uavrt.simulation.demo.demo_programs import free_udp_port

RATE_HZ = 3_000_000
START_NS = 1_700_000_000_000_000_000
SECONDS = 1.5

# Stand-ins for the thesis's programs, called with its own arguments.
AIRSPY_RX = """
import sys
sys.stdout.buffer.write(open({recording!r}, "rb").read())
"""
CSDR = """
import os, sys, time
import numpy as np
from scipy.signal import firwin, upfirdn
sys.path.insert(0, os.environ["DRIVERS"])
from udp_queue import waiting_bytes
port = int(os.environ["CHANNELIZER_PORT"])
assert sys.argv[1:] == ["fir_decimate_cc", "8", "0.05", "HAMMING"], sys.argv
data = np.frombuffer(sys.stdin.buffer.read(), np.complex64)
taps = firwin(81, 1 / 8, window="hamming")
# csdr's output begins when its filter is full: no zeros before the first sample.
out = upfirdn(taps, data, 1, 8)[10 : data.size // 8].astype(np.complex64).tobytes()
began = time.monotonic()
for start in range(0, len(out), 16312):  # 2039 samples, as csdr writes
    # At the radio's pace; after a pause of a busy computer all that waited comes at once.
    time.sleep(max(began + start / 3e6 - time.monotonic(), 0.0))
    while waiting_bytes(port) > 60_000:  # a datagram more would be lost: the radio has room
        time.sleep(0.005)
    sys.stdout.buffer.write(out[start : start + 16312])
    sys.stdout.buffer.flush()
"""
# Reads what comes, as netcat does, but cuts where netcat would not: within samples.
NETCAT = """
import os, random, socket, sys
assert sys.argv[1:3] == ["-u", "localhost"], sys.argv
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.connect(("127.0.0.1", int(sys.argv[3])))
random.seed(1)
while data := os.read(0, random.randint(1, 16384)):
    sock.send(data)
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three tones in noise: at the centre, and in channels 46 and 100 of the original."""
    t = np.arange(int(RATE_HZ * SECONDS)) / RATE_HZ
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((t.size, 2)).astype(np.float32).view(np.complex64).ravel()
    tones = (
        0.1 * np.exp(2j * np.pi * 100.0 * t)
        + 0.2 * np.exp(2j * np.pi * (45 * 3750.0 + 300.0) * t)
        + 0.3 * np.exp(2j * np.pi * (-3750.0 - 500.0) * t)
    )
    path = tmp_path_factory.mktemp("radio") / "band.cf32"
    (tones + 0.01 * noise).astype(np.complex64).tofile(path)
    return path


@pytest.fixture
def listeners() -> Iterator[dict[int, list[socket.socket]]]:
    """Sockets at the ports that the test asks for; a free range cannot be asked for."""
    opened: dict[int, list[socket.socket]] = {}
    yield opened
    for sockets in opened.values():
        for sock in sockets:
            sock.close()


def channelizer(*arguments: str) -> subprocess.Popen[str]:
    """Start it, and wait until it says that it listens."""
    words = ("-m", "uavrt.cli", "channelize", *arguments)
    process = launched(*words, stdout=None, stderr=subprocess.PIPE)
    assert "channels of" in some(process.stderr).readline()
    return process


def stopped(process: subprocess.Popen[str]) -> str:
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGINT
    return said


def frames_at(sockets: list[socket.socket]) -> list[tuple[int, np.ndarray]]:
    found = []
    for sock in sockets:
        try:
            while True:
                found.append(decode_channel_datagram(sock.recv(65_536)))
        except BlockingIOError:
            continue
    return found


def frequency_hz(samples: np.ndarray, rate_hz: float) -> float:
    spectrum = np.abs(np.fft.fft(samples * np.hanning(samples.size), 1 << 16))
    return float(np.fft.fftfreq(1 << 16, 1 / rate_hz)[np.argmax(spectrum)])


@contextmanager
def thesis(directory: Path, recording: Path, port: int, netcat: Path | None) -> Iterator[None]:
    """The pipe of §4.5.4: airspy_rx | csdr fir_decimate_cc 8 0.05 HAMMING | netcat -u …"""
    commands = []
    for name, text, arguments in (
        ("airspy_rx", AIRSPY_RX, "-f 148.710 -r - -p 0 -a 3000000 -t 0 -d"),
        ("csdr", CSDR, "fir_decimate_cc 8 0.05 HAMMING"),
        ("netcat", NETCAT, f"-u localhost {port}"),
    ):
        script = directory / f"{name}.py"
        script.write_text(text.format(recording=str(recording)) if "{rec" in text else text)
        commands.append([sys.executable, str(script), *arguments.split()])
    if netcat is not None:
        commands[2] = [str(netcat), "-u", "localhost", str(port)]
    environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", CHANNELIZER_PORT=str(port))
    environment["DRIVERS"] = str(Path(waiting_bytes.__code__.co_filename).parent)
    processes: list[subprocess.Popen[bytes]] = []
    for command in commands:
        before = processes[-1].stdout if processes else subprocess.DEVNULL
        processes.append(
            subprocess.Popen(command, stdin=before, stdout=subprocess.PIPE, env=environment)
        )
    for process in processes[:2]:
        some(process.stdout).close()  # ours; the next program has its own
        process.wait(timeout=60)
    yield
    processes[2].terminate()  # netcat waits for answers until it is ended
    processes[2].communicate(timeout=60)


@pytest.mark.parametrize("kind", ["cutting anywhere", "installed"])
def test_the_pipe_of_the_thesis_ends_in_the_channels_of_the_original(
    tmp_path: Path, recording: Path, listeners: dict[int, list[socket.socket]], kind: str
) -> None:
    found = shutil.which("netcat")
    # Without netcat both runs use the stand-in, which is the harder sender of the two.
    netcat = Path(found) if kind == "installed" and found is not None else None
    listeners.update({n: listen("127.0.0.1", channel_port(n - 1)) for n in (1, 46, 100)})
    listeners[-46] = listen("127.0.0.1", channel_port(45, second=True))
    port = free_udp_port()
    process = channelizer(f"udp://localhost:{port}", "--channels", "1,-46,100")
    frames: dict[int, list[tuple[int, np.ndarray]]] = {number: [] for number in listeners}

    def all_came() -> bool:
        for number, sockets in listeners.items():
            frames[number] += frames_at(sockets)
        return all(len(found) >= 5 for found in frames.values())

    try:
        with thesis(tmp_path, recording, port, netcat):
            until(lambda: all_came() and not waiting_bytes(port))
    finally:
        said = stopped(process)
    all_came()
    # 1.5 s make 5625 samples in a channel, 5 whole frames.
    assert {number: len(found) for number, found in frames.items()} == dict.fromkeys(frames, 5)
    assert " 0 lost" in said
    for number, tone_hz, level in ((1, 100.0, 0.1), (46, 300.0, 0.2), (100, -500.0, 0.3)):
        samples = np.concatenate([samples for _, samples in frames[number]])[20:]
        assert abs(frequency_hz(samples, 3750.0) - tone_hz) < 0.2
        # csdr's own filter takes 2.5 dB at 169 kHz.
        taken = 0.7475 if number == 46 else 1.0
        assert abs(np.abs(samples).mean() - level * taken) < 0.02 * level
        times = [time_ns for time_ns, _ in frames[number]]
        np.testing.assert_allclose(np.diff(times), 1024e9 / 3750, atol=1.5e6)
    assert all(
        a[0] == b[0] and np.array_equal(a[1], b[1])
        for a, b in zip(frames[46], frames[-46], strict=True)
    )


def test_standard_input_of_three_megasamples_is_decimated_and_split(
    recording: Path, listeners: dict[int, list[socket.socket]]
) -> None:
    for number in (1, 100):
        listeners[number] = listen("127.0.0.1", channel_port(number - 1, "thesis"))
    with recording.open("rb") as stream:
        run = started(
            *("channelize", "-", "--sample-rate", "3e6", "--mode", "default"),
            *("--ports", "thesis", "--stamps", "milliseconds", "--speed", "10"),
            *("--channels", "1 100", "--start-time", "2023-11-14T22:13:20Z"),
            stdin=stream,
            check=True,
            timeout=60,
        )
    assert "7500 samples a second" in run.stderr
    for number, tone_hz in ((1, 100.0), (100, -500.0)):
        frames = frames_at(listeners[number])
        assert len(frames) == 10  # of 11 250 samples
        samples = np.concatenate([samples for _, samples in frames])[40:]
        assert abs(frequency_hz(samples, 7500.0) - tone_hz) < 0.2
        # The first output stands half the filters before the first input; rounded down to ms.
        assert -2e6 <= frames[0][0] - START_NS <= 0
        # Stamps are cut to whole milliseconds.
        late_ns = [time_ns - frames[0][0] for time_ns, _ in frames]
        np.testing.assert_allclose(late_ns, np.arange(10) * 1024e9 / 7500, atol=1e6)


def test_a_file_gives_the_samples_of_the_originals_formula(
    tmp_path: Path, listeners: dict[int, list[socket.socket]]
) -> None:
    rng = np.random.default_rng(3)
    band = rng.standard_normal((375_000 // 2, 2)).view(complex).ravel().astype(np.complex64)
    path = tmp_path / "band.cf32"
    band.tofile(path)
    listeners[52] = listen("127.0.0.1", channel_port(51))
    radio = ("--sample-rate", "375e3", "--channels", "52", "--speed", "0")
    started("channelize", path, *radio, check=True)
    ((_, samples),) = frames_at(listeners[52])
    # y_c[n] = Σ h[m] exp(2πj c m / 100) x[100 n - m], channel 52: c = 51.
    taps = compatible_bank_taps(100) * np.exp(2j * np.pi * 51 * np.arange(1200) / 100)
    for n in (0, 5, 12, 13, 500, 1023):
        last = band[max(0, 100 * n - 1199) : 100 * n + 1][::-1]
        expected = (taps[: last.size] * last).sum()
        assert abs(samples[n] - expected) < 1e-4


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--channels", "101"], "channel 101"),
        (["--channels", "x"], "not a list of channel numbers"),
        (["--channels", "-3", "--ports", "thesis"], "needs two"),
        (["--sample-rate", "250e3"], "give 66 channels of 3787.88"),
        (["--sample-rate", "374e3"], "--mode default"),
        (["--sample-rate", "2.5e6"], "3e6"),
        (["--host", "no.such.host.invalid"], "no.such.host.invalid"),
    ],
)
def test_what_no_channels_can_be_sent_of_is_refused_before_it_begins(
    capsys: pytest.CaptureFixture[str], arguments: list[str], word: str
) -> None:
    assert uavrt("channelize", f"udp://127.0.0.1:{free_udp_port()}", *arguments) == 2
    said = capsys.readouterr().err
    assert word in said
    assert "datagrams sent" not in said
    assert "channels of 3750 samples" not in said


@pytest.mark.parametrize("rate_hz", [375e3, 1.5e6, 6e6])
def test_the_rates_that_the_refusal_names_give_the_originals_channels(rate_hz: float) -> None:
    process = channelizer(f"udp://127.0.0.1:{free_udp_port()}", "--sample-rate", f"{rate_hz:g}")
    assert " 0 samples" in " " + stopped(process)
