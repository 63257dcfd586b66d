"""``uavrt ground``: run the ground station."""

import asyncio
import contextlib
import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from uavrt.cli.options.kinds import Component, Port, Vehicles
from uavrt.cli.options.near_codes import warn_of_near_codes
from uavrt.cli.shown.screen import has_screen
from uavrt.cli.shown.terminal_lines import TerminalLines
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.commands import SystemState
from uavrt.core.errors import ConfigError
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.flight.database.plain_database import queries_ended
from uavrt.ground.link.keys import read_link_keys
from uavrt.ground.station import Station, StationSettings, json_line

LOOPBACK = "127.0.0.1"
DEFAULT_ADDRESS = "udpin://127.0.0.1:14550"
LAST_THREADS_S = 1.5
"""Longest wait for worker threads after everything else has ended [s]."""
PASSWORD = "UAVRT_GROUND_PASSWORD"
ACCESS_POINT = "UAVRT_ACCESS_POINT"
"""Environment variable with the text of the QR code by which phones join our Wi-Fi."""

Flag = Annotated[bool, Parameter(negative="")]


def ground(
    *,
    mavlink: tuple[str, ...] = (),
    tags: Path | None = None,
    start: Flag = False,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    json_lines: Annotated[bool, Parameter(name="--json", negative="")] = False,
    headless: Flag = False,
    page: Flag = False,
    port: Port = 8650,
    browser: bool = True,
    listen: str = LOOPBACK,
    host_name: tuple[str, ...] = (),
    certificate: Path | None = None,
    key: Path | None = None,
    command_key: Path | None = None,
    signing_key: Path | None = None,
    vehicle: Vehicles = (),
    my_place: str | None = None,
    dem: str | None = None,
    set_up: Path | None = None,
    archive: str | None = None,
    component_id: Component = 190,
    as_gcs: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Connect to the drone, from a page in the browser or as a program for scripts.

    Without options it opens the page.
    With --tags, --start or --json it runs without a page, unless
    --page is given: it sends the tags, starts detection, stores and shows every pulse, and
    Ctrl-C stops detection if it was started here.

    Parameters
    ----------
    mavlink
        Link to the vehicle: udpin://127.0.0.1:14550, serial:///dev/ttyUSB0:57600,
        serial://COM3:57600, tcp://HOST:PORT. For several links to the same drone, such as Wi-Fi
        and radio, repeat --mavlink, preferred link first. Without it the page uses the last
        one.
    tags
        Tag list to send: TagInfo.txt or tags.toml.
    start
        Start detection once the tags are sent, on each vehicle that is served.
    output
        Directory for received data; by default "uavrt-flights" in your home for the page,
        otherwise a new one named after the time.
    json_lines
        Print JSON lines instead of text.
    headless
        Run without a page.
    page
        Serve the page whatever the other options are.
    port
        Port of the page; 0 takes any free one.
    browser
        Open the page in a browser.
    listen
        Address to serve the page on. Any address other than this computer's loopback requires a
        password in the environment variable UAVRT_GROUND_PASSWORD.
    host_name
        Name that other computers use for this one, if it is not an address.
    certificate
        Certificate file (PEM) for https.
    key
        Key file of the certificate.
    command_key
        The drone's mavlink.key_file; commands are sealed with it.
    signing_key
        The drone's mavlink.signing_key_file; MAVLink frames are signed with it.
    vehicle
        System number of a vehicle to serve besides the first one received: a second drone, a
        mast or a person with a receiver, on the same links. Repeat it for several. Each has a
        page of its own, linked from the first, and tags are located from the pulses of all.
    my_place
        GPS receiver of this computer, for the page: serial:///dev/ttyACM0, or with its baud
        rate if not 9600 (…0:4800); udpin://127.0.0.1:10110; tcp://HOST:2947. It
        must send NMEA. "" forgets the saved one.
    dem
        Elevation file (SRTM .hgt or GeoTIFF) or a folder of them, for the page's positions,
        reports and exports: hills weaken signals, and explain silence. "" forgets the saved
        one.
    set_up
        The drone side's uavrt.toml, where the page runs on the drone's own computer: until it
        has been set up, the page asks for name, antenna, radio, autopilot and keys.
    archive
        Directory that uavrt batch wrote: the page lists its flights, too, by tag and day. By
        default "archive" in the directory of -o, if it is there. "" forgets the saved one.
    component_id
        Our MAVLink component id in system 254. uavrt ground stations that listen to one drone
        at the same time need different ids.
    as_gcs
        Act as MAVLink system 255 of type GCS, which the original's drone side requires. The
        autopilot then takes us for the operator's own ground station and does not notice if
        that is lost.
    """
    if start and tags is None:
        raise ConfigError(
            "there are no tags to detect", remedy="Give the tags with --tags FILE"
        )
    if set_up is not None and not set_up.is_file():
        raise ConfigError(
            f"the settings file {set_up}, given with --set-up, does not exist",
            remedy="Give the drone side's uavrt.toml; deploy/install.sh writes one",
        )
    keys = read_link_keys(command_key, signing_key, component_id, as_gcs=as_gcs)
    lines = TerminalLines()
    shown_as = json_line if json_lines else _text_of

    def show(event: dict[str, Any]) -> None:
        if (line := shown_as(event)) is not None:
            lines(line)

    tag_list = read_tags(tags) if tags is not None else None
    warn_of_near_codes(tag_list or ())
    if not page and (headless or json_lines or start or tags is not None):
        _refuse_unused(
            vehicle=bool(vehicle),
            my_place=my_place is not None,
            dem=dem is not None,
            set_up=set_up is not None,
            archive=archive is not None,
            listen=listen != LOOPBACK,
            host_name=bool(host_name),
            certificate=certificate is not None,
            key=key is not None,
        )
        settings = StationSettings(
            address=" ".join(mavlink or (DEFAULT_ADDRESS,)),
            directory=output or Path(f"ground_{datetime.now(UTC):%Y-%m-%d_%H-%M-%S}"),
            tags=tag_list,
            start=start,
            keys=keys,
        )
        _run(lambda: Station(settings, show), lines)
        return
    with _ground_extra():
        from uavrt.ground.web.page_program import PageSettings, PageStation
        from uavrt.ground.web.server import ServerSettings
    page_settings = PageSettings(
        directory=output or Path.home() / "uavrt-flights",
        address=" ".join(mavlink) or None,
        my_place=my_place,
        further_vehicles=vehicle,
        dem=dem,
        archive=archive,
        tags=tag_list,
        start=start,
        keys=keys,
        server=ServerSettings(
            host=listen,
            port=port,
            names=frozenset(host_name),
            password=os.environ.get(PASSWORD) or None,
            certificate=certificate,
            key=key,
            access_point=os.environ.get(ACCESS_POINT) or None,
            drone_settings=set_up,
        ),
    )
    if browser and not json_lines:
        show = _opening(show)
    _run(lambda: PageStation(page_settings, show), lines)


def _run(make: Callable[[], Station], lines: TerminalLines) -> None:
    """Run a station until it ends or is stopped."""
    ended = threading.Event()
    try:
        asyncio.run(_serve(make, ended, lines))
    finally:
        ended.set()
        queries_ended.clear()  # for whoever goes on in this program
        _print_rest(lines)


def _print_rest(lines: TerminalLines) -> None:
    """Print the last lines; end the program at once if the terminal accepts none."""
    if not lines.close():
        os._exit(0 if sys.exc_info()[0] is None else 1)


async def _serve(
    make: Callable[[], Station], ended: threading.Event, lines: TerminalLines
) -> None:
    station = make()
    _on_signals(station.stop)
    code = 1
    try:
        await station.run()
        code = 0
    finally:
        # What still reads or computes in a thread, from a disk that hangs, is not waited for.
        queries_ended.set()
        threading.Thread(
            target=_exit_if_blocked, args=(code, ended, lines), daemon=True
        ).start()


def _exit_if_blocked(code: int, ended: threading.Event, lines: TerminalLines) -> None:
    """End the program if its event loop still waits for threads."""
    if ended.wait(LAST_THREADS_S):
        return
    lines.close()
    os._exit(code)


def _on_signals(stop: Any) -> None:
    """Let Ctrl-C and SIGTERM stop the station cleanly."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        try:
            loop.add_signal_handler(number, stop)
        except NotImplementedError:  # Windows
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop))


