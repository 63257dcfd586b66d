"""Pulses found in samples that something else than this project's simulator made.

The generator is a few lines of plain numpy; the samples go through a real pipe into the real
command.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from some import some
from until import until

CENTER_HZ = 148_700_000.0
START = "2024-05-01T06:00:00Z"
START_NS = 1_714_543_200_000_000_000
WIDTH_S, INTERVAL_S, FIRST_S = 0.020, 0.8, 0.313
TAGS = {7: (148_711_234.0, 22.0), 8: (148_673_210.0, 18.0)}


def tag_file(folder: Path) -> Path:
    path = folder / "TagInfo.txt"
    path.write_text(
        "".join(f"{tag}, {hz:.0f}, 800, 20, 20, 5, 3, 0.01\n" for tag, (hz, _) in TAGS.items())
    )
    return path


def generate(rate: int, seconds: float, stored: str) -> Iterator[bytes]:
    """Noise and beeping carriers, a tenth of a second at a time."""
    rng = np.random.default_rng(5)
    sigma = 0.1 if stored == "cu8" else 0.01
    count = rate // 10
    for number in range(round(seconds * 10)):
        t = (number * count + np.arange(count)) / rate
        flat = rng.standard_normal(2 * count, np.float32) * np.float32(sigma / np.sqrt(2))
        sum_of_all = flat.view(np.complex64)
        on = np.flatnonzero(((t - FIRST_S) % INTERVAL_S < WIDTH_S) & (t >= FIRST_S))
        for hz, enr_db in TAGS.values():
            amplitude = sigma * np.sqrt(10 ** (enr_db / 10) / (WIDTH_S * rate))
            sum_of_all[on] += amplitude * np.exp(2j * np.pi * (hz - CENTER_HZ) * t[on])
        if stored == "cf32":
            yield flat.astype("<f4").tobytes()
        elif stored == "cs16":
            yield np.round(flat * 32768).clip(-32768, 32767).astype("<i2").tobytes()
        else:
            yield np.round(flat * 128 + 127.5).clip(0, 255).astype("u1").tobytes()


def detect(*arguments: str, **options: Any) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        [sys.executable, "-m", "uavrt.cli", "detect", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **options,
    )


def check(
    pulses: list[dict[str, Any]],
    seconds: float,
    start_ns: float,
    slack_s: float,
    steady_s: float = 0.004,
) -> None:
    """Each tag: nearly all its pulses, none else, each where it belongs."""
    sent = int((seconds - FIRST_S - WIDTH_S) / INTERVAL_S) + 1
    for tag, (hz, enr_db) in TAGS.items():
        mine = [p for p in pulses if p["tag_id"] == tag]
        assert sent - 1 <= len(mine) <= sent
        times_s = np.array([(p["start_time_ns"] - start_ns) / 1e9 for p in mine])
        off_s = (times_s - FIRST_S + INTERVAL_S / 2) % INTERVAL_S - INTERVAL_S / 2
        assert np.abs(off_s - np.median(off_s)).max() < steady_s
        assert abs(np.median(off_s)) < slack_s
        frequencies = np.array([p["frequency_hz"] for p in mine])
        assert np.abs(frequencies - hz).max() < 8.0
        assert abs(np.mean([p["snr_db"] for p in mine]) - enr_db) < 1.5


@pytest.mark.parametrize("stored", ["cf32", "cs16", "cu8"])
@pytest.mark.parametrize("rate", [250_000, 3_000_000])
def test_pulses_of_a_foreign_generator_are_found_through_a_pipe(
    tmp_path: Path, rate: int, stored: str
) -> None:
    seconds = 5.0 if rate > 1_000_000 else 10.0
    child = detect(
        *("-", "--tags", str(tag_file(tmp_path)), "--format", stored),
        *("--sample-rate", str(rate), "--center-frequency", "148.7e6", "--start-time", START),
        stdin=subprocess.PIPE,
    )
    samples = b"".join(generate(rate, seconds, stored))
    out, err = child.communicate(samples, timeout=100)
    assert child.returncode == 0, err.decode()
    pulses = [json.loads(line) for line in out.splitlines()]
    check(pulses, seconds, START_NS, 0.003)
    assert b"0 samples lost" in err
    assert b"tag 7" in err


def test_a_live_stream_gives_times_of_the_clock_and_pulses_as_they_come(tmp_path: Path) -> None:
    rate, seconds = 250_000, 8.0
    child = detect(
        *("-", "--tags", str(tag_file(tmp_path)), "--format", "cs16"),
        *("--sample-rate", str(rate), "--center-frequency", str(CENTER_HZ)),
        stdin=subprocess.PIPE,
    )
    assert child.stdin is not None
    assert child.stdout is not None
    came: list[int] = []
    pulses: list[dict[str, Any]] = []

    def listen() -> None:
        for line in some(child.stdout):
            came.append(time.time_ns())
            pulses.append(json.loads(line))

    listener = threading.Thread(target=listen, name="listener")
    listener.start()
    blocks = list(generate(rate, seconds, "cs16"))
    # Interpreter and imports: a radio starts sampling when its reader is there.
    time.sleep(2.0)
    began_ns, late_s = time.time_ns(), 0.0
    for number, data in enumerate(blocks, start=1):
        time.sleep(max(0.0, number * 0.1 - (time.time_ns() - began_ns) / 1e9))
        child.stdin.write(data)
        child.stdin.flush()
        late_s = max(late_s, (time.time_ns() - began_ns) / 1e9 - number * 0.1)
    while not came:  # pulses do not wait for the stream's end; a radio goes on meanwhile
        child.stdin.write(blocks[0])  # noise
        child.stdin.flush()
        time.sleep(0.1)
    child.stdin.close()
    listener.join(60)
    assert child.wait(60) == 0
    child.stdout.close()
    some(child.stderr).close()
    # Samples arrive up to a write (0.1 s) after they were due; nothing else is between.
    # The stream's clock can only be as steady as the writes of this test.
    check(pulses, seconds, began_ns, 0.15, steady_s=0.004 + late_s)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_stream_with_all_pulses_so_far_written(
    tmp_path: Path, number: signal.Signals
) -> None:
    rate = 250_000
    output = tmp_path / "pulses.csv"
    child = detect(
        *("-", "--tags", str(tag_file(tmp_path)), "--format", "cs16", "-o", str(output)),
        *("--sample-rate", str(rate), "--center-frequency", "148.7e6", "--start-time", START),
        stdin=subprocess.PIPE,
    )
    assert child.stdin is not None
    for data in generate(rate, 8.0, "cs16"):
        child.stdin.write(data)
    child.stdin.flush()
    until(lambda: output.exists() and output.read_text().count("\n") >= 12)
    child.send_signal(number)
    # The pipe stays open: it must end by the signal, not by the end of its input.
    assert child.wait(60) == 128 + number
    child.stdin.close()
    assert child.stderr is not None
    err = child.stderr.read()
    child.stderr.close()
    some(child.stdout).close()
    assert b"Traceback" not in err
    assert b"tag 7" in err
    lines = output.read_text().splitlines()
    assert lines[0].startswith("tag_id,frequency_hz,start_time_ns")
    assert len(lines) >= 1 + 2 * 7


def test_a_reader_that_goes_away_ends_it_without_a_traceback(tmp_path: Path) -> None:
    recording = tmp_path / "rec.cs16"
    recording.write_bytes(b"".join(generate(250_000, 10.0, "cs16")))
    child = detect(
        *(str(recording), "--tags", str(tag_file(tmp_path))),
        *("--sample-rate", "250e3", "--center-frequency", "148.7e6"),
    )
    assert child.stdout is not None
    assert child.stderr is not None
    os.close(os.dup(child.stdout.fileno()))
    child.stdout.close()
    err = child.stderr.read()
    child.stderr.close()
    assert child.wait(60) == 141
    assert b"Traceback" not in err
    assert b"BrokenPipe" not in err
