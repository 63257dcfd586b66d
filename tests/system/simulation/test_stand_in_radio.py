"""The stand-in programs are run as the real ones are: as processes with pipes and signals."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from some import some
from until import until

from uavrt.core.clock import Clock
from uavrt.simulation.airspy_rx import (
    SERIAL,
    ArgumentFault,
    Transmission,
    main,
    parse_arguments,
)
from uavrt.simulation.scene.demo_world import demo_scenario
from uavrt.simulation.scene.scenario import Scenario
from uavrt.simulation.scene.scenario_file import write_scenario
from uavrt.simulation.synthesis import CHUNK_SAMPLES, IQSynthesizer

RADIO = (sys.executable, "-m", "uavrt.simulation.airspy_rx")
USUAL = ("-r", "-", "-p", "0", "-a", "3000000", "-t", "0", "-d")


@pytest.fixture
def world(tmp_path: Path) -> tuple[Scenario, Path]:
    """The demo's world as of 20 s ago, in a file."""
    scenario = demo_scenario(60.0, seed=2).starting_at(time.time_ns() - 20 * 10**9)
    path = tmp_path / "world.toml"
    write_scenario(scenario, path)
    return scenario, path


def read_exactly(process: subprocess.Popen[bytes], size: int) -> bytes:
    return some(process.stdout).read(size)


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    processes: list[subprocess.Popen[bytes]] = []

    def run(*arguments: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.kill()
        process.communicate()


def find(haystack: Scenario, samples: np.ndarray, gain: int, from_s: float = 19.0) -> int:
    """Index in the scenario at which the samples start."""
    synthesizer = IQSynthesizer(haystack, 148.68e6, 3e6, gain=gain)
    first = synthesizer.index_at(haystack.start_time_ns + round(from_s * 1e9))
    # 64 samples of noise occur only once; 30 s are more than any machine takes to start.
    for chunk in range(first // CHUNK_SAMPLES, first // CHUNK_SAMPLES + 30 * 46):
        block = synthesizer.block(chunk * CHUNK_SAMPLES, CHUNK_SAMPLES)
        for at in np.flatnonzero(block == samples[0]):
            index = chunk * CHUNK_SAMPLES + int(at)
            if np.array_equal(synthesizer.block(index, 64), samples[:64]):
                return index
    raise AssertionError("these samples are not of this world")


def test_it_writes_the_samples_of_the_world_as_it_is_now(
    world: tuple[Scenario, Path], start: Callable[..., subprocess.Popen[bytes]]
) -> None:
    scenario, path = world
    radio = start(*RADIO, "--world", str(path), "-f", "148.68", *USUAL, "-h", "15")
    samples = np.frombuffer(read_exactly(radio, 200_000 * 8), "<f4").view(np.complex64)
    now_s = scenario.elapsed_s(time.time_ns())
    radio.send_signal(signal.SIGTERM)
    _, errors = radio.communicate(timeout=30)
    index = find(scenario, samples, gain=15)
    expected = IQSynthesizer(scenario, 148.68e6, 3e6, gain=15).block(index, 200_000)
    np.testing.assert_array_equal(samples, expected)
    assert 20.0 <= index / 3e6 <= now_s
    assert radio.returncode == 0
    assert b"Traceback" not in errors
    assert f"{SERIAL:016X}".encode() in errors


def test_another_start_time_moves_the_world(
    world: tuple[Scenario, Path], start: Callable[..., subprocess.Popen[bytes]]
) -> None:
    scenario, path = world
    moved = scenario.starting_at(scenario.start_time_ns - 10**9)
    arguments = ("--start-time-ns", str(moved.start_time_ns), "-n", "4096")
    radio = start(*RADIO, "--world", str(path), *arguments, "-f", "148.68", *USUAL)
    output, _ = radio.communicate(timeout=60)
    samples = np.frombuffer(output, "<f4").view(np.complex64)
    assert samples.size == 4096
    assert find(moved, samples, gain=round(21 * 11 / 44)) >= 20 * 3_000_000


def test_it_ends_without_a_traceback_when_its_reader_goes_away(
    world: tuple[Scenario, Path], start: Callable[..., subprocess.Popen[bytes]]
) -> None:
    radio = start(*RADIO, "--world", str(world[1]), "-f", "148.68", *USUAL)
    read_exactly(radio, 8)
    some(radio.stdout).close()
    assert radio.wait(timeout=30) == 1
    errors = some(radio.stderr).read()
    assert b"cannot write: Broken pipe" in errors
    assert b"Traceback" not in errors


def test_a_slow_reader_loses_samples_and_the_rest_is_whole() -> None:
    scenario = demo_scenario(60.0).starting_at(time.time_ns())
    synthesizer = IQSynthesizer(scenario)
    received: list[bytes] = []
    reports: list[str] = []
    release = threading.Event()
    lost = threading.Event()

    def write(buffer: memoryview) -> None:
        received.append(bytes(buffer))
        release.wait(timeout=30)

    def report(line: str) -> None:
        reports.append(line)
        lost.set()

    transmission = Transmission(synthesizer, write=write, clock=Clock.start(), report=report)
    thread = threading.Thread(target=transmission.run)
    thread.start()
    assert lost.wait(timeout=30)
    release.set()
    counted = len(received)
    until(lambda: len(received) >= counted + 12)
    transmission.stop()
    thread.join(timeout=30)
    assert not thread.is_alive()
    assert transmission.lost_samples > 0
    assert transmission.lost_samples == sum(int(line.split()[0]) for line in reports)
    # Every buffer that came is whole and of this world, and after the gap it is the present.
    blocks = [np.frombuffer(block, "<f4").view(np.complex64) for block in received]
    assert {block.size for block in blocks} == {CHUNK_SAMPLES}
    first, last = (find(scenario, block, 21, from_s=0.0) for block in (blocks[0], blocks[-1]))
    assert last - first == (len(blocks) - 1) * CHUNK_SAMPLES + transmission.lost_samples


def test_a_lossy_radio_loses_samples_without_a_word() -> None:
    scenario = demo_scenario(60.0).starting_at(time.time_ns())
    lossy = replace(scenario.radio, loss_share=0.4, loss_s=0.05, arrival_jitter_s=0.001)
    scenario = replace(scenario, radio=lossy)
    received: list[bytes] = []
    reports: list[str] = []
    transmission = Transmission(
        IQSynthesizer(scenario),
        write=lambda buffer: received.append(bytes(buffer)),
        clock=Clock.start(),
        report=reports.append,
    )
    transmission.run(20 * CHUNK_SAMPLES)
    blocks = [np.frombuffer(block, "<f4").view(np.complex64) for block in received]
    first, last = (find(scenario, block, 21, from_s=0.0) for block in (blocks[0], blocks[-1]))
    missing = last - first - (len(blocks) - 1) * CHUNK_SAMPLES
    assert missing > 0
    # A loss after the last block is counted, but nothing shows it.
    assert 0 <= transmission.lost_samples - missing <= 10 * 150_000
    assert reports == []


def test_the_real_program_is_imitated_in_its_refusals(tmp_path: Path) -> None:
    world = ("--world", str(tmp_path / "w.toml"))
    for arguments, text in (
        (("-f", "5", "-r", "-"), "between [24, 1900["),
        (("-f", "148", "-h", "25", "-r", "-"), "sensitivity_gain out of range"),
        (("-f", "148", "-g", "22", "-r", "-"), "linearity_gain out of range"),
        (("-f", "148", "-l", "15", "-r", "-"), "lna_gain out of range"),
        (("-f", "148", "-t", "9", "-r", "-"), "out of range"),
        (("-f", "148", "-b", "2", "-r", "-"), "biast out of range"),
        (("-f", "148", "-q", "-r", "-"), "unknown argument"),
        (("-f", "148"), "you shall specify at least -r"),
        (("-f", "x", "-r", "-"), "argument error"),
        (("-f", "148", "-s", "zz", "-r", "-"), "argument error"),
        (("-f", "148", "-a", "2999999", "-r", "-"), "airspy_set_samplerate() failed"),
        (("-f", "148", "-r", "-", "stray"), "unknown argument 'stray'"),
    ):
        with pytest.raises(ArgumentFault) as caught:
            parse_arguments((*world, *arguments))
        assert text in str(caught.value)


def test_the_successor_and_the_thesis_command_lines_are_understood() -> None:
    line = "--world w -f 148.7125 -r - -p 0 -a 3000000 -t 0 -d -h 21 -b 1 -s 0x644064DC2F5A5ECD"
    arguments = parse_arguments(line.split())
    assert arguments.frequency_hz == pytest.approx(148_712_500.0)
    assert arguments.sample_rate_hz == 3e6
    assert (arguments.gain, arguments.integers, arguments.verbose) == (21, False, True)
    assert arguments.serial == SERIAL
    assert parse_arguments(["--world", "w", "-f", "148", "-r", "-"]).integers


def test_no_device_is_reported_as_the_real_program_does(
    world: tuple[Scenario, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["--world", str(world[1]), "-f", "148", "-r", "-"]
    assert main([*command, "--absent"]) == 1
    assert "AIRSPY_ERROR_NOT_FOUND" in capsys.readouterr().err
    assert main([*command, "-s", "0x1"]) == 1
    assert "AIRSPY_ERROR_NOT_FOUND" in capsys.readouterr().err


def test_a_world_of_another_year_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_scenario(demo_scenario(), tmp_path / "w.toml")
    assert main(["--world", str(tmp_path / "w.toml"), "-f", "148", "-r", "-"]) == 1
    assert "--start-time-ns" in capsys.readouterr().err


def test_a_faulty_world_or_output_is_refused_in_plain_words(
    world: tuple[Scenario, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--world", str(tmp_path / "none"), "-f", "148", "-r", "-"]) == 1
    assert "cannot be read" in capsys.readouterr().err
    assert main(["--world", str(world[1]), "-f", "148", "-r", str(tmp_path / "a/b")]) == 1
    assert "Failed to open file" in capsys.readouterr().err
