"""What processes load to write their log."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("module", ["supervisor.program", "processes.recorder"])
def test_processes_that_see_no_samples_do_not_load_numpy(module: str) -> None:
    code = f"import sys, uavrt.{module}; print('numpy' in sys.modules, 'rich' in sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert loaded.stdout.split() == ["False", "False"]
