"""What NumPy's linear algebra is told, as a process finds it."""

import os
from pathlib import Path

import pytest
from command_line import python

from uavrt.core.runtime.blas import blas_environment
from uavrt.drone.supervisor.start.launcher import Launcher


def test_processes_of_a_flight_compute_as_the_command_line_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = tuple(blas_environment({}))
    tell = f"import os\nfor name in {names}:\n    print(name, os.environ.get(name))\n"
    (tmp_path / "tell.py").write_text(tell)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    for name in names:
        monkeypatch.delenv(name, raising=False)
    here = python("-c", f"import uavrt.cli.shown.one_thread\n{tell}", check=True).stdout
    there = tmp_path / "there"
    with there.open("wb") as output:
        pid = Launcher().start(
            "tell", name="tell", output=output.fileno(), fds=(), environment={}
        )
        os.waitpid(pid, 0)
    assert there.read_text() == here
    assert "None" not in here
