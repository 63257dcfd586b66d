"""Simulate ``airspy_rx`` in real time, with the same arguments and output.

``python -m uavrt.simulation.airspy_rx --world SCENARIO.toml -f 148.68 -r - -a 3000000 -t 0``

Arguments, ranges, texts and the exit code 1 on any fault are those of airspy_rx v1.0.5 (Debian
airspy 1.0.10), as observed. Like a radio, the program samples the simulated world at the
present time. A reader that falls behind by more than eight buffers loses samples. The
scenario's `loss_share`, `arrival_jitter_s` and `stall_share` add silent losses and delays.
"""

import getopt
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np

from uavrt.core.clock import Clock
from uavrt.core.errors import UavrtError
from uavrt.simulation.scene.flown_path import FlownPath
from uavrt.simulation.scene.scenario_file import load_scenario
from uavrt.simulation.synthesis import CHUNK_SAMPLES, IQSynthesizer, encode

SAMPLE_RATES_HZ = (3_000_000, 6_000_000, 2_500_000, 10_000_000)
"""Sample rates of the Airspy Mini, then of the R2 [Hz]; the first is the default. The sample
rate of the scenario's radio is accepted as well."""
BUFFERS = 8
"""Number of filled buffers that libairspy queues for a slow reader."""
SERIAL = 0x644064DC2F5A5ECD
LONGEST_S = 86_400.0
"""Longest simulation from the world's start [s]; a limit is needed because all pulses since the
start are counted."""
PATH_KEPT_S = 10.0
STALL_S = (0.05, 0.3)
"""Shortest and longest stall caused by `scenario.Radio.stall_share` [s]."""
NOT_FOUND = "airspy_open() failed: AIRSPY_ERROR_NOT_FOUND (-5)"

USAGE = """\
airspy_rx (simulated)
Usage:
--world <file>: Scenario file of the simulated world
[--start-time-ns <ns>]: Start of the scenario, UTC, in place of the file's
[--flown <file>]: Where the drone is, as a simulated autopilot that flies commands writes it
[--absent]: Behave as with no device attached
-r <filename>: Receive data into file
[-s serial_number_64bits]: Open device with specified 64bits serial number
[-p packing]: Set packing for samples, 0=disabled(default)
[-f frequency_MHz]: Set frequency in MHz between [24, 1900] (default 900MHz)
[-a sample_rate]: Set sample rate
[-t sample_type]: Set sample type, 0=FLOAT32_IQ, 2=INT16_IQ(default)
[-b biast]: Set Bias Tee, 1=enabled, 0=disabled(default)
[-v vga_gain]: Set VGA/IF gain, 0-15 (default 5)
[-m mixer_gain]: Set Mixer gain, 0-15 (default 5)
[-l lna_gain]: Set LNA gain, 0-14 (default 1)
[-g linearity_gain]: Set linearity simplified gain, 0-21
[-h sensivity_gain]: Set sensitivity simplified gain, 0-21
[-n num_samples]: Number of samples to transfer (default is unlimited)
[-d]: Verbose mode
"""


class ArgumentFault(Exception):
    """Raised for an argument that airspy_rx would refuse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arguments:
    """Values of the command line arguments."""

    world: Path
    output: str
    """File to which the samples are written, or ``-`` for standard output."""
    start_time_ns: int | None
    flown: Path | None
    absent: bool
    serial: int | None
    frequency_hz: float
    sample_rate_hz: float
    integers: bool
    gain: int
    """Receiver gain, in steps of airspy_rx's sensitivity gain."""
    samples: int | None
    verbose: bool


def parse_arguments(arguments: Sequence[str]) -> Arguments:
    """Parse the command line as airspy_rx does; raises `ArgumentFault` for what it refuses."""
    try:
        pairs, rest = getopt.getopt(
            list(arguments),
            "r:ws:p:f:a:t:b:v:m:l:g:h:n:d",
            ["world=", "start-time-ns=", "flown=", "absent"],
        )
    except getopt.GetoptError as error:
        raise ArgumentFault(f"unknown argument: {error}") from None
    if rest:
        raise ArgumentFault(f"unknown argument '{rest[0]}'")
    given = dict(pairs)
    if "--world" not in given:
        raise ArgumentFault("argument error: --world <file> is needed")
    if "-r" not in given:
        raise ArgumentFault("error: you shall specify at least -r <with filename>")
    if "-w" in given:
        raise ArgumentFault("argument error: -w is not simulated")
    frequency_mhz = _number(given, "-f", 900.0)
    if not 24.0 <= frequency_mhz < 1900.0:
        raise ArgumentFault(
            f"argument error: frequency_MHz={frequency_mhz:.6f} MHz "
            "and shall be between [24, 1900[ MHz"
        )
    if _whole(given, "-p", 0, 0, "packing") != 0 or _whole(given, "-t", 2, 5, "type") not in (
        0,
        2,
    ):
        raise ArgumentFault("argument error: sample_type out of range")
    return Arguments(
        world=Path(given["--world"]),
        output=given["-r"],
        start_time_ns=int(given["--start-time-ns"]) if "--start-time-ns" in given else None,
        flown=Path(given["--flown"]) if "--flown" in given else None,
        absent="--absent" in given,
        serial=_serial(given.get("-s")),
        frequency_hz=frequency_mhz * 1e6,
        sample_rate_hz=_rate_hz(given),
        integers=given.get("-t", "2") == "2",
        gain=_gain(given),
        samples=_whole(given, "-n", 0, 2**63, "num_samples") or None,
        verbose="-d" in given,
    )


