"""One script makes an image: its steps in order, each done once, what it needs told at once."""

import os
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from command_line import program
from tests.system.test_image import needs_disk_tools

DEPLOY = Path(__file__).parents[2] / "deploy"
STEPS = {
    "arm64/make-root.sh": 'mkdir -p "$1/root"; said="$COMPONENTS;$PACKAGES"',
    "arm64/install-uavrt.sh": 'said=$(shift; echo "$*")',
    "image/finish-root.sh": "said=",
    "image/configure-root.sh": "said=$2",
    "image/pack.sh": 'echo image >"$2"; said=$(cat "$1/etc/issue" 2>/dev/null || true)',
}
WHOLE = ["make-root", "install-uavrt", "finish-root", "configure-root", "pack"]
LAST = ["configure-root", "pack"]

pytestmark = [
    needs_disk_tools,
    pytest.mark.skipif(shutil.which("apt-get") is None, reason="needs apt"),
]


class Builder:
    """build.sh beside stand-ins of the steps that it calls."""

    def __init__(self, place: Path) -> None:
        self.place, self.source = place, place / "source"
        self.image, self.work = place / "uavrt.img", place / "work"
        self.told = place / "told"
        shutil.copytree(DEPLOY, self.source / "deploy")
        for name in STEPS:
            self.spoil(name, "true")
        self.allow("exit 0")
        self.git("init", "-q")
        for name in ("src/a.py", "native/k.c", "page/p.ts", "pyproject.toml", "hatch_build.py"):
            (self.source / name).parent.mkdir(parents=True, exist_ok=True)
            (self.source / name).write_text("1\n")
        self.git("add", "-A")

    def git(self, *words: str) -> None:
        subprocess.run(["git", "-C", str(self.source), *words], check=True)

    def allow(self, text: str) -> None:
        (self.source / "deploy/arm64/enter.sh").write_text(f"#!/bin/sh\n{text}\n")

    def spoil(self, name: str, end: str) -> None:
        """Let a step end otherwise, untouched as far as its sum goes."""
        path = self.source / "deploy" / name
        stand_in = self.place / path.name
        stand_in.write_text(
            f'#!/bin/sh\nset -e\nif [ "$1" = --emulator ]; then exit; fi\n{STEPS[name]}\n'
            f'echo "{path.stem}:$said" >>{self.told}\n{end}\n'
        )
        stand_in.chmod(0o755)
        path.write_text(f'#!/bin/sh\nexec {stand_in} "$@"\n')

    def run(self, *words: str, components: str = "") -> "subprocess.CompletedProcess[str]":
        self.told.write_text("")
        script = str(self.source / "deploy/image/build.sh")
        return program(
            script,
            "--directory",
            self.work,
            *words,
            self.image,
            env=os.environ | {"PYTHON": "python3", "COMPONENTS": components},
        )

    def lines(self) -> list[str]:
        return self.told.read_text().splitlines()

    def steps(self) -> list[str]:
        return [line.split(":")[0] for line in self.lines()]


@pytest.fixture
def builder(tmp_path: Path) -> Builder:
    return Builder(tmp_path)


def make_root(place: Path) -> Path:
    """A root with all that it needs, as far as the files say."""
    root = place / "debian"
    for name in ("etc", "usr/bin", "var/lib/dpkg", "boot", "dev"):
        (root / name).mkdir(parents=True)
    (root / "etc/issue").write_text("of somebody")
    (root / "dev/null").write_text("no device")
    (root / "boot/vmlinuz-6.6-rpi-v8").touch()
    (root / "usr/bin/python3.11").write_bytes(b"\x7fELF".ljust(18, b"\0") + b"\xb7\0")
    listed = [
        *(DEPLOY / "arm64").glob("packages.txt"),
        *(DEPLOY / "image").glob("packages.txt"),
    ]
    names = [line for path in listed for line in path.read_text().splitlines()]
    (root / "var/lib/dpkg/status").write_text(
        "".join(
            f"Package: {name}\nStatus: install ok installed\nVersion: 1\n\n"
            for name in names
            if name and not name.startswith(("#", "linux-image"))
        )
    )
    return root


def test_one_call_runs_the_steps_in_order(builder: Builder) -> None:
    key = builder.place / "keys.pem"
    key.write_text("key")
    done = builder.run("--name", "lynx-1", "--update-key", str(key), "--ros2")
    assert done.returncode == 0, done.stderr
    assert builder.steps() == WHOLE
    root, uavrt, _, settings, _ = builder.lines()
    assert root.startswith("make-root:main;")
    assert "linux-image-arm64" in root
    assert "firmware" not in root
    assert uavrt == f"install-uavrt:--ros2 --update-key {key}"
    assert settings == "configure-root:lynx-1"
    assert builder.image.read_text() == "image\n"


