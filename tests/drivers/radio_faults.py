"""What a person reads of a radio's faults: in log, monitor, page and doctor.

`uavrt run --ground` flies with a radio's real program over stand-in libraries, and the radio
fails in one way after the other.
"""

import asyncio
import io
import json
import subprocess
import sys
import time
import urllib.request
from collections.abc import Sequence
from contextlib import ExitStack, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import made
import msgspec
import pytest
from command_line import python
from radio_world import DRIVERS, SERIALS, TAG_HZ, RadioWorld
from rich.console import Console

from uavrt.cli.computer.doctor import doctor as whole_doctor
from uavrt.cli.system.monitor_view import MonitorView
from uavrt.cli.system.start_stop import start_detection
from uavrt.config.loader import load_settings
from uavrt.config.radios import RADIOS
from uavrt.config.settings import RadioSettings, Settings
from uavrt.core.clock import Clock
from uavrt.core.messages import Pulse, StatusText, SystemStatus
from uavrt.drone.computer.computer_checks import check_radio
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.ground.link.drone_link import GroundLink
from uavrt.simulation.demo.demo_programs import free_udp_port

ANSWER_S = 40.0
"""Longest wait for a state; only a test that has failed waits so long."""
STEPS = (
    *("works", "stalls", "absent", "other rate", "busy", "forbidden", "loses"),
    *("unplugged", "other serial"),
)
"""Faults in an order in which each is seen at once: one that stalls has been streaming."""
_STARTING = Lock()
"""One after the other: starting is all work, the rest nearly all waiting."""
NO_USB = ("soapy",)
"""Kinds that the kernel's list of USB devices does not show."""


def expected(kind: str, fault: str, rate_hz: float) -> str:
    """Get what a person has to read of a fault; empty for a radio that works."""
    title = RADIOS[kind].title
    gone = "no radio is plugged in"
    words = {
        "works": "",
        "stalls": f"{title}: no samples arrive. Unplug the radio and plug it in again",
        "absent": f"{title}: {gone}. Plug the radio in",
        "unplugged": f"{title}: {gone}. Plug the radio in",
        "busy": f"{title}: another program is using the radio. Close the program",
        "forbidden": f"{title}: this user may not open it. Install the udev rule",
        "other rate": f" samples a second arrive, not {rate_hz:.0f}. Check the radio's cable",
        "loses": f" samples a second arrive, not {rate_hz:.0f}. Check the radio's cable",
        "other serial": f"{title}: no radio has the serial number {SERIALS[kind]}. Set [radio] "
        'serial to "',
    }
    if kind in NO_USB:
        not_found = f"{title}: no radio is found. Plug the radio in"
        words |= dict.fromkeys(("absent", "unplugged", "other serial"), not_found)
    return words[fault]


@dataclass
class Seen:
    """What a fault showed, in each place where one may look."""

    reason: str
    """First words of the receiver's reason, which all other places must have."""
    log: str
    monitor: str
    page: str
    doctor: str
    seconds: float
    arrived: int
    """Samples that came while the fault lasted."""


@dataclass
class Flown:
    """A flight with one radio."""

    seen: dict[tuple[str, int], Seen] = field(default_factory=dict)
    """By fault and its place among the steps."""
    pulses_hz: list[float] = field(default_factory=list)
    """Frequencies of the pulses that were found while the radio worked."""
    late_page: str = ""
    """What a second ground station reads that came after the last fault."""
    error: str = ""


def fly(
    directory: Path, kind: str, rate_hz: float, *, with_page: bool = False, late: bool = True
) -> Flown:
    """Fly with a radio through all of its faults; without a page a station's link reads.

    With ``late`` a second station comes after the last fault. The drone repeats a reason each
    half minute, so this station waits up to so long.
    """
    flown = Flown()
    try:
        with ExitStack() as stack:
            port = free_udp_port()
            with _STARTING:
                world, settings, reader, page = _started(
                    stack, directory, kind, rate_hz, port, with_page=with_page
                )
            flown.pulses_hz = _pulses_hz(reader)
            for number, fault in enumerate(STEPS):
                seen = _look(world, settings, reader, page, fault, rate_hz)
                flown.seen[fault, number] = seen
            if not late:
                return flown
            station = Station(f"udpout://127.0.0.1:{port}", 193)
            stack.callback(station.close)
            deadline_s = time.monotonic() + ANSWER_S
            words = expected(kind, STEPS[-1], rate_hz)
            while words not in station.texts() and time.monotonic() < deadline_s:
                time.sleep(0.1)
            flown.late_page = station.texts()
    except Exception as error:  # noqa: BLE001 - shown by the tests of this radio
        flown.error = repr(error)
    return flown


