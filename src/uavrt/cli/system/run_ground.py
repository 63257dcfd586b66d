"""``uavrt run --ground``: run drone side and page on one computer, for its own screen."""

import signal
import socket
import subprocess
import sys
from dataclasses import replace

from uavrt.cli.shown.screen import has_page
from uavrt.config.settings import Settings
from uavrt.core.errors import ConfigError

GROUND_STOP_S = 20.0
OWN_COMPONENT = 192
"""MAVLink component id of the page on the drone's computer (MAV_COMP_ID_ONBOARD_COMPUTER2).
With the usual id 190, the drone would confuse the page with a ground station on the radio link
and answer only one of them."""


def with_local_link(settings: Settings) -> tuple[Settings, str]:
    """Add a loopback link to the drone's settings; also return its address for the page."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    links = (*settings.mavlink.direct_links, f"udpin://127.0.0.1:{port}")
    mavlink = replace(settings.mavlink, direct_links=links)
    return replace(settings, mavlink=mavlink), f"udpout://127.0.0.1:{port}"


def run_both(
    supervisor: list[str], address: str, *, settings: Settings, port: int, browser: bool
) -> int:
    """Run the supervisor and the page until the supervisor ends; return its exit status.

    SIGINT and SIGTERM to this process are passed on. If the page ends first, or this process is
    killed, the flight continues.
    """
    if not has_page():
        raise ConfigError(
            "the page is not installed on this computer",
            remedy="Run `pip install 'uavrt[ground]'`, or omit --ground",
        )
    mavlink, directory = settings.mavlink, settings.recording.directory
    keys = {"--command-key": mavlink.key_file, "--signing-key": mavlink.signing_key_file}
    ends: list[int] = []
    drone: subprocess.Popen[bytes] | None = None

    def end(number: int, _frame: object) -> None:
        ends.append(number)
        if drone is not None:
            drone.terminate()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    drone = subprocess.Popen(supervisor)
    if ends:
        drone.terminate()
    page = subprocess.Popen(
        [
            *(sys.executable, "-P", "-m", "uavrt.cli", "ground", "--page"),
            *("--mavlink", address, "--output", directory, "--port", str(port)),
            *("--component-id", str(OWN_COMPONENT)),
            *(word for key, file in keys.items() if file is not None for word in (key, file)),
            *([] if browser else ["--no-browser"]),
        ]
    )
    status = drone.wait()
    # The last pulses are in when the drone side has ended.
    page.terminate()
    try:
        page.wait(GROUND_STOP_S)
    except subprocess.TimeoutExpired:
        page.kill()
        page.wait()
    # A drone side that had not begun yet ends by the signal itself, which is in order.
    return 0 if ends and status < 0 else status
