"""Checks of ``uavrt doctor``: one finding per line, each with its remedy."""

import asyncio
import grp
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from uavrt.config.settings import Settings
from uavrt.core.clock import Clock, monotonic_s
from uavrt.core.commands import SystemState
from uavrt.core.errors import UavrtError
from uavrt.core.messages import SystemStatus
from uavrt.core.runtime import native
from uavrt.drone.card import NEW_CARD, battery_clock_off_s, card_of, clock_fault, clock_is_lost
from uavrt.drone.computer.finding import Finding, failed, judged, passed
from uavrt.link.mavlink.component import Handlers
from uavrt.link.mavlink.links.address import parse_address
from uavrt.link.mavlink.mavlink_connection import Connection
from uavrt.radio.checking import check_device
from uavrt.radio.receivers.devices import usb_radios

THERMAL = Path("/sys/class/thermal")
LISTEN_S = 4.0
"""Longest wait for the autopilot's heartbeat, which is sent once a second [s]."""
HOT_C = 80.0
"""Temperature from which a Raspberry Pi 5 slows down [°C] (Raspberry Pi documentation)."""
IDLE_CORES_NEEDED = 0.5
"""Number of idle cores needed; a hundred tags take 0.1 cores of the reference machine."""


def examine(
    settings: Settings, running: SystemStatus | None, *, mavlink: str | None = None
) -> Iterator[Finding]:
    """Run all checks of the drone's computer; yield each result as soon as it is known."""
    yield check_radio(settings, running)
    if mavlink is not None:
        settings = replace(settings, mavlink=replace(settings.mavlink, address=mavlink))
    yield check_permissions(settings)
    yield check_autopilot(settings, running if mavlink is None else None)
    yield check_clock()
    yield check_disk(settings)
    yield check_card(settings)
    yield check_processor()
    yield check_temperature()


def check_radio(settings: Settings, running: SystemStatus | None) -> Finding:
    """Check that the radio is plugged in and works."""
    if running is not None and running.state in (SystemState.DETECTING, SystemState.CAPTURING):
        receiver = next((p for p in running.processes if p.process == "receiver"), None)
        good = receiver is not None and receiver.ok
        status = receiver.status if receiver else "the receiver is not running"
        text = f"the radio is in use: {status}"
        reason = receiver.reason if receiver is not None else ""
        return Finding(what="radio", ok=good, text=f"{text}: {reason}" if reason else text)
    try:
        said = check_device(settings.radio)
    except UavrtError as error:
        return failed("radio", error.message, error.remedy or "")
    return passed("radio", said)


def check_permissions(settings: Settings) -> Finding:
    """Check that this user may use the radio's USB device and the serial port."""
    nodes = [radio.node for radio in usb_radios()]
    closed = [str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK)]
    if closed:
        return failed(
            "permissions",
            f"{', '.join(closed)} cannot be opened by this user",
            "Install the udev rule (sudo uavrt service install) and join the group plugdev",
        )
    address = settings.mavlink.address
    if address.startswith("serial:"):
        port = parse_address(address).device
        if not os.path.exists(port):
            return failed(
                "permissions",
                f"{port} does not exist",
                "Plug the autopilot's cable in, or set another mavlink.address",
            )
        if not os.access(port, os.R_OK | os.W_OK):
            return failed(
                "permissions",
                f"{port} cannot be opened by this user",
                'Run sudo usermod -a -G dialout "$USER", then log in again',
            )
    as_root = "this program runs as root and needs no group"
    text = f"groups {', '.join(_groups())}" if os.geteuid() else as_root
    return passed("permissions", text)


def _groups() -> list[str]:
    names = []
    for number in os.getgroups():
        with suppress(KeyError):
            names.append(grp.getgrgid(number).gr_name)
    return sorted(names)


def check_autopilot(settings: Settings, running: SystemStatus | None) -> Finding:
    """Check that an autopilot answers."""
    what = "autopilot"
    address = settings.mavlink.address
    if not address:
        return passed(what, "no autopilot is configured, so pulses get no position")
    if running is not None:
        link = next((p for p in running.processes if p.process == "connection"), None)
        heard = link is not None and link.status in ("waiting for ground station", "ready")
        text = f"the running system reports: {link.status if link else 'no connection'}"
    else:
        heard, text = _listen(settings)
    return judged(what, heard, text, "Check wiring, baud rate and the autopilot's MAVLink port")


