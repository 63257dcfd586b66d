"""A service that cannot start, or that would lose what it records, is refused."""

from pathlib import Path

import pytest
from command_line import uavrt

from uavrt.cli.computer import service
from uavrt.drone.computer.service import UNIT_PATH, ServicePlan, unit_text, update_unit_text


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """The root of a system with one user and one directory."""
    (tmp_path / "etc").mkdir()
    (tmp_path / "etc/passwd").write_text("pi:x:1000:1000::/home/pi:/bin/sh\n")
    for place in ("home/pi/100 % sure", "tmp/flights"):
        (tmp_path / place).mkdir(parents=True)
    return tmp_path


@pytest.mark.parametrize(
    ("user", "directory", "says"),
    [
        ("nobody-there", "/home/pi", "there is no user nobody-there"),
        ("pi", "/home/gone", "there is no directory /home/gone"),
        ("pi", "/tmp/flights", "emptied at boot"),
    ],
)
def test_a_service_that_cannot_start_is_refused(
    system: Path, user: str, directory: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    place = ("--user", user, "--directory", directory)
    assert uavrt("service", "install", *place, "--root", str(system)) == 2
    assert says in capsys.readouterr().err
    assert not (system / UNIT_PATH).exists()


def test_root_is_not_the_service_unless_it_is_named(
    system: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(service, "SERVICE_USER", "no-such-user-here")
    monkeypatch.setenv("SUDO_USER", "root")
    place = ("--directory", "/home/pi", "--root", str(system))
    assert uavrt("service", "install", *place) == 2
    assert "would run as root. Give --user" in capsys.readouterr().err
    (system / "etc/passwd").write_text("root:x:0:0::/root:/bin/sh\n")
    assert uavrt("service", "install", *place, "--user", "root") == 0
    assert "User=root" in (system / UNIT_PATH).read_text().splitlines()


def test_a_percent_sign_in_a_path_is_no_specifier() -> None:
    directory = Path("/home/pi/100 % sure")
    plan = ServicePlan(program=Path("/opt/uavrt"), user="pi", directory=directory)
    for text in (unit_text(plan), update_unit_text(plan, Path("/opt"))):
        assert "WorkingDirectory=/home/pi/100 %% sure" in text.splitlines()
