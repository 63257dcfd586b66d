"""The command of reports, as a program of its own."""

import subprocess
import sys

from tests.unit.analysis.conftest import WriteFlight


def test_the_command_writes_both_and_names_them(write_flight: WriteFlight) -> None:
    flight = write_flight(heard=0)
    command = [sys.executable, "-m", "uavrt.cli", "report", str(flight)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"{flight}/report.html", f"{flight}/report.pdf"]
    assert (flight / "report.html").read_text().startswith("<!DOCTYPE html>")
