"""The unit as systemd examines it."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from tests.unit.test_computer import PLAN

from uavrt.computer.service import unit_text


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")
def test_systemd_finds_the_unit_well_confined_and_without_faults(tmp_path: Path) -> None:
    unit = tmp_path / "uavrt.service"
    plan = replace(PLAN, program=Path("/bin/true"), user="root", directory=Path("/var/lib"))
    unit.write_text(unit_text(plan))
    exposure = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--threshold=30", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert exposure.returncode == 0, exposure.stdout[-200:] + exposure.stderr
    verified = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "uavrt.service" not in verified.stderr, verified.stderr
