"""Install a new version for ``uavrt update``, try it, and keep it or restore the old one.

A power cut may happen at any step:

1. The new version is installed in its own directory and tested there: it loads everything that
a flight needs, and reads the settings. The running version is not affected.

2. The link ``trial`` is set to the previous version, ``venv`` to the new one, and the service
is restarted.

3. The new version is monitored (`uavrt.drone.computer.trial`). If it is good, its keys are
accepted and ``trial`` is removed; if not, ``venv`` is set back and the service restarted.

A cut before 2 changes nothing. After it, ``uavrt-update.service`` continues with 3 at the next
boot, with the program of the previous version. Flights and settings are not touched.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from uavrt.core.atomic_file import write_atomically
from uavrt.core.errors import UavrtError, UsageError, os_errors_as
from uavrt.drone.computer.trial import Verdict
from uavrt.drone.computer.update_file import Update, read_update, unpack_wheels, version_key
from uavrt.drone.computer.versions import COMPLETE, Installation, version_of

PrintText = Callable[[str], None]
Restart = Callable[[], None]
TrialCheck = Callable[[], tuple[Verdict, str]]
"""Function that monitors a new version on trial. It returns the decision, and a text on what
failed."""

EXTRAS = {"ros2": "cyclonedds", "ground": "starlette"}
"""Optional parts (pip extras), each with a package that shows it is installed."""
BUILT_HERE = "wheels"
"""Name of the directory of wheels that deploy/install.sh built on this computer, as for 64-bit
ARM."""
PAGE_UNIT = "uavrt-page.service"
KEYS = ".update-keys.pem"
"""File name, in a version's directory, of the public keys that come with the version."""
SPACE_FACTOR = 2.2
"""Disk space for a new version and its wheels, as a multiple of the previous version's size."""


def check(path: Path, place: Installation, *, downgrade: bool = False) -> Update:
    """Read an update and check that it may be installed here; raises `UavrtError` if not."""
    place.require()
    update = read_update(path, place.keys)
    if place.before() is not None:
        text = "the previous update is still on trial"
        raise UsageError(text, remedy="Wait until the trial ends: uavrt update --resume")
    present = place.current()
    if present.name == update.name:
        raise UsageError(f"this build of {update.version} is already installed")
    version = version_of(present)
    if version_key(update.version) <= version_key(version) and not downgrade:
        raise UsageError(
            f"{update.version} is not newer than {version}, which is installed",
            remedy="To install it anyway, give --downgrade",
        )
    _require_room(place, present)
    return update


def _require_room(place: Installation, present: Path) -> None:
    taken = sum(file.lstat().st_size for file in present.rglob("*") if not file.is_symlink())
    needed_mb, free_mb = (
        SPACE_FACTOR * taken / 1e6,
        shutil.disk_usage(place.prefix).free / 1e6,
    )
    if free_mb < needed_mb:
        raise UsageError(
            f"an update needs {needed_mb:.0f} MB, but only {free_mb:.0f} MB are free at "
            f"{place.prefix}",
            remedy="Free disk space: fetch flights, then delete them on the drone",
        )


def install_beside(
    update: Update, place: Installation, *, config: Path, directory: Path
) -> Path:
    """Install and test a new version in its own directory; return this directory."""
    made = place.version_directory(update.name)
    try:
        if not (made / COMPLETE).exists():
            shutil.rmtree(made, ignore_errors=True)
            _make(update, place.current(), made)
        rehearse(made, update.version, config=directory / config)
        place.mark_complete(made)
    except BaseException as error:
        shutil.rmtree(made, ignore_errors=True)
        if isinstance(error, OSError):
            text = f"the new version cannot be written: {error.strerror or error}"
            raise UsageError(text, remedy="Free disk space, and check the disk") from error
        raise
    return made


def python_module(environment: Path, *words: str) -> list[str]:
    """Return the command that runs a module of an environment as root, with ``-I``.

    ``-I`` prevents imports from the working directory, which may belong to the service's user.
    """
    return [str(environment / "bin/python"), "-I", "-m", *words]


def _make(update: Update, present: Path, made: Path) -> None:
    pip = python_module(made, "pip", "install", "--quiet", "--no-index")
    if update.alone:
        shutil.copytree(present, made, symlinks=True)
        for name in (COMPLETE, KEYS):
            (made / name).unlink(missing_ok=True)
        assert update.content is not None
        with tempfile.TemporaryDirectory(prefix=".wheels-", dir=made) as wheels:
            wheel = Path(wheels) / update.path.name
            wheel.write_bytes(update.content)
            _run([*pip, "--no-deps", "--force-reinstall", str(wheel)], update)
        _require_libraries(made, update)
        return
    _run(python_module(present, "venv", str(made)), update)
    extras = [name for name, known in EXTRAS.items() if _has(present, known)]
    wanted = f"uavrt[{','.join(extras)}]=={update.version}"
    with tempfile.TemporaryDirectory(prefix=".wheels-", dir=made) as wheels:
        unpack_wheels(update, Path(wheels))
        _run([*pip, "--find-links", wheels, wanted], update)
    if _has(present, EXTRAS["ros2"]) and not _has(made, EXTRAS["ros2"]):
        for built in (present.parents[1] / BUILT_HERE).glob("cyclonedds-*.whl"):
            _run([*pip, "--no-deps", str(built)], update)
    if update.manifest is not None and update.manifest.keys is not None:
        write_atomically(made / KEYS, update.manifest.keys)


