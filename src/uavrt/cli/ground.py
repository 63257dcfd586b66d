"""``uavrt ground``: the ground station."""

import asyncio
import contextlib
import os
import signal
import sys
import threading
import webbrowser
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from uavrt.cli.kinds import Port
from uavrt.cli.screen import has_screen
from uavrt.config import read_tags
from uavrt.errors import ConfigError
from uavrt.ground.keys import read_link_keys
from uavrt.ground.station import Station, StationSettings, json_line
from uavrt.recording.plain_database import ended as queries_ended
from uavrt.units import NANOSECONDS_PER_SECOND

if TYPE_CHECKING:
    from uavrt.ground.page import PageStation

DEFAULT_ADDRESS = "udpin://127.0.0.1:14550"
LAST_THREADS_S = 1.5
"""How long threads that still work are waited for when everything else has ended."""
PASSWORD = "UAVRT_GROUND_PASSWORD"

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
    listen: str = "127.0.0.1",
    host_name: tuple[str, ...] = (),
    certificate: Path | None = None,
    key: Path | None = None,
    command_key: Path | None = None,
    signing_key: Path | None = None,
    component_id: int = 190,
    as_gcs: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Talk to the drone: a page in the browser, or without one as a program for scripts.

    Alone it opens the page. With --tags, --start or --json it works without a page, unless
    --page is given: it sends the tags, starts, stores and shows every pulse, and Ctrl-C stops
    detection if it was started here.

    Parameters
    ----------
    mavlink
        Link to the vehicle: udpin://127.0.0.1:14550, serial:///dev/ttyUSB0:57600,
        serial://COM3:57600, tcp://HOST:PORT. Several ways to the same drone, such as Wi-Fi and
        radio, are given each with --mavlink, the one to prefer first. Without it the page uses
        the last one.
    tags
        Tag list to send: TagInfo.txt or tags.toml.
    start
        Start detecting when the tags are sent.
    output
        Directory for what is received; for the page "uavrt-flights" in your home, otherwise
        a new one named by the time.
    json_lines
        Print JSON lines in place of text.
    headless
        Work without a page.
    page
        Serve the page, whatever else is given.
    port
        Port of the page; 0 takes any free one.
    browser
        Open the page in a browser.
    listen
        Address that the page is served at. Others than this computer itself need a password in
        the environment variable UAVRT_GROUND_PASSWORD.
    host_name
        Name by which other computers call this one, when it is not an address.
    certificate
        Certificate file (PEM) for https.
    key
        Key file of the certificate.
    command_key
        Key file that the drone has as mavlink.key_file: commands are sealed with it.
    signing_key
        Key file that the drone has as mavlink.signing_key_file: MAVLink frames are signed.
    component_id
        Our MAVLink component id in system 254. Ground stations of ours that listen to one drone
        at the same time need different ones.
    as_gcs
        Be MAVLink system 255 of type GCS, as the original's drone side needs it. The autopilot
        then takes us for the operator's own ground station, and does not notice its loss.
    """
    if start and tags is None:
        raise ConfigError("there is nothing to detect", remedy="Give the tags with --tags FILE")
    keys = read_link_keys(command_key, signing_key, component_id, as_gcs=as_gcs)
    show = _print_json if json_lines else _print_text
    tag_list = read_tags(tags) if tags is not None else None
    if not page and (headless or json_lines or start or tags is not None):
        settings = StationSettings(
            addresses=mavlink or (DEFAULT_ADDRESS,),
            directory=output or Path(f"ground_{datetime.now(UTC):%Y-%m-%d_%H-%M-%S}"),
            tags=tag_list or (),
            start=start,
            keys=keys,
        )
        asyncio.run(_serve_station(settings, show))
        return
    with _ground_extra():
        from uavrt.ground.page import PageSettings, PageStation
        from uavrt.ground.server import ServerSettings
    page_settings = PageSettings(
        directory=output or Path.home() / "uavrt-flights",
        address=" ".join(mavlink) or None,
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
        ),
    )
    if browser and not json_lines:
        show = _opening(show)
    ended = threading.Event()
    try:
        asyncio.run(_serve_page(lambda: PageStation(page_settings, show), ended))
    finally:
        ended.set()
        queries_ended.clear()  # for whoever goes on in this program


async def _serve_station(settings: StationSettings, show: Any) -> None:
    station = Station(settings, show)
    _on_signals(station.stop)
    await station.run()


async def _serve_page(make: "Any", ended: threading.Event) -> None:
    station: PageStation = make()
    _on_signals(station.stop)
    code = 1
    try:
        await station.run()
        code = 0
    finally:
        # What still reads or computes in a thread, from a disk that hangs, is not waited for.
        queries_ended.set()
        threading.Thread(target=_end_anyway, args=(code, ended), daemon=True).start()


def _end_anyway(code: int, ended: threading.Event) -> None:
    """End the program when the event loop, which waits for its threads, does not."""
    if ended.wait(LAST_THREADS_S):
        return
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _on_signals(stop: Any) -> None:
    """Have Ctrl-C and SIGTERM stop in order."""
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
            remedy="Run `pip install 'uavrt[ground]'`, or work without a page: --headless",
        ) from error


def _opening(show: Any) -> Any:
    """Open a browser when the page is there and this computer has a screen."""

    def show_and_open(event: dict[str, Any]) -> None:
        show(event)
        if event["event"] == "page" and has_screen():
            webbrowser.open(event["address"])

    return show_and_open


def _print_json(event: dict[str, Any]) -> None:
    print(json_line(event), flush=True)


def _print_text(event: dict[str, Any]) -> None:
    match event:
        case {"event": "page", "address": address}:
            print(f"The page is at {address} – Ctrl-C ends", flush=True)
        case {"event": "pulse", "tag_id": tag_id, "snr_db": snr, "frequency_hz": frequency}:
            sure = "confirmed" if event["confirmed"] else event["detection_status"]
            seconds = event["start_time_ns"] / NANOSECONDS_PER_SECOND
            clock = datetime.fromtimestamp(seconds, tz=UTC)
            text = f"{clock:%H:%M:%S.%f}"[:-3]
            print(f"{text}  tag {tag_id}  {snr:5.1f} dB  {frequency / 1e6:.5f} MHz  {sure}")
        case {"event": "text", "text": text}:
            print(f"drone: {text}")
        case {"event": "state", "state": state}:
            print(f"drone is {state}")
        case {"event": "waiting", "reason": reason}:
            print(f"waiting: {reason}")
        case {"event": "drone", "system": system}:
            print(f"drone found: system {system}")
        case {"event": "already detecting"}:
            print("the drone detects these tags already: listening. Ctrl-C stops the search")
        case {"event": "others detected", "reason": reason}:
            print(f"other tags are searched ({reason.removesuffix(': send stop first')}).")
            print("Listening to them. To listen only, leave --tags and --start out; to search")
            print("for yours, let whoever searches for these end it, then run this again.")
        case {"event": "stopped", "pulses": pulses}:
            print(f"stopped; {pulses} pulses received")
        case {"event": "acknowledged", "accepted": False, "command": command}:
            print(f"{command} refused: {event['message']}")
        case {"event": "started", "directory": directory}:
            print(f"detecting; the drone records in {directory}")
