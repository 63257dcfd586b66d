"""The compiled kernels are built, or the remedy is told."""

import importlib.util
import os
import re
import shutil
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from by_path import module_at
from command_line import python
from tests.unit.test_native import ROOT

from uavrt.core.runtime import native


def run_python(*lines: str, pure: str) -> str:
    environment = {**os.environ, "UAVRT_PURE": pure}
    finished = python("-c", "\n".join(lines), env=environment, check=True)
    return finished.stdout.strip()


def test_the_environment_leaves_the_kernels_aside() -> None:
    lines = (
        "from uavrt.core.runtime import native",
        "print(native.kernels(), native.description())",
    )
    assert run_python(*lines, pure="1") == "None NumPy only, because UAVRT_PURE is set"
    there = importlib.util.find_spec("uavrt.core._native") is not None
    assert ("NumPy alone" in run_python(*lines, pure="")) != there


def test_without_a_compiler_nothing_is_left_and_the_remedy_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build, target = module_at(ROOT / "hatch_build.py"), tmp_path / "kernels.so"
    target.write_text("of an older build")
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.delenv("UAVRT_PURE", raising=False)
    with pytest.raises(build.KernelsError, match="no-such-compiler"):
        build.build_kernels(ROOT, target)
    assert not target.exists()
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(build.KernelsError, match="apt install gcc"):
        build.build_kernels(ROOT, target)
    monkeypatch.setenv("UAVRT_PURE", "1")
    with pytest.raises(build.KernelsError, match="UAVRT_PURE"):
        build.build_kernels(ROOT, target)


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    headers = Path(sysconfig.get_paths()["include"])
    if shutil.which("cc") is None or not (headers / "Python.h").exists():
        pytest.skip("no C compiler with Python's headers")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("UAVRT_PURE", raising=False)


@pytest.mark.usefixtures("compiler")
def test_the_build_makes_kernels_that_load(tmp_path: Path) -> None:
    target = tmp_path / "_native.abi3.so"
    module_at(ROOT / "hatch_build.py").build_kernels(ROOT, target)
    module = module_at(target)
    assert module.INTERFACE == native.INTERFACE
    # What manylinux_2_17 promises (`make wheels`): libm's log, exp and pow are of 2.29.
    needed = re.findall(rb"GLIBC_(\d+)\.(\d+)", target.read_bytes())
    assert max((int(major), int(minor)) for major, minor in needed) <= (2, 17)
    out = np.empty(1, np.complex64)
    module.decimate(np.full(3, 1 - 2j, np.complex64), np.ones(6, np.float32), 2, out)
    assert out[0] == 3 - 6j


@pytest.mark.usefixtures("compiler")
def test_kernels_that_do_not_compile_say_why(tmp_path: Path) -> None:
    build = module_at(ROOT / "hatch_build.py")
    (tmp_path / "native").mkdir()
    (tmp_path / "native" / "kernels.c").write_text("int here(void) { return nowhere; }\n")
    with pytest.raises(build.KernelsError, match="nowhere"):
        build.build_kernels(tmp_path, tmp_path / "kernels.so")
    assert [path.name for path in tmp_path.iterdir()] == ["native"]