def _require_libraries(made: Path, update: Update) -> None:
    done = _run_isolated(python_module(made, "pip", "check"))
    lacks = [line for line in done.stdout.splitlines() if line.startswith("uavrt ")]
    if lacks:
        raise UsageError(
            f"{update.version} needs other libraries: {lacks[0]}",
            remedy="Use the .tar update, which contains them; deploy/make-update.py builds it",
        )


def _has(environment: Path, distribution: str) -> bool:
    return any(environment.glob(f"lib/python3*/site-packages/{distribution}-*.dist-info"))


def _run(command: Sequence[str], update: Update) -> None:
    done = _run_isolated(command)
    if done.returncode:
        said = (done.stderr + done.stdout).strip().splitlines() or ["no word"]
        errors = [line for line in said if line.startswith("ERROR:")] or said
        python = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise UsageError(
            f"{update.version} cannot be installed here: {errors[0]}",
            remedy=f"Make an update for Python {python} on {os.uname().machine}, with "
            "all libraries "
            "(deploy/make-update.py)",
        )


def _run_isolated(command: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    """Run a command in ``/``, without the Python and pip settings of the caller."""
    kept = {name: value for name, value in os.environ.items() if name in ("PATH", "LANG")}
    kept |= {"PIP_CONFIG_FILE": "/dev/null", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    return subprocess.run(
        command, capture_output=True, text=True, check=False, env=kept, cwd="/"
    )


def rehearse(made: Path, version: str, *, config: Path) -> None:
    """Test that the new version loads all modules and settings; raises `UsageError` if not."""
    command = python_module(made, "uavrt.cli", "update", "--rehearse")
    if config.exists():
        command += ["--config", str(config.absolute())]
    done = _run_isolated(command)
    if done.returncode or done.stdout.split() != [version]:
        said = (
            done.stderr.strip() or f"it reports the version {done.stdout.strip()!r}"
        ).splitlines()
        raise UsageError(
            f"{version} does not start here: {said[-1]}",
            remedy="Check uavrt.toml, or report this error; the previous version stays in use",
        )


def exchange(
    made: Path, place: Installation, *, restart: Restart, judge: TrialCheck, say: PrintText
) -> bool:
    """Start the new version and monitor it. If it fails, restore the previous version.

    True if the new version was kept.
    """
    before = place.current()
    place.point(place.trial, before)
    place.point(place.link, made)
    say(f"{made.name} runs on trial; the previous version is {before.name}")
    _restart(restart, say)
    return finish(place, restart=restart, judge=judge, say=say)


def finish(place: Installation, *, restart: Restart, judge: TrialCheck, say: PrintText) -> bool:
    """Finish a trial, also one that a power cut interrupted; True if the version was kept."""
    before = place.before()
    if before is None:
        say("no version is on trial")
        return True
    current = place.current()
    if current == before:  # cut off before the exchange, or while going back
        _go_back(place, before, restart, say)
        return False
    verdict, fault = judge()
    if verdict is Verdict.GOOD:
        _take_keys(current, place)
        place.end_trial()
        place.remove_others(current, before)
        say(f"{current.name} has passed its trial and is kept")
        return True
    place.point(place.link, before)
    say(f"{current.name} has failed its trial ({fault}): {before.name} is restored")
    _go_back(place, before, restart, say)
    return False


def _go_back(place: Installation, before: Path, restart: Restart, say: PrintText) -> None:
    restarted = _restart(restart, say)
    place.end_trial()
    if restarted:  # otherwise the refused one may still run from its files
        place.remove_others(before)


def _restart(restart: Restart, say: PrintText) -> bool:
    try:
        restart()
    except UavrtError as error:
        say(str(error))
        return False
    return True


def _take_keys(version: Path, place: Installation) -> None:
    try:
        text = (version / KEYS).read_text(encoding="ascii")
    except FileNotFoundError:
        return
    write_atomically(place.keys, text)


def restart_by(command: Sequence[str]) -> None:
    """Restart the service by `command`; raises `UavrtError` if it fails."""
    with os_errors_as(UavrtError, f"{command[0]}"):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise UavrtError(f"{' '.join(command)} failed: {done.stderr.strip()}")


def restart_page() -> None:
    """Restart the web page service of a system image, so that it runs the present version.

    This separate service would otherwise use files of the previous version, which are removed.
    Without a system image, nothing happens.
    """
    with suppress(OSError):
        command = ["systemctl", "try-restart", PAGE_UNIT]
        subprocess.run(command, capture_output=True, check=False)