def test_the_firmware_of_wifi_chips_comes_from_where_debian_has_it(builder: Builder) -> None:
    assert builder.run("--wifi", "--packages", "gpsd").returncode == 0
    root = builder.lines()[0]
    assert root.startswith("make-root:main non-free-firmware;")
    assert {"firmware-brcm80211", "firmware-realtek", "gpsd"} <= set(root.split())
    alone = builder.run("--packages", "firmware-realtek", components="main non-free-firmware")
    assert alone.returncode == 0
    root = builder.lines()[0]
    assert root.startswith("make-root:main non-free-firmware;")
    assert "brcm" not in root


def test_a_run_that_was_stopped_goes_on_where_it_was(builder: Builder) -> None:
    builder.spoil("image/finish-root.sh", "exit 7")
    assert builder.run().returncode == 7
    assert not builder.image.exists()
    builder.spoil("image/finish-root.sh", "true")
    assert builder.run().returncode == 0
    assert builder.steps() == ["finish-root", *LAST]
    assert builder.run().returncode == 0
    assert builder.steps() == LAST
    assert builder.run("--anew").returncode == 0
    assert builder.steps() == WHOLE


def test_a_change_is_built_and_all_that_comes_after_it(builder: Builder) -> None:
    assert builder.run().returncode == 0
    (builder.source / "src/a.py").write_text("2\n")
    builder.spoil("arm64/install-uavrt.sh", "exit 1")
    assert builder.run().returncode == 1
    # As it was again: but half of another one may be in the root by now.
    (builder.source / "src/a.py").write_text("1\n")
    builder.spoil("arm64/install-uavrt.sh", "true")
    assert builder.run().returncode == 0
    assert builder.steps() == WHOLE[1:]
    assert builder.run("--packages", "gpsd").returncode == 0
    assert builder.steps() == WHOLE


@pytest.mark.parametrize("packed", [False, True])
def test_a_root_that_is_there_is_taken_as_directory_or_tar(
    builder: Builder, packed: bool
) -> None:
    given = root = make_root(builder.place)
    if packed:
        given = builder.place / "debian.tar.xz"
        with tarfile.open(given, "w:xz") as whole:
            whole.add(root, ".")
    done = builder.run("--from", str(given))
    assert done.returncode == 0, done.stderr
    assert builder.steps() == WHOLE[1:]
    assert builder.lines()[-1] == "pack:of somebody"
    assert not (builder.work / "root/dev/null").exists()
    assert (root / "etc/issue").exists()
    assert builder.run("--from", str(given)).returncode == 0
    assert builder.steps() == LAST


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        ("usr/bin/python3.11", "no Python 3.11"),
        ("boot/vmlinuz-6.6-rpi-v8", "no kernel"),
        ("var/lib/dpkg/status", "no Debian"),
        ("processor", "not for 64-bit ARM"),
        ("packages", "sudo apt install avahi-daemon"),
    ],
)
def test_a_root_that_cannot_do_is_refused_with_what_it_lacks(
    builder: Builder, spoilt: str, said: str
) -> None:
    root = make_root(builder.place)
    if spoilt == "processor":
        (root / "usr/bin/python3.11").write_bytes(b"\x7fELF".ljust(18, b"\0") + b"\x3e\0")
    elif spoilt == "packages":
        status = root / "var/lib/dpkg/status"
        gone = "Package: avahi-daemon\nStatus: "
        removed = (f"{gone}install ok installed", f"{gone}deinstall ok config-files")
        status.write_text(status.read_text().replace(*removed))
    else:
        (root / spoilt).unlink()
    refused = builder.run("--from", str(root))
    assert refused.returncode == 1
    assert said in refused.stderr
    assert builder.steps() == []
    assert builder.run("--from", str(root)).returncode == 1  # nor is half of it taken later


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--what", "x"], "unknown option --what"),
        (["another.img"], "two images"),
        (["--update-key", "none.pem"], "no file none.pem"),
        (["--from", "nowhere"], "no nowhere"),
        (["--from", "/", "--wifi"], "are for a new Debian"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_fetched(
    builder: Builder, words: list[str], said: str
) -> None:
    refused = builder.run(*words)
    assert refused.returncode == 1
    assert said in refused.stderr
    assert builder.steps() == []


def test_where_no_emulator_may_run_it_says_so_first(builder: Builder) -> None:
    builder.allow('echo "this kernel lets no user" >&2; exit 3')
    refused = builder.run()
    assert refused.returncode == 1
    assert "the emulator cannot run here: this kernel lets no user" in refused.stderr
    assert builder.steps() == []


def test_its_help_tells_every_option() -> None:
    script = DEPLOY / "image/build.sh"
    told = program(script, "--help", check=True)
    options = {
        word.split(")")[0]
        for line in script.read_text().splitlines()
        for word in line.split()
        if word.startswith("--") and word.endswith(")")
    }
    assert {"--from", "--wifi", "--anew"} <= options
    assert [option for option in options if f" {option} " not in told.stdout + " --help "] == []
