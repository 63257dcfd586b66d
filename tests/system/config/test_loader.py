"""What a process pays for its settings."""

import subprocess
import sys


def test_a_process_of_the_drone_imports_settings_without_pydantic() -> None:
    code = "import sys, uavrt.config; sys.exit('pydantic' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
