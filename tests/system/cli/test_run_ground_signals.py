"""``uavrt run --ground`` ends by Ctrl-C and SIGTERM at any moment, with all that it started."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("starlette")

RUN_BOTH = """
import sys
from uavrt.cli.system.run_ground import run_both
from uavrt.config.loader import load_settings

sys.exit(
    run_both(
        ["sh", "-c", sys.argv[1]],
        "udpout://127.0.0.1:9",
        settings=load_settings(sys.argv[2]),
        port=0,
        browser=False,
    )
)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_both_start_ends_both(tmp_path: Path, number: signal.Signals) -> None:
    """The drone side sends it as its first act, before the page has been started."""
    config = tmp_path / "uavrt.toml"
    config.write_text('[mavlink]\naddress = ""\n[recording]\ndirectory = "flights"\n')
    drone_side = f"echo $$ > drone; kill -{number.value} $PPID; exec sleep 60"
    ended = subprocess.run(
        [sys.executable, "-c", RUN_BOTH, drone_side, str(config)],
        cwd=tmp_path,
        timeout=40,
        check=False,
    )
    assert ended.returncode == 0
    assert not Path("/proc", (tmp_path / "drone").read_text().strip()).exists()
