"""Run a radio's program as a child process and read its samples, messages and exit code."""

import os
import re
import select
import shutil
import signal
import subprocess
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

from uavrt.config.radios import RadioRow
from uavrt.config.settings import RadioSettings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.errors import (
    RadioAmbiguous,
    RadioError,
    RadioMissing,
    RadioStalled,
    os_errors_as,
)
from uavrt.core.log import get_logger
from uavrt.core.messages import IQBlock
from uavrt.radio.formats import sample_format
from uavrt.radio.live_source import RADIO_RATE_REMEDY
from uavrt.radio.receivers.devices import usb_radios
from uavrt.radio.receivers.program_messages import cause_of, exit_error, serial_error, stalled
from uavrt.radio.receivers.radio_programs import PROGRAMS, commands_before, receive_command
from uavrt.radio.sample_stream import StreamSource

_STARTUP_S: Final = 10.0
"""Maximum time from the start of a radio's program to its first sample [s]; it opens the radio
and may load firmware."""
_STALL_S: Final = 1.0
"""Time without samples after which the radio counts as stalled [s]."""
_TERMINATE_S: Final = 2.0
"""Time from SIGTERM to SIGKILL for a radio's program [s]; airspy_rx stops within 0.1 s unless
its USB transfers hang."""
_FIRST_LINES: Final = 4
"""Number of lines stored from the start of a program's error output, where the cause of a
failure stands; a long help text may follow."""
_LINES: Final = 8
_PROGRESS: Final = ("Streaming at", "MiB / ", "Stop with Ctrl-C", "call hackrf_")
"""Parts of progress lines that some radio programs print every second; lines that contain one
of them are ignored."""

_LOST_SAMPLES: Final = re.compile(r"\b(\d+) samples (?:lost|dropped)\b")
"""Pattern of a radio program's message with the number of lost samples. Programs without such a
message are monitored by the arrival times of samples."""
_OVERRUNS: Final = re.compile(r"\b(\d+) overruns, longest (\d+) bytes\b")
"""Pattern of the message in which hackrf_transfer -B reports the number of buffer overruns; the
number of lost samples is not in it."""
_RATE: Final = re.compile(r"(\d+(?:\.\d+)?) ?(MSPS|kS/s)")
"""Pattern of a sample rate as printed by airspy_info and airspyhf_info."""

log = get_logger()