def _started(
    stack: ExitStack, directory: Path, kind: str, rate_hz: float, port: int, *, with_page: bool
) -> tuple[RadioWorld, Settings, StatusReader, "Page | Station"]:
    world = RadioWorld(directory / "world", kind, rates=f"{rate_hz:.0f}")
    config = directory / "uavrt.toml"
    config.write_text(
        f'status_socket = "{directory}/s"\n[radio]\nkind = "{kind}"\nretry_s = 0.2\n'
        f'sample_rate_hz = {rate_hz}\nserial = "{SERIALS[kind]}"\n[mavlink]\naddress = ""\n'
        f'direct_links = ["udpin://127.0.0.1:{port}"]\n'
        f'[recording]\ndirectory = "{directory}/flights"\nminimum_free_mb = 1.0\n'
    )
    settings = load_settings(config)
    command = [sys.executable, "-m", "uavrt.cli", "run", "-c", str(config)]
    if with_page:
        command += ["--ground", "--ground-port", "0", "--no-browser"]
    log = stack.enter_context((directory / "log").open("w"))
    running = subprocess.Popen(
        command,
        cwd=directory,
        env=world.environment,
        stdout=subprocess.PIPE,
        stderr=log,
        text=True,
    )
    stack.enter_context(running)
    stack.callback(running.terminate)
    assert running.stdout is not None
    page: Page | Station
    if with_page:
        page = Page(running.stdout.readline().split()[4])
    else:
        page = Station(f"udpout://127.0.0.1:{port}", 190)
    stack.callback(page.close)
    reader = StatusReader(status_socket_path(settings), ANSWER_S, lambda: None)
    stack.callback(reader.close)
    start_detection(reader, [made.tag(2, TAG_HZ, 1.0)])
    return world, settings, reader, page


def _look(
    world: RadioWorld,
    settings: Settings,
    reader: StatusReader,
    page: "Page | Station",
    fault: str,
    rate_hz: float,
) -> Seen:
    """Let a radio fail, wait until that shows, and look everywhere."""
    begun_s = time.monotonic()
    words = expected(world.kind, fault, rate_hz)
    reader.read(0.01)
    before = _receiver(_status(reader, lambda _: True)).counters.get("samples", 0.0)
    world.set(fault)
    status = _status(
        reader,
        lambda one: (
            words in _receiver(one).reason
            and (bool(words) or _receiver(one).status == "receiving")
        ),
    )
    seconds = time.monotonic() - begun_s
    receiver = _receiver(status)
    words = receiver.reason[:110] or words  # the whole sentence, with its figures
    view, shown = MonitorView(), io.StringIO()
    view.add("system_status", status, 0.0)  # a monitor that was opened only now
    Console(file=shown, width=300).print(view.render(0.0))
    logged = page_log = ""
    deadline_s = time.monotonic() + 10.0
    while time.monotonic() < deadline_s and (words not in logged or words not in page_log):
        page_log = page.texts()
        logged = " ".join(
            path.read_text(errors="replace")
            for path in Path(settings.recording.directory).glob("*/*log*/*")
            if path.is_file()
        ).replace('\\"', '"')
        time.sleep(0.1)
    finding = check_radio(settings, status)
    return Seen(
        reason=words,
        log=logged,
        monitor=shown.getvalue(),
        page=page_log,
        doctor=f"{'ok' if finding.ok else '!!'} {finding.text}",
        seconds=seconds,
        arrived=round(receiver.counters.get("samples", 0.0) - before),
    )


def _pulses_hz(reader: StatusReader) -> list[float]:
    """Wait for pulses; get their frequencies."""
    found: list[float] = []
    deadline_s = time.monotonic() + ANSWER_S
    while len(found) < 3 and time.monotonic() < deadline_s:
        records = [record for _, record in reader.read(0.2)]
        pulses_hz = [one.frequency_hz for one in records if isinstance(one, Pulse)]
        # A computer that is too busy for 3 MS/s loses samples, which may end in other pulses.
        found += [one_hz for one_hz in pulses_hz if abs(one_hz - TAG_HZ) < 30.0]
    return found


