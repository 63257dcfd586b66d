"""``uavrt run``: run the drone side."""

import os
import signal
import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter

from uavrt.cli.options.kinds import Port
from uavrt.cli.options.near_codes import warn_of_near_codes
from uavrt.cli.system.run_ground import run_both, with_local_link
from uavrt.config.loader import load_settings
from uavrt.config.settings import MavlinkSettings, Settings
from uavrt.config.tags.tag_files import read_tags
from uavrt.core.errors import ConfigError
from uavrt.drone.processes.connection_parts.own_pose import pose_address
from uavrt.drone.status_reader import status_socket_path
from uavrt.flight.flight_layout import require_writable
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.mavlink.sending.signing import read_signing_key
from uavrt.link.tunnel.drone_exchange import Exchange
from uavrt.link.tunnel.own_messages.seal import read_key

DEFAULT_CONFIG = Path("uavrt.toml")


def run(
    *,
    config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG,
    mavlink: str | None = None,
    flight_dir: Path | None = None,
    tags: Path | None = None,
    ground: Annotated[bool, Parameter(negative="")] = False,
    ground_port: Port = 8650,
    browser: bool = True,
) -> None:
    """Run the drone side: radio, detectors, autopilot, recorder, all supervised.

    Without tags it waits for a ground station. Ctrl-C or SIGTERM stops everything cleanly.

    Parameters
    ----------
    config
        Settings file. If you do not name one and the default file does not exist, built-in
        defaults apply.
    mavlink
        Autopilot to use instead of the one in the settings: serial:///dev/ttyUSB0:57600,
        udpin://127.0.0.1:14540, tcp://HOST:PORT; "none" for no autopilot.
    flight_dir
        Directory in which flight directories are created.
    tags
        Load these tags and start detecting at once, without a ground station.
    ground
        Also serve the ground station's page on this computer, for its own screen.
    ground_port
        Port of that page; 0 takes any free one.
    browser
        Open that page in a browser if there is a screen.
    """
    settings = settings_from(config)
    if mavlink is not None:
        address = "" if mavlink == "none" else mavlink
        settings = replace(settings, mavlink=replace(settings.mavlink, address=address))
    if flight_dir is not None:
        settings = replace(
            settings, recording=replace(settings.recording, directory=str(flight_dir))
        )
    settings = without_autopilot(settings)
    check_link(settings)
    require_writable(Path(settings.recording.directory))
    settings = replace(settings, status_socket=str(status_socket_path(settings)))
    page_address = ""
    if ground:
        settings, page_address = with_local_link(settings)
    arguments = [msgspec.json.encode(settings).decode()]
    if tags is not None:
        listed = read_tags(tags)
        warn_of_near_codes(listed)
        arguments.append(msgspec.json.encode(listed).decode())
    sys.stdout.flush()
    command = [sys.executable, "-P", "-m", "uavrt.drone.supervisor", *arguments]
    if ground:
        sys.exit(
            run_both(
                command, page_address, settings=settings, port=ground_port, browser=browser
            )
        )
    # The supervisor takes this process's place: what read the settings leaves the memory.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.execv(sys.executable, command)


def without_autopilot(settings: Settings) -> Settings:
    """Copy the settings without the autopilot; the pose must then have another source.

    Raises `ConfigError` if it has none.
    """
    if settings.pose.source == "autopilot":
        return settings
    pose_address(settings.pose)
    if settings.mavlink.address not in ("", MavlinkSettings().address):
        raise ConfigError(
            f'pose.source = "{settings.pose.source}" and mavlink.address '
            f"{settings.mavlink.address} both set the pose",
            remedy="Leave mavlink.address out; list a radio link to the ground in "
            "mavlink.direct_links",
        )
    return replace(settings, mavlink=replace(settings.mavlink, address=""))


def check_link(settings: Settings) -> None:
    """Raise `ConfigError` for settings with which the link to the autopilot cannot start."""
    mavlink = settings.mavlink
    if mavlink.address:
        parse_address(mavlink.address)
    if mavlink.key_file is not None:
        read_key(mavlink.key_file)
    if mavlink.signing_key_file is not None:
        read_signing_key(mavlink.signing_key_file)
    Exchange(mavlink.tunnel_generation, experimental=mavlink.tunnel_experimental)


def settings_from(config: Path) -> Settings:
    """Read the settings; the defaults if the default file does not exist."""
    if config.exists() or config != DEFAULT_CONFIG:
        return load_settings(config)
    return Settings()
