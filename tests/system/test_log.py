"""What processes load to write their log."""

import pytest
from command_line import python


@pytest.mark.parametrize(
    "module", ["drone.supervisor.supervisor_program", "drone.processes.recorder"]
)
def test_processes_that_see_no_samples_do_not_load_numpy(module: str) -> None:
    code = f"import sys, uavrt.{module}; print('numpy' in sys.modules, 'rich' in sys.modules)"
    loaded = python("-c", code, check=True)
    assert loaded.stdout.split() == ["False", "False"]
