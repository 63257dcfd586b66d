"""A mistaken method is told once by the command itself."""

import subprocess
import sys
from pathlib import Path

import pytest
from tests.unit.analysis.test_bearings import flown
from tests.unit.analysis.test_tags_of_several_logs import as_log


@pytest.mark.parametrize("command", ["localize", "bearing"])
def test_a_method_that_does_not_exist_is_an_error_once(tmp_path: Path, command: str) -> None:
    path = as_log(tmp_path / "flight.jsonl", flown().pulse_poses)
    given = [sys.executable, "-m", "uavrt.cli", command, str(path), "--method", "guess"]
    finished = subprocess.run(given, capture_output=True, text=True, check=False)
    assert finished.returncode == 2
    assert (finished.stdout + finished.stderr).count("no method") == 1
    assert "Choose from" in finished.stderr
