"""The ground works on Windows and macOS: nothing of POSIX alone is imported for it."""

import pytest
from command_line import python

from uavrt.core.errors import ConfigError
from uavrt.link.mavlink.links.address import parse_address

HIDDEN = (
    *("fcntl", "termios", "tty", "pty", "grp", "pwd", "resource", "posix", "syslog"),
    *("curses", "readline", "multiprocessing.popen_fork"),
    "multiprocessing.popen_forkserver",
)

PROGRAM = """
import importlib, importlib.abc, os, signal, socket, sys
# What the standard library itself needs is loaded before the others are hidden.
import asyncio, concurrent.futures, logging, pathlib, random, shutil, sqlite3, ssl, subprocess
import tempfile, uuid, zipfile, email, http.client, webbrowser

class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in {hidden!r} and not _by_others():
            raise ModuleNotFoundError(f"hidden {{name}}", name=name)
        return None

def _by_others():
    frame = sys._getframe(2)
    while frame is not None:
        name = frame.f_globals.get("__name__", "")
        if not name.startswith("importlib") and not name.startswith("_frozen"):
            return not name.startswith("uavrt")
        frame = frame.f_back
    return False

for name in {hidden!r}:
    sys.modules.pop(name, None)
for name in ("fork", "forkpty", "wait4", "getuid", "setsid"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("AF_UNIX", "SO_REUSEPORT"):
    if hasattr(socket, name):
        delattr(socket, name)
sys.meta_path.insert(0, Hidden())
for module in {modules!r}:
    importlib.import_module(module)
    print(module)
"""


MODULES = tuple(
    f"uavrt.{name}"
    for name in (
        *("ground.web.page_program", "ground.web.server", "ground.web.work.exports"),
        *(
            "ground.web.work.report_jobs",
            "ground.fetch.ftp_client",
            "ground.web.work.waterfalls",
        ),
        *("analysis.report", "analysis.estimates.positions", "analysis.tracks"),
        *(
            "cli.system.ground",
            "cli.results.report",
            "cli.results.localize",
            "cli.system.fetch",
        ),
        *("cli.results.export", "cli.results.bearing", "cli.signals.attach", "cli.app"),
        "ground.store.drone_directory",
    )
)


def test_the_ground_needs_nothing_of_posix() -> None:
    program = PROGRAM.format(hidden=tuple(HIDDEN), modules=MODULES)
    finished = python("-c", program)
    assert finished.stdout.split() == list(MODULES), finished.stderr


def test_the_test_itself_would_notice() -> None:
    program = PROGRAM.format(
        hidden=tuple(HIDDEN), modules=("uavrt.flight.database.writer_lock",)
    )
    finished = python("-c", program)
    assert "hidden fcntl" in finished.stderr


def test_a_serial_port_of_windows_is_an_address() -> None:
    address = parse_address("serial://COM12:115200")
    assert (address.device, address.baud) == ("COM12", 115_200)
    assert parse_address(str(address)) == address
    for wrong in ("serial://COM3/x:1", "serial://COMX:1", "serial://COM3:0"):
        with pytest.raises(ConfigError):
            parse_address(wrong)
