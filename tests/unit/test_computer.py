"""Unit, udev rule and doctor, below another root and without hardware."""

import configparser
import re
from dataclasses import replace
from pathlib import Path

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from virtual_time import VirtualClock

from uavrt.cli.app import app
from uavrt.config.settings import MavlinkSettings, RadioSettings, RecordingSettings, Settings
from uavrt.core.messages import ProcessStatus
from uavrt.drone.computer import computer_checks as checks
from uavrt.drone.computer.service import (
    RULE_PATH,
    UNIT_PATH,
    WANTED_PATH,
    ServicePlan,
    install,
    remove,
    rule_text,
    status,
    unit_text,
)

PLAN = ServicePlan(
    program=Path("/opt/uavrt/.venv/bin/uavrt"), user="pi", directory=Path("/home/pi")
)


def files_below(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): str(path.readlink())
        if path.is_symlink()
        else path.read_text()
        for path in root.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def test_the_service_starts_at_boot_with_readiness_and_watchdog(tmp_path: Path) -> None:
    install(PLAN, tmp_path)
    unit = (tmp_path / UNIT_PATH).read_text()
    for line in (
        "Type=notify",
        "WatchdogSec=15",
        "Restart=always",
        "User=pi",
        "WorkingDirectory=/home/pi",
        "ExecStart=/opt/uavrt/.venv/bin/uavrt run",
    ):
        assert line in unit.splitlines()
    assert (tmp_path / WANTED_PATH).readlink() == Path("/") / UNIT_PATH
    rule = (tmp_path / RULE_PATH).read_text()
    assert (
        'ATTR{idVendor}=="1d50", ATTR{idProduct}=="60a1", MODE="0660", GROUP="plugdev"' in rule
    )


def test_installing_twice_changes_nothing_but_what_the_plan_does(tmp_path: Path) -> None:
    install(PLAN, tmp_path)
    first = files_below(tmp_path)
    said = install(PLAN, tmp_path)
    assert files_below(tmp_path) == first
    assert not [line for line in said if line.startswith("wrote")]
    install(replace(PLAN, user="drone"), tmp_path)
    assert "User=drone" in (tmp_path / UNIT_PATH).read_text()


def test_removing_leaves_nothing_and_may_be_repeated(tmp_path: Path) -> None:
    install(PLAN, tmp_path)
    remove(tmp_path)
    assert files_below(tmp_path) == {}
    assert remove(tmp_path) == []
    assert "not installed" in status(tmp_path)[0]


@given(st.text("abc/ %$\"'\\äö", min_size=1, max_size=30))
def test_no_path_breaks_out_of_its_place_in_the_unit(name: str) -> None:
    plan = replace(PLAN, config=Path("/etc") / name)
    line = next(x for x in unit_text(plan).splitlines() if x.startswith("ExecStart="))
    assert line.count("--config") == 1
    assert unit_text(plan).count("\n") == unit_text(PLAN).count("\n")
    unescaped = line.replace("%%", "").replace("$$", "")
    assert "%" not in unescaped
    assert "$" not in unescaped


def test_the_unit_has_the_form_of_a_unit_and_no_key_twice() -> None:
    # These two are lists, which systemd adds up.
    lists = re.compile(r"^(DeviceAllow|SystemCallFilter)=.*\n", re.MULTILINE)
    parser = configparser.ConfigParser(interpolation=None, strict=True)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read_string(lists.sub("", unit_text(PLAN)))
    assert parser.sections() == ["Unit", "Service", "Install"]
    assert parser["Unit"]["StartLimitIntervalSec"] == "0"
    assert parser["Service"]["WatchdogSignal"] == "SIGKILL"


def test_radios_and_serial_ports_stay_open_to_a_confined_service() -> None:
    lines = unit_text(PLAN).splitlines()
    for kind in ("usb_device", "ttyUSB", "ttyACM", "ttyAMA", "ttyS"):
        assert f"DeviceAllow=char-{kind} rw" in lines
    assert "SupplementaryGroups=dialout plugdev" in lines
    assert "PrivateDevices=yes" not in lines


