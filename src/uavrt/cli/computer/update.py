"""``uavrt update``: install another version offline; go back to the old one if it fails."""

import contextlib
import importlib
import shlex
import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import uavrt
from uavrt.cli.options.kinds import Seconds
from uavrt.cli.system.run import DEFAULT_CONFIG, settings_from
from uavrt.config.settings import Settings
from uavrt.core.clock import monotonic_s
from uavrt.core.errors import NotFound, UavrtError, UsageError
from uavrt.drone.computer import update as updating
from uavrt.drone.computer.autopilot_setup import armed_by_link
from uavrt.drone.computer.trial import Needs, Seen, Trial, Verdict, require_still
from uavrt.drone.computer.versions import Installation, runs_from
from uavrt.drone.status_reader import StatusReader, status_socket_path
from uavrt.drone.supervisor.tree.table import PROCESSES

RESTART = "systemctl restart uavrt.service"
POLL_S = 3.0
TURN_S = 0.5


def update(
    file: Path | None = None,
    *,
    config: Annotated[Path, Parameter(alias="-c")] = DEFAULT_CONFIG,
    bench: Annotated[bool, Parameter(negative="")] = False,
    downgrade: Annotated[bool, Parameter(negative="")] = False,
    check: Annotated[bool, Parameter(negative="")] = False,
    resume: Annotated[bool, Parameter(negative="")] = False,
    rehearse: Annotated[bool, Parameter(negative="", show=False)] = False,
    prefix: Path | None = None,
    restart: str = RESTART,
    hold_s: Seconds = 60.0,
    patience_s: Seconds = 180.0,
) -> None:
    """Install another version from a signed file, try it, and go back if it is not fit to fly.

    Needs sudo, and no network. Refused while the vehicle is armed or a flight is recorded. The
    previous version is restored unless heartbeats and poses arrive steadily for a minute.
    Flights and settings stay as they are.

    Parameters
    ----------
    file
        A .tar with all libraries, or a .whl of uavrt alone with its .sig in the same folder.
    config
        Settings file of the service.
    bench
        Require only those data that are received before the update, such as no poses indoors.
    downgrade
        Also install a version that is not newer.
    check
        Only check whether the file could be installed.
    resume
        Complete an interrupted trial of a version; the service does so at boot.
    prefix
        Directory with all installed versions; by default that of this program.
    restart
        Command that restarts the service.
    hold_s
        Time for which all data must arrive without a gap [s].
    patience_s
        Longest duration of the trial [s].
    """
    settings = settings_from(config)
    if rehearse:
        _rehearse()
        return
    if file is not None and not file.is_file():
        raise NotFound(f"there is no file {file}", remedy="Check the name of the file")
    place = Installation(prefix) if prefix else Installation.of(sys.executable)
    if place is None:
        text = "this uavrt was not installed by deploy/install.sh, so it cannot update itself"
        raise UsageError(text, remedy="Call /opt/uavrt/venv/bin/uavrt, or give --prefix")
    place.require()
    again = partial(_restart, restart)
    watch = partial(_watch, settings, place, hold_s=hold_s, patience_s=patience_s)
    with place.locked():
        if resume:
            done = updating.finish(
                place, restart=again, judge=lambda: watch(Needs.of(settings)), say=_print
            )
            sys.exit(0 if done else 1)
        if file is None:
            raise UsageError(
                "the update file is missing", remedy="Name the file: uavrt update FILE.tar"
            )
        found = updating.check(file, place, downgrade=downgrade)
        needs = _require_still(settings, bench=bench)
        _print(f"{file.name} holds {found.version}, and is signed")
        if check:
            return
        made = updating.install_beside(found, place, config=config, directory=Path.cwd())
        needs = _require_still(settings, bench=bench)  # that took a while
        # A terminal that goes away must not end the watch.
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        taken = updating.exchange(
            made, place, restart=again, judge=lambda: watch(needs), say=_print
        )
    sys.exit(0 if taken else 1)


def _restart(command: str) -> None:
    updating.restart_by(shlex.split(command))
    if command == RESTART:
        updating.restart_page()


def _print(text: str) -> None:
    with contextlib.suppress(OSError):
        print(text, flush=True)


def _rehearse() -> None:
    """Load a flight's modules and print the version; called by the installed version."""
    for row in PROCESSES:
        importlib.import_module(row.module)
    importlib.import_module("uavrt.drone.supervisor.supervisor_program")
    print(uavrt.__version__)


def _require_still(settings: Settings, *, bench: bool) -> Needs:
    seen, needs = Seen(), Needs.of(settings)
    try:
        reader = StatusReader(status_socket_path(settings))
    except (UavrtError, OSError):  # it does not run: the link to the autopilot is free
        if needs.heartbeat:
            seen.armed = armed_by_link(settings.mavlink.address)
            seen.heartbeat_s = None if seen.armed is None else monotonic_s()
    else:
        with contextlib.closing(reader):
            end_s = monotonic_s() + POLL_S
            while monotonic_s() < end_s:
                for _, record in reader.read(0.2):
                    seen.add(record, monotonic_s())
    return require_still(seen, needs, monotonic_s(), bench=bench)


def _watch(
    settings: Settings, place: Installation, needs: Needs, *, hold_s: float, patience_s: float
) -> tuple[Verdict, str]:
    """Observe the service until it is decided whether the new version is fit to fly."""
    trial = Trial(needs, monotonic_s(), hold_s=hold_s, patience_s=patience_s)
    read = _Reading(status_socket_path(settings), place.current())
    verdict = Verdict.OPEN
    while verdict is Verdict.OPEN:
        verdict = trial.judge(read(), monotonic_s())
    return verdict, trial.fault


class _Reading:
    """Reads the status records of one version of the service, and reconnects after a restart;
    other versions' reports are ignored, as the old one runs on after a failed restart.
    """

    def __init__(self, path: Path, version: Path) -> None:
        self._path, self._version = path, version
        self._reader: StatusReader | None = None

    def __call__(self) -> list[object]:
        try:
            if self._reader is None:
                self._reader = StatusReader(self._path, TURN_S)
            records = [record for _, record in self._reader.read(TURN_S)]
            ours = runs_from(self._reader.process_id, self._version)
            records, gone = records if ours else [], not (ours and self._reader.is_open)
        except (UavrtError, OSError):
            records, gone = [], True
        if gone and self._reader is not None:
            self._reader.close()
            self._reader = None
        elif gone:
            time.sleep(0.1)
        return records
