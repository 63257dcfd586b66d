"""The unit as systemd examines it, and this computer as the doctor does."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from command_line import program
from tests.unit.test_computer import PLAN, bench_settings

from uavrt.drone.computer.computer_checks import examine
from uavrt.drone.computer.service import unit_text
from uavrt.simulation.demo.demo_programs import free_udp_port


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_finds_the_unit_well_confined_and_without_faults(tmp_path: Path) -> None:
    unit = tmp_path / "uavrt.service"
    plan = replace(PLAN, program=Path("/bin/true"), user="root", directory=Path("/var/lib"))
    unit.write_text(unit_text(plan))
    exposure = program("systemd-analyze", "security", "--offline=yes", "--threshold=30", unit)
    assert exposure.returncode == 0, exposure.stdout[-200:] + exposure.stderr
    verified = program("systemd-analyze", "verify", "--man=no", unit)
    assert "uavrt.service" not in verified.stderr, verified.stderr


def test_another_link_is_listened_to_where_one_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("uavrt.drone.computer.computer_checks.LISTEN_S", 0.2)
    port = free_udp_port()
    address = f"udpin://127.0.0.1:{port}"
    findings = {f.what: f for f in examine(bench_settings(tmp_path), None, mavlink=address)}
    assert not findings["autopilot"].ok
    assert f"no message from the autopilot arrived at {address}" in findings["autopilot"].text


def test_a_bench_without_autopilot_is_examined_line_by_line(tmp_path: Path) -> None:
    findings = list(examine(bench_settings(tmp_path), None))
    assert [f.what for f in findings] == [
        "radio",
        "permissions",
        "autopilot",
        "clock",
        "disk",
        "card",
        "processor",
        "temperature",
    ]
    for finding in findings:
        assert finding.ok or finding.remedy, finding
