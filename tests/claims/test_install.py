"""From nothing to a service, twice; and every dependency of the drone for its processor."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import command_line
import pytest
from command_line import program

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """The files of the repository as they are now, where nobody edits them meanwhile."""
    copy = tmp_path / "source"
    places = ("src", "deploy", "*.toml", "*.py", "*.md")
    tracked = program("git", "-C", ROOT, "ls-files", "-z", *places, check=True).stdout
    for name in [*filter(None, tracked.split("\0")), "LICENSE"]:
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy / name)
    return copy


def files_below(root: Path) -> dict[str, int]:
    return {
        str(path.relative_to(root)): path.stat(follow_symlinks=False).st_mtime_ns
        for path in root.rglob("*")
        if not path.is_dir() and "__pycache__" not in path.parts
    }


def test_the_script_installs_below_a_root_and_a_second_run_changes_nothing(
    tmp_path: Path, source: Path
) -> None:
    root, home = tmp_path / "root", tmp_path / "home"
    home.mkdir()
    (home / "release.pem").write_text("a key")
    for module in ("pip", "venv", "sysconfig", "msgspec"):
        # Root may be in a directory of the service's user, who puts what he likes there.
        (home / f"{module}.py").write_text("raise SystemExit('taken from where it is called')")

    def run() -> "subprocess.CompletedProcess[str]":
        return program(
            *(source / "deploy/install.sh", "--root", root, "--user", "pi"),
            *("--update-key", "release.pem"),
            cwd=home,
            # Bytecode of all libraries takes half a minute, and is made when one is imported.
            env=os.environ | {"PYTHON": sys.executable, "PIP_COMPILE": "0"},
        )

    first = run()
    assert first.returncode == 0, first.stderr
    unit = (root / "etc/systemd/system/uavrt.service").read_text()
    assert "User=pi" in unit
    assert "WorkingDirectory=/var/lib/uavrt" in unit
    assert (root / "etc/udev/rules.d/60-uavrt.rules").exists()
    assert (root / "var/lib/uavrt/uavrt.toml").exists()
    program = root / "opt/uavrt/venv/bin/uavrt"
    assert str(program) in unit
    command = root / "usr/local/bin/uavrt"
    version = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert version.stdout.strip()
    assert (root / "opt/uavrt/update-keys.pem").read_text() == "a key"
    before = files_below(root)
    second = run()
    assert second.returncode == 0, second.stderr
    assert "the program is up to date" in second.stdout
    assert files_below(root) == before


@pytest.mark.parametrize("arguments", [["--radio", "crystal"], ["--what", "x"], ["--user"]])
def test_the_script_refuses_what_it_does_not_know(arguments: list[str]) -> None:
    refused = command_line.program(ROOT / "deploy/install.sh", *arguments)
    assert refused.returncode == 1
    assert refused.stderr.startswith("uavrt: ")


def test_the_script_is_plain_sh() -> None:
    subprocess.run(["sh", "-n", str(ROOT / "deploy/install.sh")], check=True)


@pytest.mark.parametrize("python", ["311", "312", "313"])
def test_every_dependency_of_the_drone_has_a_wheel_for_its_processor(python: str) -> None:
    resolved = command_line.python(
        *("-m", "pip", "install", "--dry-run", "--quiet"),
        *("--only-binary=:all:", "--target", "unused", "--python-version", python),
        *("--implementation", "cp", "--platform", "manylinux_2_28_aarch64"),
        *("--platform", "manylinux_2_17_aarch64", "--platform", "manylinux2014_aarch64"),
        *("--disable-pip-version-check", "--ignore-installed"),
        *("--require-hashes", "-r", ROOT / "deploy/locks/drone-page.txt"),
    )
    assert resolved.returncode == 0, resolved.stderr
