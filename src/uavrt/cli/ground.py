"""``uavrt ground``: the ground station."""

import asyncio
import signal
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from uavrt.config import read_tags
from uavrt.errors import ConfigError
from uavrt.ground.station import Station, StationSettings, json_line


def ground(
    *,
    mavlink: str = "udpin://127.0.0.1:14550",
    tags: Path | None = None,
    start: Annotated[bool, Parameter(negative="")] = False,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    json_lines: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Talk to the drone: send tags, start, store and show every pulse.

    Ctrl-C stops detection if it was started here, takes the last pulses in, and ends.

    Parameters
    ----------
    mavlink
        Link to the vehicle: udpin://127.0.0.1:14550, serial:///dev/ttyUSB0:57600,
        tcp://HOST:PORT.
    tags
        Tag list to send: TagInfo.txt or tags.toml.
    start
        Start detecting when the tags are sent.
    output
        Directory for the received pulses; a new one named by the time if not given.
    json_lines
        Print JSON lines in place of text.
    """
    if start and tags is None:
        raise ConfigError("there is nothing to detect", remedy="Give the tags with --tags FILE")
    settings = StationSettings(
        address=mavlink,
        directory=output or Path(f"ground_{datetime.now(UTC):%Y-%m-%d_%H-%M-%S}"),
        tags=read_tags(tags) if tags is not None else (),
        start=start,
    )
    show = _print_json if json_lines else _print_text
    asyncio.run(_serve(settings, show))


async def _serve(settings: StationSettings, show: Any) -> None:
    station = Station(settings, show)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, station.stop)
    await station.run()


def _print_json(event: dict[str, Any]) -> None:
    print(json_line(event), flush=True)


def _print_text(event: dict[str, Any]) -> None:
    match event:
        case {"event": "pulse", "tag_id": tag_id, "snr_db": snr, "frequency_hz": frequency}:
            sure = "confirmed" if event["confirmed"] else event["detection_status"]
            seconds = event["start_time_ns"] / 1e9
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
        case {"event": "stopped", "pulses": pulses}:
            print(f"stopped; {pulses} pulses received")
        case {"event": "acknowledged", "accepted": False, "command": command}:
            print(f"{command} refused: {event['message']}")
        case {"event": "started", "directory": directory}:
            print(f"detecting; the drone records in {directory}")