def _listen(settings: Settings) -> tuple[bool, str]:
    clock = Clock.start()
    link = Connection(
        Handlers(
            attitude=lambda _sample: None,
            position=lambda _sample: None,
            tunnel=lambda _payload, _peer: None,
        ),
        clock.now_ns,
        settings.mavlink,
    )

    async def listen() -> None:
        task = asyncio.create_task(link.run(settings.mavlink.address))
        deadline_s = monotonic_s() + LISTEN_S
        while monotonic_s() < deadline_s and not task.done():
            if link.status() not in ("waiting for autopilot", "waiting for time"):
                break
            await asyncio.sleep(0.05)
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task

    faults: list[str] = []
    try:
        asyncio.run(listen())
    except* UavrtError as group:
        faults = [str(error) for error in group.exceptions]
    if faults:
        return False, faults[0]
    status = link.status()
    if status == "waiting for autopilot":
        text = f"no message from the autopilot arrived at {settings.mavlink.address}"
        return False, f"{text} in {LISTEN_S:.0f} s"
    return True, f"messages from the autopilot arrive at {settings.mavlink.address}"


def check_clock() -> Finding:
    """Check that the computer's clock, which dates the flights, is set."""
    kept = check_kept_time()
    if not kept.ok or not (synchronized := _timedatectl()):
        return kept
    if synchronized == "no":
        remedy = (
            "Connect the computer to a time server once before the flight, or check the time "
            "yourself"
        )
        return replace(
            kept, ok=False, text=f"{kept.text} · the clock is not synchronized", remedy=remedy
        )
    return replace(kept, text=f"{kept.text} · the clock is synchronized")


def check_kept_time() -> Finding:
    """Check that this computer keeps the time while it is switched off without a network."""
    fault = clock_fault()
    text = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime())
    if fault is None:
        kept = battery_clock_off_s() is not None
        text += (
            " · the battery-backed clock agrees"
            if kept
            else " · there is no battery-backed clock"
        )
        return passed("clock", text)
    if clock_is_lost():
        remedy = "Set the clock (sudo timedatectl set-time), or fit a battery for it"
        return failed("clock", fault, remedy)
    return failed(
        "clock",
        f"{text} · {fault}",
        "Once the time is right, run sudo hwclock --systohc; if the fault returns, change the "
        "clock's battery",
    )


def _timedatectl() -> str:
    """Query systemd whether a time server has set the clock: ``yes``, ``no`` or ``""``."""
    if shutil.which("timedatectl") is None:
        return ""
    finished = subprocess.run(
        ["timedatectl", "show", "-p", "NTPSynchronized", "--value"],
        capture_output=True,
        text=True,
        check=False,
        timeout=5.0,
    )
    return finished.stdout.strip()


def check_disk(settings: Settings) -> Finding:
    """Check that there is disk space for a flight."""
    directory = Path(settings.recording.directory).resolve()
    present = next(path for path in (directory, *directory.parents) if path.exists())
    free_mb = shutil.disk_usage(present).free / 1e6
    limit_mb = settings.recording.minimum_free_mb
    good = free_mb >= limit_mb and os.access(present, os.W_OK)
    remedy = f"Make room (at least {limit_mb:.0f} MB), or set recording.directory"
    return judged("disk", good, f"{free_mb:.0f} MB free at {present}", remedy)


def check_card(settings: Settings) -> Finding:
    """Check the health of the memory card with the flights."""
    what = "card"
    directory = Path(settings.recording.directory).resolve()
    present = next(path for path in (directory, *directory.parents) if path.exists())
    card = card_of(present)
    if card is None:
        return passed(what, "this computer does not report the card's condition")
    text = f"{card.device} ({card.kind})"
    if card.written_gb is not None:
        text += f" · {card.written_gb:,.0f} GB written so far"
    if card.life_used_tenths is not None:
        text += f" · {10 * card.life_used_tenths} % of the card's life used"
    faults = card.faults()
    return judged(what, not faults, " · ".join([text, *faults]), NEW_CARD)


def check_processor(measure_s: float = 1.0) -> Finding:
    """Check that enough processor cores are idle."""
    before = _idle_s()
    time.sleep(measure_s)
    idle = (_idle_s() - before) / measure_s
    cores = os.cpu_count() or 1
    text = f"{idle:.1f} of {cores} cores idle; detection by {native.description()}"
    return judged(
        "processor", idle >= IDLE_CORES_NEEDED, text, "Check which other programs run: top"
    )


def _idle_s() -> float:
    fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()
    return (int(fields[4]) + int(fields[5])) / os.sysconf("SC_CLK_TCK")


def check_temperature() -> Finding:
    """Check that the processor is cool enough."""
    hottest: float | None = None
    for zone in THERMAL.glob("thermal_zone*/temp"):
        with suppress(OSError, ValueError):
            hottest = max(hottest or -273.0, int(zone.read_text()) / 1000.0)
    if hottest is None:
        return passed("temperature", "this computer does not report it")
    remedy = "Improve its cooling: above 80 °C it slows down"
    return judged("temperature", hottest < HOT_C, f"{hottest:.0f} °C", remedy)
