"""``uavrt monitor``: show a running system in a terminal, and start or stop detection."""

import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter
from rich.console import Console
from rich.live import Live

from uavrt.cli.shown.outputs import print_json
from uavrt.cli.system.monitor_view import MonitorView
from uavrt.cli.system.run import DEFAULT_CONFIG, settings_from
from uavrt.cli.system.start_stop import start_detection, stop_detection
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import UavrtError
from uavrt.core.messages import SystemStatus
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.flight.reading.outline import read_outline

REFRESH_S = 0.25
FIRST_STATUS_S = 5.0


def monitor(
    *,
    config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG,
    flight_dir: Path | None = None,
    start: Path | None = None,
    stop: Annotated[bool, Parameter(negative="")] = False,
    once: Annotated[bool, Parameter(negative="")] = False,
    json_status: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Show a running system in this terminal: processes, rates, losses, tags.

    Works over ssh. Ctrl-C closes the view, not the system. Run it as the same user as the
    system, with the same settings file.

    Parameters
    ----------
    config
        Settings file of the running system, with the path of its status socket.
    flight_dir
        Directory of its flights, instead of the one in the settings.
    start
        Send these tags, start detection and exit.
    stop
        Stop detection and exit.
    once
        Show the state once and exit.
    json_status
        Print the state as one JSON object and exit.
    """
    settings = settings_from(config)
    if flight_dir is not None:
        recording = replace(settings.recording, directory=str(flight_dir))
        settings = replace(settings, recording=recording)
    reader = _connect(status_socket_path(settings))
    try:
        if start is not None:
            flight = start_detection(reader, read_tags(start))
            print(f"detecting; flight: {flight}")
        elif stop:
            print(f"stopping; flight: {stop_detection(reader)}")
        elif once or json_status:
            _show_once(reader, as_json=json_status)
        else:
            _watch(reader)
    finally:
        reader.close()


def _connect(path: Path) -> StatusReader:
    try:
        return StatusReader(path)
    except (UavrtError, PermissionError) as error:
        raise UavrtError(
            f"no running system answers at {path}",
            remedy="Start it with `uavrt run`, give its --config, or use its user account",
        ) from error


def _show_once(reader: StatusReader, *, as_json: bool) -> None:
    view = MonitorView()
    deadline_s = time.monotonic() + FIRST_STATUS_S
    # A share of the processor is the difference of two states, a second apart.
    while time.monotonic() < deadline_s and (
        view.status is None or not (as_json or view.cpu_percent)
    ):
        _read_into(view, reader)
    if view.status is None:
        raise UavrtError("the running system sends no status; repeat the command")
    if as_json:
        print_json(_plain(view.status))
    else:
        Console().print(view.render(time.monotonic()))


def _read_into(view: MonitorView, reader: StatusReader) -> None:
    for topic, record in reader.read(REFRESH_S):
        began_now = view.status is None
        view.add(topic, record, time.monotonic())
        flight = None if view.status is None else view.status.flight_directory
        if began_now and flight is not None:
            with suppress(UavrtError):  # nothing of the flight is on the disk yet
                view.take_recorded(read_outline(flight).heard, time.monotonic())


def _plain(status: SystemStatus) -> object:
    return msgspec.to_builtins(status)


def _watch(reader: StatusReader) -> None:
    view = MonitorView()
    with Live(get_renderable=lambda: view.render(time.monotonic()), refresh_per_second=4):
        while reader.is_open:
            _read_into(view, reader)
    print("the supervisor has ended")