@contextlib.contextmanager
def _ground_extra() -> Any:
    try:
        yield
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("uavrt"):
            raise
        raise ConfigError(
            f"the page needs {error.name}, which is not installed",
            remedy="Run `pip install 'uavrt[ground]'`, or run without a page: --headless",
        ) from error


def _opening(show: Any) -> Any:
    """Open a browser once the page is ready, if this computer has a screen."""

    def show_and_open(event: dict[str, Any]) -> None:
        show(event)
        if event["event"] == "page" and has_screen():
            webbrowser.open(event["address"])

    return show_and_open


def _text_of(event: dict[str, Any]) -> str | None:
    """Describe an event for a person; None for an event that is not shown."""
    match event:
        case {"event": "page", "address": address}:
            return f"The page is at {address} – Ctrl-C ends"
        case {"event": "pulse", "tag_id": tag_id, "snr_db": snr, "frequency_hz": frequency}:
            sure = "confirmed" if event["confirmed"] else event["detection_status"]
            seconds = event["start_time_ns"] / NANOSECONDS_PER_SECOND
            clock = datetime.fromtimestamp(seconds, tz=UTC)
            text = f"{clock:%H:%M:%S.%f}"[:-3]
            return f"{text}  tag {tag_id}  {snr:5.1f} dB  {frequency / 1e6:.5f} MHz  {sure}"
        case {"event": "text", "text": text}:
            return f"drone: {text}"
        case {"event": "note", "text": text}:
            return str(text)
        case {"event": "state", "state": str(state)}:
            return f"the drone is {SystemState(state).words}"
        case {"event": "state"}:
            return "the drone is in an unknown state"
        case {"event": "waiting", "reason": reason}:
            return f"waiting: {reason}"
        case {"event": "drone", "system": system}:
            return f"drone found: system {system}"
        case {"event": "already detecting"}:
            return (
                "the drone detects these tags already; receiving their pulses. "
                "Ctrl-C stops the search"
            )
        case {"event": "others detected", "reason": reason}:
            return (
                f"other tags are searched for ({reason.removesuffix(': send stop first')}).\n"
                "Receiving their pulses. To receive only, leave out --tags and --start. To\n"
                "search for yours, stop this search at the station that started it, and run\n"
                "this again."
            )
        case {"event": "stopped", "pulses": pulses}:
            return f"stopped; {pulses} pulses received"
        case {"event": "acknowledged", "accepted": False, "command": command}:
            return f"{command} refused: {event['message']}"
        case {"event": "started", "directory": directory}:
            return f"detecting; the drone records in {directory}"
    return None


def _refuse_unused(**given: bool) -> None:
    """Reject options that need a page when there is none; raises `ConfigError`."""
    unused = [f"--{name.replace('_', '-')}" for name, is_given in given.items() if is_given]
    if unused:
        raise ConfigError(
            f"{', '.join(unused)} cannot be used without the page",
            remedy="Add --page, or leave out --headless, --tags, --start and --json",
        )