class ProgramSource(StreamSource):
    """Reads samples from a radio's program, which runs as a child in its own process group."""

    MAY_BE_SLOW = False
    """Always False: a radio keeps its sample rate, so samples that do not arrive are lost."""
    RATE_REMEDY = RADIO_RATE_REMEDY

    def __init__(
        self,
        settings: RadioSettings,
        center_frequency_hz: float,
        *,
        clock: Clock | None = None,
        startup_s: float = _STARTUP_S,
        stall_s: float = _STALL_S,
    ) -> None:
        self._settings = settings
        self._answers_until_s = monotonic_s() + _INFORMATION_S
        settings = _by_place(settings, self._answers_until_s)
        command = receive_command(settings, center_frequency_hz)
        self._program = PROGRAMS[settings.kind]
        command += _overrun_arguments(self._program, settings, self._answers_until_s)
        self._seen = any(one.kind == settings.kind for one in usb_radios())
        """True if a USB radio of the configured kind was plugged in at the start."""
        self._startup_s, self._stall_s = startup_s, stall_s
        self._first: list[str] = []
        self._lines: deque[str] = deque(maxlen=_LINES)
        self._line = b""
        self._last_logged = ""
        """Last logged line of the program; repetitions are not logged, to spare the disk."""
        self._lost = 0
        self.overruns = 0
        """Number of overruns of the radio's own buffer, if the program reports them."""
        for before in commands_before(settings):
            self._run_before(before)
        self._child = _start(command, self._program.package)
        assert self._child.stdout is not None
        assert self._child.stderr is not None
        self._words = self._child.stderr.fileno()
        os.set_blocking(self._words, False)
        super().__init__(
            self._child.stdout.fileno(),
            sample_format(self._program.sample_format),
            sample_rate_hz=settings.sample_rate_hz,
            center_frequency_hz=center_frequency_hz,
            clock=clock,
            name=command[0],
        )
        self._poll.register(self._words, select.POLLIN)
        self._listening = True
        self._last_byte_s = monotonic_s()
        self._closed = False

    @property
    def pid(self) -> int:
        """Process id of the radio's program; its process group has an equal id."""
        return self._child.pid

    @property
    def last_lines(self) -> tuple[str, ...]:
        """First and last lines that the program wrote to stderr, without progress lines."""
        return (*self._first, *self._lines)

    def read(self, timeout_s: float | None = None) -> IQBlock | None:
        """Get the next block, or None after `timeout_s`; raises as `SampleSource.read`."""
        if self._closed:
            raise EOFError(f"{self.name} was closed")
        return super().read(timeout_s)

    def close(self) -> None:
        """End the program and its process group with SIGTERM, then with SIGKILL."""
        if self._closed:
            return
        self._closed = True
        super().close()
        self._signal(signal.SIGTERM)
        try:
            self._child.wait(_TERMINATE_S)
        except subprocess.TimeoutExpired:
            log.warning("program of the radio did not exit and was killed", program=self.name)
        # Also after a clean end: a wrapper script may have left its own children.
        self._signal(signal.SIGKILL)
        self._child.wait()
        for pipe in (self._child.stdout, self._child.stderr):
            if pipe is not None:
                pipe.close()

    def _signal(self, number: signal.Signals) -> None:
        try:
            os.killpg(self._child.pid, number)
        except (ProcessLookupError, PermissionError):
            return

    def _wait(self, timeout_s: float | None) -> bool:
        allowed_s = self._startup_s if self._placer.index + self._filled == 0 else self._stall_s
        until_stall_s = self._last_byte_s + allowed_s - monotonic_s()
        if until_stall_s < 0.0:
            raise stalled(self._program.title)
        patience_s = until_stall_s if timeout_s is None else min(timeout_s, until_stall_s)
        ready = False
        for descriptor, _ in self._poll.poll(patience_s * 1000.0 + 1.0):
            if descriptor == self._words:
                self._read_messages()
            else:
                ready = True
        if ready:
            self._last_byte_s = monotonic_s()
        return ready

    def _read_messages(self) -> None:
        try:
            said = os.read(self._words, 65536)
        except BlockingIOError:
            return
        if not said:
            if self._listening:
                self._poll.unregister(self._words)
            self._listening = False
            return
        *lines, self._line = (self._line + said).split(b"\n")
        self._line = self._line[-4096:]
        for raw in lines:
            line = raw.decode("utf-8", "replace").strip()
            self._note_overruns(line)
            if (
                line
                and line != self._last_logged
                and not any(words in line for words in _PROGRESS)
            ):
                self._last_logged = line
                self._store_line(line)
                if found := _LOST_SAMPLES.search(line):
                    self._lost += int(found[1])
                log.info("output of the radio's program", program=self.name, line=line)

    def _note_overruns(self, line: str) -> None:
        found = _OVERRUNS.search(line)
        if not found or int(found[1]) <= self.overruns:
            return
        log.warning(
            "radio overrun", count=int(found[1]) - self.overruns, longest_bytes=int(found[2])
        )
        self.overruns = int(found[1])
        self._placer.expect_losses()

    def _reported_lost(self) -> int:
        lost, self._lost = self._lost, 0
        return lost

    def _check_end(self) -> None:
        enough = self._placer.index > 0 and self._filled >= self._format.bytes_per_sample
        self._answers_until_s = monotonic_s() + _INFORMATION_S
        try:
            code = self._child.wait(1.0)
        except subprocess.TimeoutExpired:
            # The program has closed its stdout but continues to run, which is useless.
            self._signal(signal.SIGKILL)
            code = self._child.wait()
        if enough:
            return
        # hackrf_transfer prints its usage to stdout when it fails.
        self._filled = 0
        self._read_messages()
        if self._line:
            self._store_line(self._line.decode("utf-8", "replace").strip())
        said = (
            f"was killed by {_signal_name(-code)}" if code < 0 else f"ended with status {code}"
        )
        raise self._error(code, said, " | ".join(self.last_lines))

    def _error(self, code: int, said: str, words: str) -> RadioError:
        return exit_error(
            self._settings, code, said, words, own_rates=self._own_rates, seen=self._seen
        )

    def _own_rates(self) -> str:
        program, said = self._program, ""
        if not program.inform or self._settings.program:
            return ""
        with suppress(RadioError):
            said = _run(program.inform, program.package, self._answers_until_s).stdout
        rates = (float(n) * (1e6 if u == "MSPS" else 1e3) for n, u in _RATE.findall(said))
        return " or ".join(f"{rate:.0f}" for rate in sorted(rates))

    def _store_line(self, line: str) -> None:
        """Store a line of stderr for error texts.

        The first lines and lines that show a cause stay stored; of the other lines, the newest
        stay.
        """
        most = _LINES if cause_of(self._program, line) is not None else _FIRST_LINES
        (self._first if len(self._first) < most else self._lines).append(line)

    def _run_before(self, command: Sequence[str]) -> None:
        finished = _run(command, self._program.package, self._answers_until_s)
        if finished.returncode:
            said = f"{finished.stdout}\n{finished.stderr}".strip().replace("\n", " | ")
            raise self._error(finished.returncode, f"{command[0]} failed", said)


