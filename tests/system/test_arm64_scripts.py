"""The trial on 64-bit ARM fails where something is wrong; it skips where it may not run."""

import os
import shutil
import stat
import subprocess
from pathlib import Path

import pytest
from command_line import program

ROOT = Path(__file__).parents[2]
ARM64 = ROOT / "deploy/arm64"
NOT_ALLOWED = 77
KEYS = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
NO_WHEEL = "ERROR: No matching distribution found for numpy==2.3.5"

pytestmark = pytest.mark.skipif(
    shutil.which("dpkg-deb") is None, reason="the scripts are for Debian's packages"
)


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


class Trial:
    """short.sh with a stand-in for each thing that comes from elsewhere."""

    def __init__(self, place: Path) -> None:
        self.source, self.work, self.tools = (
            place / name for name in ("source", "work", "tools")
        )
        here = self.source / "deploy/arm64"
        here.mkdir(parents=True)
        shutil.copy(ARM64 / "short.sh", here)
        self.enter = here / "enter.sh"
        self.make_root = here / "make-root.sh"
        self.python = self.tools / "python"
        self.lock = self.source / "deploy/locks/drone.txt"
        self.lock.parent.mkdir()
        self.lock.write_text("numpy==2.3.5\n")
        script(self.enter, "case $1 in --allowed) exit 0 ;; *) echo aarch64 ;; esac")
        script(self.make_root, 'mkdir -p "$1/root"; cp /bin/true "$1/qemu-aarch64-static"')
        script(self.tools / "aarch64-linux-gnu-gcc", "exit 0")
        script(self.tools / "apt-get", "exit 100")
        self.pip = place / "pip"
        self.pip_says("exit 0")
        subprocess.run(["git", "init", "-q", str(self.source)], check=True)
        subprocess.run(["git", "-C", str(self.source), "add", "-A"], check=True)

    def pip_says(self, text: str) -> None:
        script(
            self.python,
            f"""case "$*" in
    *hatchling*) mkdir -p "{self.work}/wheel"; : >"{self.work}/wheel/uavrt.whl" ;;
    *require-hashes*) echo fetched >>{self.pip}; {text} ;;
    *checks.py*) echo "ok kernels" ;;
esac""",
        )

    def run(self) -> "subprocess.CompletedProcess[str]":
        return program(
            self.source / "deploy/arm64/short.sh",
            self.work,
            env={"PATH": f"{self.tools}:{os.environ['PATH']}", "PYTHON": str(self.python)},
        )

    def fetches(self) -> int:
        return len(self.pip.read_text().splitlines())


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    return Trial(tmp_path)


def test_it_skips_where_the_kernel_allows_no_emulation(trial: Trial) -> None:
    script(trial.enter, 'echo "this kernel lets no user" >&2; exit 3')
    script(trial.make_root, "exit 1")  # nothing is fetched first
    skipped = trial.run()
    assert skipped.returncode == NOT_ALLOWED
    assert "this kernel lets no user" in skipped.stdout


@pytest.mark.parametrize(
    ("spoilt", "remedy"),
    [
        ("wheels", "make locks"),
        ("packages", "MIRROR"),
        ("emulator", "apt install qemu-user-static"),
        ("crash", "the emulator does not run"),
        ("compiler", "apt install gcc-aarch64-linux-gnu"),
    ],
)
def test_what_is_missing_is_a_failure_that_names_the_remedy(
    trial: Trial, spoilt: str, remedy: str
) -> None:
    if spoilt == "wheels":
        trial.pip_says(f"echo '{NO_WHEEL}' >&2; exit 1")
    elif spoilt == "packages":
        script(trial.make_root, 'echo "is the network there, and MIRROR right?" >&2; exit 1')
    elif spoilt == "emulator":
        script(trial.make_root, "exit 0")
    elif spoilt == "crash":
        script(trial.enter, "[ $1 = --allowed ] || { echo 'Exec format error' >&2; exit 126; }")
    elif shutil.which("aarch64-linux-gnu-gcc"):
        pytest.skip("this computer has the compiler")
    else:
        (trial.tools / "aarch64-linux-gnu-gcc").unlink()
    failed = trial.run()
    assert failed.returncode not in (0, NOT_ALLOWED)
    assert remedy in failed.stderr
    if spoilt == "wheels":
        assert NO_WHEEL in failed.stderr