def _rate_hz(given: dict[str, str]) -> float:
    rate_hz = _number(given, "-a", SAMPLE_RATES_HZ[0])
    if rate_hz not in SAMPLE_RATES_HZ:
        with suppress(UavrtError):
            if rate_hz == load_scenario(Path(given["--world"])).radio.sample_rate_hz:
                return rate_hz
        raise ArgumentFault("airspy_set_samplerate() failed: AIRSPY_ERROR_INVALID_PARAM (-2)")
    return rate_hz


def _number(given: dict[str, str], option: str, default: float) -> float:
    try:
        return float(given.get(option, default))
    except ValueError:
        raise ArgumentFault(f"argument error: '{option} {given[option]}'") from None


def _whole(given: dict[str, str], option: str, default: int, highest: int, name: str) -> int:
    value = _number(given, option, default)
    if not 0 <= value <= highest or value != int(value):
        raise ArgumentFault(f"argument error: {name} out of range")
    return int(value)


def _serial(text: str | None) -> int | None:
    try:
        return None if text is None else int(text, 0)
    except ValueError:
        raise ArgumentFault(f"argument error: '-s {text}'") from None


def _gain(given: dict[str, str]) -> int:
    _whole(given, "-b", 0, 1, "biast")
    stages = (
        _whole(given, "-v", 5, 15, "vga_gain"),
        _whole(given, "-m", 5, 15, "mixer_gain"),
        _whole(given, "-l", 1, 14, "lna_gain"),
    )
    linearity = _whole(given, "-g", 0, 21, "linearity_gain")
    sensitivity = _whole(given, "-h", 0, 21, "sensitivity_gain")
    if "-h" in given:
        return sensitivity
    return linearity if "-g" in given else round(21 * sum(stages) / 44)


class Transmission:
    """Delivers the samples of the simulated radio to the program that reads them."""

    def __init__(
        self,
        synthesizer: IQSynthesizer,
        *,
        write: Callable[[memoryview], None],
        clock: Clock,
        report: Callable[[str], None],
        integers: bool = False,
    ) -> None:
        self._synthesizer = synthesizer
        self._write = write
        self._clock = clock
        self._report = report
        self._integers = integers
        self._buffers: queue.Queue[bytes | None] = queue.Queue(BUFFERS)
        self._buffers_s = BUFFERS * CHUNK_SAMPLES / synthesizer.sample_rate_hz
        self._stop = threading.Event()
        self._chance = np.random.default_rng(synthesizer.scenario.seed)
        self.lost_samples = 0
        self.failure: OSError | None = None

    def stop(self) -> None:
        """End the stream after the present buffer; may be called in a signal handler."""
        self._stop.set()

    def run(self, samples: int | None = None) -> None:
        """Send samples until stopped, until the reader is gone, or until `samples` are sent."""
        index = self._synthesizer.index_at(self._clock.now_ns())
        end = None if samples is None else index + samples
        writer = threading.Thread(target=self._drain, name="writer", daemon=True)
        writer.start()
        while not self._stop.is_set() and (end is None or index < end):
            count = CHUNK_SAMPLES if end is None else min(CHUNK_SAMPLES, end - index)
            samples_now = self._synthesizer.block(index, count)
            block = encode(samples_now, "cs16" if self._integers else "cf32")
            due_ns = self._synthesizer.time_ns_at(index + count)
            self._stop.wait(max(0.0, (due_ns - self._clock.now_ns()) * 1e-9))
            self._delay()
            index += count
            if not self._enqueue(block):
                index = self._skip(index - count, index)
            index = self._drop_samples(index)
        self._finish(writer)

    def _delay(self) -> None:
        radio = self._synthesizer.scenario.radio
        if radio.arrival_jitter_s:
            self._stop.wait(self._chance.exponential(radio.arrival_jitter_s))
        if radio.stall_share and self._chance.random() < radio.stall_share:
            self._stop.wait(self._chance.uniform(*STALL_S))

    def _drop_samples(self, index: int) -> int:
        radio = self._synthesizer.scenario.radio
        if not radio.loss_share:
            return index
        kept_s = CHUNK_SAMPLES / self._synthesizer.sample_rate_hz
        losses = self._chance.poisson(
            kept_s * radio.loss_share / ((1.0 - radio.loss_share) * radio.loss_s)
        )
        lost = int(losses) * round(radio.loss_s * self._synthesizer.sample_rate_hz)
        self.lost_samples += lost
        return index + lost

    def _enqueue(self, block: bytes) -> bool:
        """Queue a buffer for the reader; False if the queue stays full for its whole duration.

        A pause of this program alone therefore loses no samples: a reader of a real radio would
        have read the buffers during the pause.
        """
        try:
            self._buffers.put(block, timeout=self._buffers_s)
        except queue.Full:
            return False
        return True

    def _skip(self, first: int, following: int) -> int:
        present = self._synthesizer.index_at(self._clock.now_ns())
        resume = max(following, present)
        self.lost_samples += resume - first
        self._report(f"{resume - first} samples dropped: the reader is too slow")
        return resume

    def _drain(self) -> None:
        while (block := self._buffers.get()) is not None:
            try:
                self._write(memoryview(block))
            except OSError as error:
                self.failure = error
                self._stop.set()
                return

    def _finish(self, writer: threading.Thread) -> None:
        try:
            self._buffers.put(None, timeout=0.2)
        except queue.Full:
            return
        writer.join(timeout=1.0)