_INFORMATION_S: Final = 4.0
"""Time limit for a program that lists the serial numbers or sample rates of radios [s]."""


def _run(
    command: Sequence[str], package: str, until_s: float
) -> subprocess.CompletedProcess[str]:
    _find(command[0], package)
    try:
        return subprocess.run(
            [*_end_with_parent(), *command],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=max(0.0, until_s - monotonic_s()),
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise RadioStalled(
            f"{command[0]} does not answer", remedy="Unplug the radio and plug it in again"
        ) from error


_DEVICE_LINE = re.compile(r"^ *(\d+): .*SN: (\S+) *$", re.M)
"""Pattern of librtlsdr's device lines: `` 0: Realtek, RTL2838UHIDIR, SN: 00000001``."""
_MOST_PLACES = 16


def _by_place(settings: RadioSettings, until_s: float) -> RadioSettings:
    """Replace a numeric serial number by the radio's index in the list of its program.

    rtl_sdr and rtl_biast read a serial number such as 00000001 as the index of the second
    radio. They would open that radio and could switch on its bias voltage.
    """
    wanted, program = settings.serial, PROGRAMS.get(settings.kind)
    if program is None or settings.program or not program.lists:
        return settings
    if wanted is None or not wanted.isdigit():
        return settings
    finished = _run(program.lists, program.package, until_s)
    listed = _DEVICE_LINE.findall(finished.stderr)
    if len(alike := [place for place, serial in listed if serial == wanted]) > 1:
        raise RadioAmbiguous(
            f"{len(alike)} {program.title} radios have the serial number {wanted}",
            remedy=f'Set [radio] serial to its number in the list of rtl_test, "{alike[0]}" or '
            f'"{alike[1]}", or give each a number of its own with rtl_eeprom',
        )
    places = {serial: place for place, serial in listed}
    if wanted in places:
        return replace(settings, serial=places[wanted])
    if places and (wanted != str(int(wanted)) or int(wanted) >= _MOST_PLACES):
        raise serial_error(settings, sorted(places))
    return settings


def _overrun_arguments(program: RadioRow, settings: RadioSettings, until_s: float) -> list[str]:
    """Arguments that make a radio's program report overruns; empty if it cannot."""
    if settings.program or not program.overruns_option:
        return []
    finished = _run((program.receive, "-h"), program.package, until_s)
    known = f"[{program.overruns_option}]" in finished.stdout + finished.stderr
    return [program.overruns_option] if known else []


def _start(command: Sequence[str], package: str) -> "subprocess.Popen[bytes]":
    _find(command[0], package)
    log.info("starting radio", command=" ".join(command))
    with os_errors_as(
        RadioMissing,
        f"cannot run {command[0]}",
        f"Install the program again: sudo apt install --reinstall {package}",
    ):
        return subprocess.Popen(
            [*_end_with_parent(), *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,
        )


def _end_with_parent() -> list[str]:
    """Command prefix that makes the kernel kill a program when this process ends.

    A program that is writing ends when its pipe closes, but a program that hangs would keep the
    radio busy. ``setpriv`` is part of util-linux, which is on every Debian system.
    """
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "KILL", "--"] if setpriv else []


def _find(program: str, package: str) -> None:
    if shutil.which(program) is None:
        raise RadioMissing(
            f"{program} is not installed",
            remedy=f"Install the program: sudo apt install {package}",
        )


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