def _status(reader: StatusReader, wanted: Any) -> SystemStatus:
    deadline_s = time.monotonic() + ANSWER_S
    last = None
    while time.monotonic() < deadline_s:
        for _, record in reader.read(0.2):
            if isinstance(record, SystemStatus) and any(
                one.process == "receiver" for one in record.processes
            ):
                last = record
                if wanted(record):
                    return record
    raise AssertionError(f"never came; last: {last and _receiver(last)}")


def _receiver(status: SystemStatus) -> Any:
    return next(one for one in status.processes if one.process == "receiver")


class Station:
    """A ground station's link in a thread of its own: the texts that its page shows."""

    def __init__(self, address: str, component_id: int) -> None:
        self._texts: list[str] = []
        self._loop = asyncio.new_event_loop()
        self._link = GroundLink(
            Clock.start().now_ns, on_event=self._read, component_id=component_id
        )
        self._task = self._loop.create_task(self._link.run(address))
        self._thread = Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with suppress(asyncio.CancelledError):
            self._loop.run_until_complete(self._task)
        self._loop.close()

    def _read(self, event: object) -> None:
        if isinstance(event, StatusText):
            self._texts.append(event.text)

    def texts(self) -> str:
        """Get all that was read so far."""
        return " ".join(self._texts)

    def close(self) -> None:
        """End the link and the thread."""
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join()


class Page:
    """The page of `uavrt run --ground`, asked anew each time: as one that is opened now."""

    def __init__(self, url: str) -> None:
        self._url = url

    def texts(self) -> str:
        """Get the log that the page shows."""
        with urllib.request.urlopen(f"{self._url}api/log", timeout=20) as response:
            return " ".join(one["text"] for one in json.loads(response.read()))

    def close(self) -> None:
        """End nothing: it ends with the drone side."""


def check(seen: Seen, kind: str, fault: str, rate_hz: float) -> None:
    """Assert that all places show the same right sentence."""
    right = expected(kind, fault, rate_hz)
    assert right in seen.reason
    if fault == "other rate":
        assert float(seen.reason.split(maxsplit=1)[0]) == pytest.approx(0.9 * rate_hz, rel=0.04)
    assert seen.reason in seen.log
    assert seen.reason in seen.monitor
    assert seen.reason in seen.page
    assert seen.reason in seen.doctor
    assert seen.doctor.startswith("!!" if right else "ok")


def doctor(
    directory: Path,
    radio: RadioSettings,
    faults: Sequence[str],
    *,
    serials: Sequence[str] = (),
    rates: str = "",
) -> dict[str, list[str]]:
    """Get the lines of `uavrt doctor` for each fault while no flight is on; status at last."""
    world = RadioWorld(directory, radio.kind)
    path = f"{world.environment['PYTHONPATH']}:{DRIVERS}"
    question = json.dumps(
        [str(directory), msgspec.to_builtins(radio), [*faults], [*serials], rates]
    )
    environment = world.environment | {"PYTHONPATH": path}
    finished = python(__file__, question, env=environment, timeout=100)
    assert finished.returncode == 0, finished.stderr
    lines: dict[str, list[str]] = json.loads(finished.stdout)
    return lines


def _examine(question: str) -> None:
    directory, radio, faults, serials, rates = json.loads(question)
    world, lines = RadioWorld(Path(directory), radio["kind"], serials=serials, rates=rates), {}
    config = Path(directory) / "uavrt.toml"
    given = (f"{name} = {json.dumps(value)}\n" for name, value in radio.items() if value)
    config.write_text(
        f'status_socket = "{directory}/s"\n[mavlink]\naddress = ""\n[radio]\n{"".join(given)}'
    )
    for fault in faults:
        world.set(fault)
        printed = io.StringIO()
        try:
            with redirect_stdout(printed):
                whole_doctor(config=config)
        except SystemExit as ended:
            lines[fault] = [*printed.getvalue().splitlines(), str(ended.code)]
    print(json.dumps(lines))


if __name__ == "__main__":
    _examine(sys.argv[1])