def test_wheels_are_fetched_once_and_again_when_the_lock_has_changed(trial: Trial) -> None:
    for _ in range(2):
        done = trial.run()
        assert done.returncode == 0, done.stderr
    assert trial.fetches() == 1
    trial.lock.write_text("numpy==2.3.6\n")
    assert trial.run().returncode == 0
    assert trial.fetches() == 2


def test_a_fetch_that_failed_is_tried_again(trial: Trial) -> None:
    trial.pip_says("exit 1")
    assert trial.run().returncode == 1
    trial.pip_says("exit 0")
    assert trial.run().returncode == 0


def test_another_list_of_packages_makes_another_root(tmp_path: Path) -> None:
    """A root that is there already stays only as long as the same packages are wanted."""
    if not KEYS.exists():
        pytest.skip(f"no {KEYS}")
    work, tools = tmp_path / "work", tmp_path / "tools"
    script(
        tools / "apt-get",
        f"""[ $1 = install ] || exit 0
for name; do case $name in lynx | otter)
    place={tmp_path}/$name
    mkdir -p $place/DEBIAN $place/usr/share/$name
    printf '%s\\n' "Package: $name" "Version: 1" "Architecture: all" "Maintainer: x <x@y>" \\
        "Description: x" >$place/DEBIAN/control
    dpkg-deb -b $place {work}/apt/cache/archives/$name.deb >/dev/null
;; esac; done""",
    )
    script(tools / "qemu-aarch64-static", "")
    nothing = tmp_path / "none.txt"
    nothing.write_text("# none\n")
    for name in ("passwd", "group"):
        master = tmp_path / f"lynx/usr/share/base-passwd/{name}.master"
        master.parent.mkdir(parents=True, exist_ok=True)
        master.write_text("root:x:0:\n")
    (tmp_path / "lynx/etc").mkdir()
    shutil.copytree(tmp_path / "lynx", tmp_path / "otter")

    def make(packages: str) -> set[str]:
        given = {"LIST": str(nothing), "PACKAGES": packages}
        given["PATH"] = f"{tools}:{os.environ['PATH']}"
        subprocess.run([str(ARM64 / "make-root.sh"), str(work)], check=True, env=given)
        return {path.name for path in (work / "root/usr/share").iterdir()} - {"base-passwd"}

    assert make("lynx") == {"lynx"}
    kept = work / "root/kept"
    kept.touch()
    assert make("lynx") == {"lynx"}
    assert kept.exists()
    assert make("lynx otter") == {"lynx", "otter"}
    assert not kept.exists()


def test_what_the_installer_needs_is_fetched_again_when_a_lock_has_changed(
    tmp_path: Path,
) -> None:
    """Also what only ROS 2 needs, when it is asked for after all else is there."""
    source, work, told = tmp_path / "source", tmp_path / "work", tmp_path / "told"
    shutil.copytree(ROOT / "deploy", source / "deploy")
    script(source / "deploy/arm64/enter.sh", "exit 0")
    script(source / "deploy/dds-wheel.sh", 'touch "$2"')
    script(tmp_path / "python", f'for word; do last=$word; done; basename "$last" >>{told}')
    (source / "README.md").write_text("1")
    subprocess.run(["git", "init", "-q", str(source)], check=True)
    subprocess.run(["git", "-C", str(source), "add", "README.md"], check=True)
    (work / "root").mkdir(parents=True)

    def fetched(*words: str) -> list[str]:
        told.write_text("")
        subprocess.run(
            [str(source / "deploy/arm64/install-uavrt.sh"), str(work), *words],
            check=True,
            env=os.environ | {"PYTHON": str(tmp_path / "python")},
        )
        return told.read_text().split()

    assert fetched() == ["drone-page.txt", "build.txt"]
    assert fetched("--ros2") == ["dds-build.txt", "dds.txt"]
    assert fetched("--ros2") == []
    with (source / "deploy/locks/build.txt").open("a") as lock:
        lock.write("# other\n")
    assert fetched() == ["drone-page.txt", "build.txt"]
