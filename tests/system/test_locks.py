"""All that runs with uavrt may be shipped."""

import re
import subprocess
import sys

from tests.unit.test_locks import ROOT


def test_all_that_runs_with_uavrt_may_be_shipped() -> None:
    checked = subprocess.run(
        [sys.executable, str(ROOT / "deploy/licences.py"), "--check"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stderr
    listed = re.findall(r"^(numpy|scipy|pydantic)\s+\S+\s+\S", checked.stdout, re.M)
    assert listed == ["numpy", "pydantic", "scipy"]
