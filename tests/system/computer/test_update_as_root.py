"""What the service's user writes is never run as root, and a refused update leaves nothing."""

import configparser
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import python
from tests.system.test_image import Started, configure
from update_maker import TINY, make_installation, make_key, sign_alone, write_wheel

from uavrt.core.errors import FormatError, UsageError
from uavrt.drone.computer import update
from uavrt.drone.computer.service import ServicePlan, update_unit_text
from uavrt.drone.computer.trial import Verdict
from uavrt.drone.computer.update_file import read_update
from uavrt.drone.computer.versions import COMPLETE, Installation

PROGRAM = TINY | {
    "uavrt/cli/__main__.py": (
        "import sys, msgspec\nfrom importlib.metadata import version\n"
        "if '--config' in sys.argv:\n"
        "    open(sys.argv[sys.argv.index('--config') + 1]).read()\n"
        "print(version('uavrt'))\n"
    )
}
"""Imports a library and reads the settings, as a whole program does."""


@pytest.fixture(scope="module")
def maker(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    return make_key(tmp_path_factory.mktemp("maker"), "release")


@pytest.fixture
def place(maker: tuple[Path, str], tmp_path: Path) -> Installation:
    wheel = write_wheel(tmp_path, "0.1.0", PROGRAM)
    make_installation(tmp_path / "opt", wheel, maker[1])
    return Installation(tmp_path / "opt")


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """The directory of a service's user who wants to be root."""
    directory = tmp_path / "service"
    directory.mkdir()
    for name in ("msgspec", "pip", "venv", "uavrt"):
        (directory / f"{name}.py").write_text(
            f"import pathlib\npathlib.Path({str(directory / 'taken')!r}).touch()\n"
        )
    (directory / "uavrt.toml").write_text("")
    return directory


def newer(maker: tuple[Path, str], tmp_path: Path, version: str = "0.2.0") -> Path:
    return sign_alone(write_wheel(tmp_path, version, PROGRAM), maker[0])


def versions(place: Installation) -> list[str]:
    return sorted(path.name for path in (place.prefix / "versions").iterdir())


def test_an_update_runs_no_module_of_the_directory_it_is_called_in(
    maker: tuple[Path, str],
    place: Installation,
    directory: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = update.check(newer(maker, tmp_path), place)
    monkeypatch.chdir(directory)
    update.install_beside(found, place, config=Path("uavrt.toml"), directory=directory)
    assert not (directory / "taken").exists()


def test_the_unit_that_ends_a_trial_runs_no_module_of_the_services_directory(
    place: Installation, directory: Path
) -> None:
    place.trial.symlink_to("versions/source")
    plan = ServicePlan(program=place.link / "bin/uavrt", user="uavrt", directory=directory)
    unit = configparser.RawConfigParser(strict=False)
    unit.optionxform = str  # type: ignore[assignment,method-assign]
    unit.read_string(update_unit_text(plan, place.prefix))
    command = shlex.split(unit["Service"]["ExecStart"])
    done = subprocess.run(
        command, cwd=unit["Service"]["WorkingDirectory"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "0.1.0"
    assert not (directory / "taken").exists()


def test_no_program_of_ours_starts_python_with_the_working_directory_in_its_path() -> None:
    sources = (Path(__file__).parents[3] / "src/uavrt").rglob("*.py")
    starts = [
        f"{path.name}: {line.strip()}"
        for path in sources
        for line in path.read_text(encoding="utf-8").splitlines()
        if 'sys.executable, "-m"' in line or "sys.executable, '-m'" in line
    ]
    assert starts == []
    # The check sees what it is there to see.
    ran = python("-P", "-c", "import sys; print('' in sys.path)", check=True)
    assert ran.stdout.strip() == "False"


def test_a_version_counts_as_complete_only_after_its_files_are_on_the_disk(
    maker: tuple[Path, str],
    place: Installation,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = update.check(newer(maker, tmp_path), place)
    made = place.version_directory(found.name)
    marked: list[bool] = []
    monkeypatch.setattr(os, "sync", lambda: marked.append((made / COMPLETE).exists()))
    update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert marked == [False, True]


def test_an_update_torn_by_a_power_cut_can_be_installed_again(
    maker: tuple[Path, str], place: Installation, tmp_path: Path
) -> None:
    """Names are there and marked as complete, but their content never came to the disk."""
    found = update.check(newer(maker, tmp_path), place)
    made = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    for path in made.rglob("*.py"):
        path.write_bytes(b"")
    with pytest.raises(UsageError, match="does not start here"):
        update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert versions(place) == ["source"]
    again = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)
    assert again == made
    assert (made / COMPLETE).exists()


@pytest.mark.parametrize("restarts", [True, False])
def test_a_version_that_was_refused_does_not_stay_on_the_disk(
    maker: tuple[Path, str], place: Installation, tmp_path: Path, restarts: bool
) -> None:
    """Unless the service could not be restarted, and may still run from its files."""
    found = update.check(newer(maker, tmp_path), place)
    made = update.install_beside(found, place, config=Path("none.toml"), directory=tmp_path)

    def restart() -> None:
        if not restarts:
            raise UsageError("systemctl restart failed")

    taken = update.exchange(
        made, place, restart=restart, judge=lambda: (Verdict.BAD, "no poses"), say=print
    )
    assert not taken
    assert versions(place) == (["source"] if restarts else sorted([made.name, "source"]))


def test_the_version_of_a_wheel_is_what_was_signed_and_not_its_file_name(
    maker: tuple[Path, str], place: Installation, tmp_path: Path
) -> None:
    old = newer(maker, tmp_path, "0.0.9")
    renamed = old.with_name("uavrt-9.9.9-py3-none-any.whl")
    shutil.copy(old, renamed)
    shutil.copy(f"{old}.sig", f"{renamed}.sig")
    with pytest.raises(FormatError, match=r"does not contain uavrt 9\.9\.9") as caught:
        read_update(renamed, place.keys)
    assert caught.value.remedy
    with pytest.raises(UsageError, match="is not newer than"):
        update.check(old, place)


@pytest.mark.parametrize("left", ["pipe", "directory", "endless link", "NULs"])
def test_whatever_a_service_leaves_as_set_up_conf_the_computer_starts(
    tmp_path: Path, left: str
) -> None:
    root = tmp_path / "root"
    (root / "etc").mkdir(parents=True)
    assert configure(root).returncode == 0
    computer = Started(root, tmp_path)
    wanted = computer.data / "uavrt/set-up.conf"
    if left == "pipe":
        os.mkfifo(wanted)
    elif left == "directory":
        (wanted / "more").mkdir(parents=True)
    elif left == "NULs":
        wanted.write_bytes(b"name=lynx\0-3\n" * 100)
    else:
        wanted.symlink_to("/dev/zero")
    assert computer.start()["name"]
    assert not os.path.lexists(wanted)
