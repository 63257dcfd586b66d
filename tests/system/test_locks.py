"""All that runs with uavrt may be shipped."""

import re

from command_line import python
from tests.unit.test_locks import ROOT


def test_all_that_runs_with_uavrt_may_be_shipped() -> None:
    checked = python(ROOT / "deploy/licences.py", "--check")
    assert checked.returncode == 0, checked.stderr
    listed = re.findall(r"^(numpy|scipy|pydantic)\s+\S+\s+\S", checked.stdout, re.M)
    assert listed == ["numpy", "pydantic", "scipy"]
