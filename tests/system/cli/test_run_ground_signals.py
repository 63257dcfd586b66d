"""``uavrt run --ground`` ends by Ctrl-C and SIGTERM at any moment, with all that it started."""

import os
import signal
import sys
from pathlib import Path

import pytest
from forked import forked

from uavrt.cli.system.run_ground import run_both
from uavrt.config.loader import load_settings

pytest.importorskip("starlette")


def run_beside(drone_side: str, directory: Path) -> None:
    os.chdir(directory)
    settings = load_settings("uavrt.toml")
    link = "udpout://127.0.0.1:9"
    command = ["sh", "-c", drone_side]
    sys.exit(run_both(command, link, settings=settings, port=0, browser=False))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_both_start_ends_both(tmp_path: Path, number: signal.Signals) -> None:
    """The drone side sends it as its first act, before the page has been started."""
    (tmp_path / "uavrt.toml").write_text(
        '[mavlink]\naddress = ""\n[recording]\ndirectory = "flights"\n'
    )
    drone_side = f"echo $$ > drone; kill -{number.value} $PPID; exec sleep 60"
    both = forked(run_beside, drone_side, tmp_path)
    both.join(40.0)
    assert both.exitcode == 0
    assert not Path("/proc", (tmp_path / "drone").read_text().strip()).exists()
