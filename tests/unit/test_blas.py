"""What NumPy's linear algebra is told before it is loaded."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from uavrt.blas import blas_environment
from uavrt.supervisor.tree.launcher import Launcher

WIDE = "processor : 0\nflags\t\t: fpu sse2 avx2 avx512f avx512cd avx512bw avx512dq avx512vl\n"


def test_a_processor_with_wide_vectors_gets_the_kernels_for_them(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(WIDE)
    assert blas_environment({}, cpuinfo)["OPENBLAS_CORETYPE"] == "SkylakeX"


def test_a_processor_that_lacks_an_instruction_is_left_to_openblas(
    tmp_path: Path,
) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    for missing in ("avx512f", "avx512cd", "avx512bw", "avx512dq", "avx512vl"):
        cpuinfo.write_text(WIDE.replace(f" {missing}", ""))
        assert "OPENBLAS_CORETYPE" not in blas_environment({}, cpuinfo)
    assert "OPENBLAS_CORETYPE" not in blas_environment({}, tmp_path / "none")


def test_what_the_environment_says_stands(tmp_path: Path) -> None:
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text(WIDE)
    given = {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "2"}
    assert not given.keys() & blas_environment(given, cpuinfo).keys()


def test_processes_of_a_flight_compute_as_the_command_line_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = tuple(blas_environment({}))
    tell = f"import os\nfor name in {names}:\n    print(name, os.environ.get(name))\n"
    (tmp_path / "tell.py").write_text(tell)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    for name in names:
        monkeypatch.delenv(name, raising=False)
    here = subprocess.run(
        [sys.executable, "-c", f"import uavrt.cli.one_thread\n{tell}"],
        capture_output=True,
        check=True,
        text=True,
    ).stdout
    there = tmp_path / "there"
    with there.open("wb") as output:
        pid = Launcher().start(
            "tell", name="tell", output=output.fileno(), fds=(), environment={}
        )
        os.waitpid(pid, 0)
    assert there.read_text() == here
    assert "None" not in here