@pytest.mark.parametrize(
    ("changes", "access"),
    [
        ({"directory": Path("/var/lib/uavrt")}, "yes"),
        ({"directory": Path("/home/pi/flights")}, "read-only"),
        (
            {"directory": Path("/var/lib/uavrt"), "program": Path("/home/pi/.venv/bin/uavrt")},
            "read-only",
        ),
    ],
)
def test_home_directories_are_closed_unless_the_service_lives_in_one(
    changes: dict[str, Path], access: str
) -> None:
    lines = unit_text(replace(PLAN, **changes)).splitlines()  # type: ignore[arg-type]
    assert f"ProtectHome={access}" in lines


def test_what_the_settings_name_for_writing_stays_writable(tmp_path: Path) -> None:
    place = tmp_path / "var/lib/uavrt"
    place.mkdir(parents=True)
    (place / "uavrt.toml").write_text(
        '[recording]\ndirectory = "/data/flights 1"\nsave_directory = "/mnt/stick"\n'
    )
    app(
        [
            *("service", "install", "--user", "pi", "--directory", "/var/lib/uavrt"),
            *("--root", str(tmp_path)),
        ],
        result_action="return_value",
    )
    unit = (tmp_path / UNIT_PATH).read_text()
    assert (
        'ReadWritePaths=-/var/lib/uavrt "-/data/flights 1" -/mnt/stick -/media -/run/media\n'
        in unit
    )


def test_the_rule_names_every_radio_once() -> None:
    lines = [line for line in rule_text().splitlines() if line.startswith("SUBSYSTEM")]
    assert len(lines) == len(set(lines)) == 6


def test_the_command_line_installs_below_a_root(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "srv").mkdir()
    place = ("--user", "pi", "--directory", "/srv")
    app(["service", "install", *place, "--root", str(tmp_path)], result_action="return_value")
    app(["service", "status", "--root", str(tmp_path)], result_action="return_value")
    assert "at boot yes" in capsys.readouterr().out


# -------------------------------------------------------------------------- doctor


def bench_settings(directory: Path) -> Settings:
    return Settings(
        radio=RadioSettings(kind="airspy", program=("stand-in",)),
        mavlink=MavlinkSettings(address=""),
        recording=RecordingSettings(directory=str(directory), minimum_free_mb=0.0),
    )


def test_a_missing_radio_names_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    finding = checks.check_radio(Settings(), None)
    assert not finding.ok
    assert finding.remedy == "Install the program: sudo apt install airspy"


def test_a_missing_serial_port_is_told_by_name(tmp_path: Path) -> None:
    port = tmp_path / "ttyUSB7"
    settings = Settings(mavlink=MavlinkSettings(address=f"serial://{port}:57600"))
    finding = checks.check_permissions(settings)
    assert not finding.ok
    assert str(port) in finding.text


def test_silence_at_the_autopilots_port_is_a_fault() -> None:
    settings = Settings(mavlink=MavlinkSettings(address="udpin://127.0.0.1:0"))
    finding = checks.check_autopilot(settings, None)
    assert not finding.ok
    assert "no message from the autopilot" in finding.text


def test_a_lost_clock_is_a_fault(clock_of_test: VirtualClock) -> None:
    clock_of_test.set_wall_ns(86_400 * 10**9)
    assert not checks.check_clock().ok


def test_a_full_disk_is_a_fault(tmp_path: Path) -> None:
    recording = RecordingSettings(directory=str(tmp_path / "new"), minimum_free_mb=1e12)
    finding = checks.check_disk(Settings(recording=recording))
    assert not finding.ok
    assert "Make room" in finding.remedy


def test_a_hot_processor_is_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    zone = tmp_path / "thermal_zone0"
    zone.mkdir()
    monkeypatch.setattr(checks, "THERMAL", tmp_path)
    (zone / "temp").write_text("79000\n")
    assert checks.check_temperature().ok
    (zone / "temp").write_text("81000\n")
    assert not checks.check_temperature().ok


def test_a_running_system_is_asked_instead_of_its_radio_and_port(tmp_path: Path) -> None:
    def process(name: str, word: str) -> ProcessStatus:
        return made.process_status(name, word)

    running = made.system_status(
        0, processes=(process("receiver", "receiving"), process("connection", "ready"))
    )
    assert checks.check_radio(Settings(), running).ok
    assert checks.check_autopilot(Settings(), running).ok
