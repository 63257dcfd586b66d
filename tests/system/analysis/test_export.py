"""The command of exports, as a program of its own."""

import subprocess
import sys

from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.export.written import EXPORT_FORMATS


def test_the_command_writes_what_is_asked_for_and_refuses_what_it_does_not_know(
    write_flight: WriteFlight,
) -> None:
    flight = write_flight()

    def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-m", "uavrt.cli", "export", str(flight), *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)

    done = run("--format", "gpx", "--format", "geojson")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (flight / "export").iterdir()) == [
        "flight.geojson",
        "flight.gpx",
    ]
    refused = run("--format", "shapefile")
    assert refused.returncode == 2
    assert all(form in refused.stderr for form in EXPORT_FORMATS)