def write_fully(descriptor: int) -> Callable[[memoryview], None]:
    """Create a function that writes a whole buffer to a file descriptor."""

    def write(buffer: memoryview) -> None:
        while buffer:
            buffer = buffer[os.write(descriptor, buffer) :]

    return write


def _print(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def main(command_line: Sequence[str]) -> int:
    """Run the simulated radio; exit code 0 after SIGTERM, SIGINT or the samples of ``-n``, else
    1.
    """
    try:
        arguments = parse_arguments(command_line)
    except ArgumentFault as fault:
        _print(str(fault))
        sys.stderr.write(USAGE)
        return 1
    if arguments.absent or arguments.serial not in (None, SERIAL):
        _print(NOT_FOUND)
        return 1
    try:
        scenario = load_scenario(arguments.world)
    except UavrtError as error:
        _print(f"airspy_rx: {error}")
        return 1
    if arguments.start_time_ns is not None:
        scenario = scenario.starting_at(arguments.start_time_ns)
    clock = Clock.start()
    away_s = abs(scenario.elapsed_s(clock.now_ns()))
    if away_s > LONGEST_S:
        _print(
            f"airspy_rx: the scenario starts {away_s / 86400:.0f} days from now; give "
            "--start-time-ns, or a start_time within a day in the file"
        )
        return 1
    path = None
    if arguments.flown is not None:
        path = FlownPath(arguments.flown, scenario.plane, keep_s=PATH_KEPT_S)
    synthesizer = IQSynthesizer(
        scenario,
        arguments.frequency_hz,
        arguments.sample_rate_hz,
        gain=arguments.gain,
        path=path,
    )
    if arguments.verbose:
        _print(f"frequency_MHz -f {arguments.frequency_hz / 1e6:.6f}MHz")
        _print(f"sample_rate -a {arguments.sample_rate_hz / 1e6:.6f} MSPS IQ")
        _print(f"Device Serial Number: 0x{SERIAL:016X}")
    return _transmit(arguments, synthesizer, clock)


def _transmit(arguments: Arguments, synthesizer: IQSynthesizer, clock: Clock) -> int:
    try:
        descriptor = (
            sys.stdout.fileno()
            if arguments.output == "-"
            else os.open(arguments.output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
        )
    except OSError as error:
        _print(f"Failed to open file: {arguments.output} ({error.strerror})")
        return 1
    transmission = Transmission(
        synthesizer,
        write=write_fully(descriptor),
        clock=clock,
        report=_print,
        integers=arguments.integers,
    )

    def end(number: int, _frame: FrameType | None) -> None:
        _print(f"Caught signal {number}")
        transmission.stop()

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, end)
    _print("Stop with Ctrl-C")
    transmission.run(arguments.samples)
    if transmission.failure is not None:
        _print(f"airspy_rx: cannot write: {transmission.failure.strerror}")
        return 1
    _print("User cancel, exiting..." if arguments.samples is None else "Done")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
