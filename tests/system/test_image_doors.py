"""How one comes into a computer made from the image: what its screen says, and by ssh."""

import os
import subprocess
from pathlib import Path

import pytest

from uavrt.cli.computer import update as command
from uavrt.config.loader import write_default_settings
from uavrt.drone.computer.first_setup import FirstSetup

CONFIGURE = Path(__file__).parents[2] / "deploy/image/configure-root.sh"
KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIEaKyE+4fVp0Z3mB0xwPq1nQ7aBcDeFgHiJkLmNoPqRs tom@hut"


class Computer:
    """One that starts again and again; its programs are stand-ins where root is needed."""

    def __init__(self, place: Path) -> None:
        self.root, self.data, tools = place / "root", place / "data", place / "tools"
        for directory in (self.root / "etc", self.data / "uavrt", tools):
            directory.mkdir(parents=True)
        subprocess.run([str(CONFIGURE), str(self.root)], check=True)
        (tools / "runuser").write_text('#!/bin/sh\nshift 3\nexec "$@"\n')
        (tools / "runuser").chmod(0o755)
        segno = self.data / "opt/venv/bin/segno"
        segno.parent.mkdir(parents=True)
        segno.write_text('#!/bin/sh\necho "QR $2"\n')
        segno.chmod(0o755)
        self._path = f"{tools}:{os.environ['PATH']}"
        self.screen = place / "issue"
        write_default_settings(self.data / "uavrt/uavrt.toml")
        self.setup = FirstSetup(self.data / "uavrt/uavrt.toml")

    def start(self) -> None:
        script = str(self.root / "usr/local/sbin/uavrt-identity")
        words = ["sh", script, str(self.data), str(self.screen)]
        subprocess.run(words, check=True, env=os.environ | {"PATH": self._path})

    def login(self) -> str | None:
        path = self.data / "ssh/authorized_keys"
        return path.read_text() if path.exists() else None


@pytest.fixture
def computer(tmp_path: Path) -> Computer:
    return Computer(tmp_path)


def test_a_screen_says_how_to_join_until_the_computer_is_set_up(computer: Computer) -> None:
    computer.start()
    told = computer.screen.read_text()
    assert (computer.data / "access-point.txt").read_text() in told
    assert "QR WIFI:T:WPA;S:uavrt-" in told
    (computer.data / "uavrt/set-up-done").touch()
    computer.start()
    assert not computer.screen.exists()


def test_who_gave_a_key_in_the_set_up_may_log_in(computer: Computer) -> None:
    computer.start()
    assert computer.login() is None
    assert not computer.setup.save_step("keys", {"ssh_key": f"  {KEY}\n"})
    computer.start()
    assert computer.login() == f"{KEY}\n"
    assert not computer.setup.save_step("keys", {"page_password": "marmot-2026"})
    computer.start()
    assert computer.login() == f"{KEY}\n"
    sshd = (computer.root / "etc/ssh/sshd_config.d/uavrt.conf").read_text()
    assert "PasswordAuthentication no" in sshd


def test_a_service_that_was_broken_into_lets_nobody_in_after_the_first(
    computer: Computer,
) -> None:
    """Who logs in becomes root without a password."""
    assert not computer.setup.save_step("keys", {"ssh_key": KEY})
    computer.start()
    other = KEY.replace("A", "B")
    assert [one.field for one in computer.setup.save_step("keys", {"ssh_key": other})] == [
        "ssh_key"
    ]
    (computer.data / "uavrt/set-up.conf").write_text(f"ssh_key={other}\n")
    computer.start()
    assert computer.login() == f"{KEY}\n"


@pytest.mark.parametrize(
    "given",
    [
        f'command="reboot" {KEY}',
        KEY.replace("ed25519", "dss", 1),
        "ssh-ed25519 short",
        f"{KEY} and more",
        "-----BEGIN OPENSSH PRIVATE KEY-----",
    ],
)
def test_a_key_that_is_none_is_refused_by_page_and_by_root(
    computer: Computer, given: str
) -> None:
    assert [one.field for one in computer.setup.save_step("keys", {"ssh_key": given})] == [
        "ssh_key"
    ]
    (computer.data / "uavrt/set-up.conf").write_text(f"ssh_key={given}\n")
    computer.start()
    assert computer.login() is None


@pytest.mark.parametrize("restart", [command.RESTART, "true"])
def test_an_update_also_restarts_the_page_beside_the_service(
    restart: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files are those of the version before, which go when the new one is taken."""
    told = tmp_path / "told"
    (tmp_path / "systemctl").write_text(f'#!/bin/sh\necho "$@" >>{told}\n')
    (tmp_path / "systemctl").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    command._restart(restart)
    lines = told.read_text().splitlines() if told.exists() else []
    usual = ["restart uavrt.service", "try-restart uavrt-page.service"]
    assert lines == (usual if restart == command.RESTART else [])
